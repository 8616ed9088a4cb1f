"""Communication steps that follow an error estimate: the estimate, the controller of the size, and the driver.

docs/coupling.md has the method, docs/equations.md 6.19 its formulas.
"""
