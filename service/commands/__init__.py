"""Implementations of this package's operations on the command line, one module each."""
