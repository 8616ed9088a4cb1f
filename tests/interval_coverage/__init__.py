"""Do the 95 % intervals of `estimate impacts` hold the truth? `make coverage` asks it of 480 records.

The records come from a simulator of their own (`_motion`), which shares no code with the package.
"""
