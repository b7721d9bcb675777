"""Time-domain reflectometry of the bus cable: from traces to faults."""
