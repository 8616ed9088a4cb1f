"""Measured studies of a scene: `accuracy` (cost of accuracy in time), `effects` (cost and changes of each effect).

`ways` are the ways to simulate a scene; `preparation` finds the number of modes that meets its tolerance.
"""
