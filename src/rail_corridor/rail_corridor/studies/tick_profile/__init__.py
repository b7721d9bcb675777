"""Where the time of a tick goes, and the floors beside it: ``rail profile``."""
