"""Monte-Carlo studies of the localizer's integrity."""
