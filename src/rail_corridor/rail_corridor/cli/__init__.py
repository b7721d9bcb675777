"""The command line `rail`."""
