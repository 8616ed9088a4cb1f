"""Bodies among several, whose springs and dashpots may be negative: their motion may grow (equations.md 1.9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from vibroimpact.orchestrator.scene.body_models.beam import BeamBody
from vibroimpact.orchestrator.scene.body_models.chain import ChainBody
from vibroimpact.orchestrator.scene.body_models.modes import ModesBody
from vibroimpact.orchestrator.scene.body_models.oscillator import OscillatorBody
from vibroimpact.orchestrator.scene.body_models.points import OneBody
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import DAMPING, Finite, FiniteNumbers

GROWING_KEYS = frozenset(
    ("stiffness", "damping", "damping_ratio", "stiffnesses", "dampings", "far_stiffness", "far_damping")
)
"""Keys of bodies, and of links, that may be negative among several bodies."""
_NUMBERS = "an array of numbers, or one number for all"


class GrowingOscillator(OscillatorBody):
    """An oscillator among several bodies."""

    stiffness: Annotated[Finite, Rule(unit="N/m")]
    damping_given: Annotated[Finite, Rule(unit="N s/m", effect=DAMPING)] = Field(0.0, alias="damping")
    damping_ratio: Annotated[Finite | None, Rule(effect=DAMPING)] = None


class GrowingChain(ChainBody):
    """A chain among several bodies."""

    stiffnesses: Annotated[FiniteNumbers, Rule(_NUMBERS, unit="N/m", fmu="stiffness[i]")]
    dampings: Annotated[FiniteNumbers, Rule(_NUMBERS, unit="N s/m", fmu="damping[i]", effect=DAMPING)] = 0.0
    far_stiffness: Annotated[Finite, Rule(unit="N/m")] = 0.0
    far_damping: Annotated[Finite, Rule(unit="N s/m", effect=DAMPING)] = 0.0


PART_MODELS: dict[str, type[OneBody]] = {
    "oscillator": GrowingOscillator,
    "chain": GrowingChain,
    "beam": BeamBody,
    "modes": ModesBody,
}
"""Models of one of several bodies by kind."""


def has_negative(table: object) -> bool:
    """Return whether a table of a body, or of a link, has a negative spring or dashpot.

    Examples
    --------
    >>> has_negative({"stiffness": -1.0}), has_negative({"stiffnesses": [1.0, -2.0]}), has_negative({"mass": -1.0})
    (True, True, False)
    """
    written: Mapping[str, Any] = table if isinstance(table, dict) else {}
    return any(_is_negative(value) for key, value in written.items() if key in GROWING_KEYS)


def sweeps_negative(sweep: object, owner: str) -> bool:
    """Return whether a sweep gives negative springs or dashpots to the table of a key.

    Examples
    --------
    >>> sweeps_negative({"body.stiffness": {"values": [1.0, -1.0]}}, "body.")
    True
    """
    axes: Mapping[str, Any] = sweep if isinstance(sweep, dict) else {}
    return any(
        _is_negative(list(axis.values()))
        for key, axis in axes.items()
        if key.startswith(owner)
        and key.removeprefix(owner).partition("[")[0] in GROWING_KEYS
        and isinstance(axis, dict)
    )


def _is_negative(value: object) -> bool:
    if isinstance(value, list | tuple):
        return any(map(_is_negative, value))
    return isinstance(value, int | float) and -math.inf < value < 0.0
