"""Scenarios: the model of the file, loading and checking it."""
