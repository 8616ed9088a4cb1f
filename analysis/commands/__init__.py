"""Code behind the operations of this package on the command line, a module for each."""
