"""Random runs with restarts, slides, weak brakes, losses and double faults, judged by the truth."""
