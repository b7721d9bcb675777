"""The train bus: its cable, frames on it, and its reflectometer."""
