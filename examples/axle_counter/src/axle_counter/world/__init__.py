"""The truth: how axles damp the coils."""
