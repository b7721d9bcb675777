"""The train bus and its reflectometer."""
