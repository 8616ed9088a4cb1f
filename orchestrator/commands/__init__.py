"""The command line: `cli` is what starts, `table` names all commands, a module for each is what it does."""
