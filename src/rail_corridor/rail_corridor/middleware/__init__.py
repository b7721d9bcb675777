"""The middleware under the corridor: domains, and who discovers whom."""
