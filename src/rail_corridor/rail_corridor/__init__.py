"""Scenarios, launcher, report and the ``rail`` command line."""
