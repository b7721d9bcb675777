"""Recordings of runs as MCAP files, and their replay."""
