"""FMUs and systems of other tools in our importer: `make zoo ZOO=folder`."""
