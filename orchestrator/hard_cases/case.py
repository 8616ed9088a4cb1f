"""What a hard case is, and what was measured of one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Curve:
    """What is drawn of a case."""

    x: Floats
    y: Floats
    """`x` and `y`: shape (point,); a 0 on a logarithmic axis is drawn at the bottom."""
    x_label: str
    y_label: str
    """`x_label` and `y_label`: with units."""
    x_log: bool = False
    y_log: bool = True
    is_bounded: bool = True
    """Whether the bound of the case is one of `y`, and drawn."""


@dataclass(frozen=True, slots=True)
class Found:
    """What was measured of a case."""

    figure: float
    """How far the claim is from being exact, in what the case says; NaN: it could not be measured."""
    curve: Curve


@dataclass(frozen=True, slots=True)
class HardCase:
    """What breaks solvers of impacts, and a claim about it that is measured."""

    name: str
    """As `--only` and the page have it."""
    theme: str
    """Heading of the page."""
    title: str
    """The case in a few words."""
    claim: str
    """What is to hold."""
    reference: str
    """What the figure is measured against."""
    of: str
    """What the figure is."""
    bound: float
    """Of the figure: 30 times what was measured where it is an error, and 4 units in the last place at least."""
    measure: Callable[[], Found]
    is_time: bool = False
    """The figure is processor time, s: beyond its bound the machine is slow, and nothing is wrong."""


def relative(found: Floats | float, expected: Floats | float) -> Floats:
    """Return relative errors, shape as given."""
    quotient = np.asarray(found, dtype=np.float64) / np.asarray(expected, dtype=np.float64)
    return np.asarray(np.abs(quotient - 1.0), dtype=np.float64)


def largest(errors: Floats) -> float:
    """Return the largest error; NaN where there is none, or one is NaN."""
    return float(np.max(errors)) if errors.size else float("nan")
