"""Drivers of FMUs by prebound ctypes calls: no look-ups, no allocation and no logging on the path of a step.

`library` loads a binary once for each process. `instance3` and `instance2` are one instance of FMI 3.0 or 2.0.
`variables` are groups of variables, read or written in one call.
"""
