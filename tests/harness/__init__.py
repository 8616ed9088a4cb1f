"""How the tests run: workers forked from one process that has collected, commands forked from a warm one, a budget.

`side_by_side` and `costs` are plugins of pytest that `tests/conftest.py` loads; tests start programs by `warm`.
"""
