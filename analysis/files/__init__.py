"""Files that are whole or absent, and files that are not trusted: written, locked, sealed, checked first."""
