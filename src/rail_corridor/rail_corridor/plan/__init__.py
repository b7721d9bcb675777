"""From a scenario to what runs: nodes, their parameters, the world file."""
