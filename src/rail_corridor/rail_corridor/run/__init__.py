"""Running a scenario: from the plan to processes and their end."""
