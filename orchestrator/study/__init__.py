"""Measured studies of a scene: `accuracy` is what accuracy costs in time, `effects` what each effect costs and changes.

`ways` are the ways in which a scene can be simulated, `preparation` finds out how many modes it takes.
"""
