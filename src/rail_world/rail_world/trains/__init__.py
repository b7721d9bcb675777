"""Trains: vehicles, drivers and how they move."""
