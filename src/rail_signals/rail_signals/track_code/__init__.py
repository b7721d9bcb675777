"""Track codes: FM messages in the rails and what comes of them."""
