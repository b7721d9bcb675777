"""Track codes: FM messages in the rails."""
