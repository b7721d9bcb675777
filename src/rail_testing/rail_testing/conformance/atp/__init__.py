"""Automatic train protection by movement authorities."""
