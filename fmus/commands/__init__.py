"""Implementations of this package's operations on the command line: `fmu` prints and checks components."""
