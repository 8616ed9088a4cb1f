"""What the operations of this package do on the command line: `fmu` prints and checks components."""
