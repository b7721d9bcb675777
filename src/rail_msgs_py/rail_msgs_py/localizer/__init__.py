"""One position on board from all sensors."""
