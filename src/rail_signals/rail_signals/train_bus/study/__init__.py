"""Studies of fault detection on the bus cable."""
