"""What the operations of this package do on the command line, a module for each."""
