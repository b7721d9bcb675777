"""Train control by radio: the space-time coded link and what runs over it."""
