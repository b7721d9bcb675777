"""The railway line: alignments, tracks, the network they make, files that describe them."""
