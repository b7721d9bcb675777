"""Loading a scenario: files, overrides, checks."""
