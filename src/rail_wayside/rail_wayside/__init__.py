"""Wayside equipment: wayside ranging stations (WRS) and zone controllers."""
