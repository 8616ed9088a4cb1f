"""Rules between the fields of a scene; each rule yields its problems."""
