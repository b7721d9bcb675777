"""Axle counters: wheel sensors at block borders, and what counts between them."""
