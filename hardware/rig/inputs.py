"""The requested inputs of a rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.recordings.naming import channel_name

MOST_INPUTS = 8


@dataclass(frozen=True, slots=True)
class Input:
    """An input that is recorded.

    Attributes
    ----------
    name : str
        Name of its channel.
    terminal : str
        Terminal of the device, such as `Dev1/ai0`.
    highest : float
        Range on both sides of 0, V.
    """

    name: str
    terminal: str
    highest: float


def inputs_of(texts: Sequence[str]) -> list[Input]:
    """Return the inputs in texts `NAME=TERMINAL[,RANGE]`.

    Raises
    ------
    UsageError
        A text has another form, a name occurs twice, or there are more than 8.
    """
    found: list[Input] = []
    for text in texts:
        name, _, rest = text.partition("=")
        terminal, _, highest = rest.partition(",")
        try:
            limit = float(highest) if highest else 5.0
        except ValueError:
            limit = 0.0
        good = name == channel_name(name, {each.name for each in found}) and 0.0 < limit < np.inf
        if not good or not terminal.strip():
            raise UsageError(
                f"--channel: expected NAME=TERMINAL[,RANGE], a new name of letters, got {text[:60]!r}. "
                "For example tip=Dev1/ai0,5."
            )
        found.append(Input(name, terminal.strip(), limit))
    if len(found) > MOST_INPUTS:
        raise UsageError(f"--channel: expected at most {MOST_INPUTS}, got {len(found)}.")
    return found
