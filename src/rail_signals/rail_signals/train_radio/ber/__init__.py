"""Bit error rates of the space-time coded link: closed forms and Monte-Carlo."""
