"""Rules between the fields of a scene; each yields the problems that it finds."""
