"""How many messages the receivers of track codes get wrong, counted and by closed forms."""
