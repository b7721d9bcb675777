"""Positions from the Doppler shifts of reference stations."""
