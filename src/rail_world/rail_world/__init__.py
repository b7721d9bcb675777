"""The truth: tracks and alignments, train motion, the media between ports, and the tick.

Equipment never imports this package; it knows its ports only.
"""
