"""The vehicle station of phase ranging."""
