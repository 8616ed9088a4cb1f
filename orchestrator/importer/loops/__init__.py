"""Algebraic loops: connections whose values depend on each other at one instant.

`solver` finds the loops of an importer and keeps their order. `newton` solves one loop, and `slopes` has its slopes,
from directional derivatives or differences. `link` moves one connection. The module `feedthrough` has the graph.
"""
