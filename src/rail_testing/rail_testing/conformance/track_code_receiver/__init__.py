"""The receiver of track codes."""
