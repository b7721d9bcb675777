"""Reflectograms measured in the workshop."""
