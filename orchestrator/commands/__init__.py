"""The command line: `cli` starts it, `table` names all commands, and one module carries out each command."""
