"""The command-line side of this package's operations, one module for each."""
