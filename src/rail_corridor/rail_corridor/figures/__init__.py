"""Figures of the source documents and of runs."""
