"""On-board equipment: the vehicle ranging station (VRS), a regenerative transponder."""
