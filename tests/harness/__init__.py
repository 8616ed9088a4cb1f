"""Workers are forked from one process that has collected, commands from a warm one; a budget holds their cost.

`side_by_side` and `costs` are plugins of pytest that `tests/conftest.py` loads; tests start programs by `warm`.
"""
