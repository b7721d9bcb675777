"""Headway against the margin of the train radio."""
