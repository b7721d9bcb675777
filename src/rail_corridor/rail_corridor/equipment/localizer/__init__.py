"""One position on board from all sensors, with its protection level."""
