"""Python processes that this package starts, and what they and their starters say to each other."""
