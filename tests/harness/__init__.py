"""Workers are forked from one process after collection, commands from a warm process; a budget limits their cost.

`side_by_side` and `costs` are plugins of pytest that `tests/conftest.py` loads; tests start programs by `warm`.
"""
