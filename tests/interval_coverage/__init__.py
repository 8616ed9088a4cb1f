"""Do the 95 % intervals of `estimate impacts` contain the truth? `make coverage` checks 480 records.

The records come from a simulator of their own (`_motion`), which shares no code with the package.
"""
