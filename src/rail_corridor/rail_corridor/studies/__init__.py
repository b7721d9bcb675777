"""Studies: many runs of one question."""
