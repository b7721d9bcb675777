"""The localizer: one position on board from all sensors."""
