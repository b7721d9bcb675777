"""The report of a run, from messages to a JSON object and a table."""
