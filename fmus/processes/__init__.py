"""Python processes that this package starts, and their communication with it."""
