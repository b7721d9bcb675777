"""Wheel sensors, axles and counts as pure functions and classes; no ROS."""
