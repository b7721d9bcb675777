"""A corridor in this process that stands between calls: for tests, and for studies in Python."""
