"""What a process does that this package has started: it keeps its pipes to itself."""

from __future__ import annotations

import os

STANDARD_INPUT, STANDARD_OUTPUT, STANDARD_ERROR = range(3)


def private_pipes() -> tuple[int, int]:
    """Keep the pipes of orders and of answers; return their descriptors.

    Neither an FMU nor a program that it starts can read an order then, or hold the answers open. What they print goes
    to standard error.
    """
    orders, answers = os.dup(STANDARD_INPUT), os.dup(STANDARD_OUTPUT)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, STANDARD_INPUT)
    os.close(nothing)
    os.dup2(STANDARD_ERROR, STANDARD_OUTPUT)
    return orders, answers
