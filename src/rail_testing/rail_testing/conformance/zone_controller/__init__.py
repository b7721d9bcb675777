"""The zone controller: positions and movement authorities."""
