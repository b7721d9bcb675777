"""What the corridor asks: section, faults, placement, nodes, report."""
