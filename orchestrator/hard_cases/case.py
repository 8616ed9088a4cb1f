"""A hard case, and its measurement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Curve:
    """The curve of a case, to be drawn."""

    x: Floats
    y: Floats
    """`x` and `y`: shape (point,); a 0 on a logarithmic axis is drawn at the bottom."""
    x_label: str
    y_label: str
    """`x_label` and `y_label`: with units."""
    x_log: bool = False
    y_log: bool = True
    is_bounded: bool = True
    """Whether the bound of the case is a value of `y`, and drawn."""


@dataclass(frozen=True, slots=True)
class Found:
    """The measurement of a case."""

    figure: float
    """Deviation from the claim, as `of` defines it; NaN if it could not be measured."""
    curve: Curve


@dataclass(frozen=True, slots=True)
class HardCase:
    """A claim about a motion that is hard for solvers of impacts, and how to measure it."""

    name: str
    """The name in `--only` and on the page."""
    theme: str
    """Heading of the page."""
    title: str
    """The case in a few words."""
    claim: str
    """The claim to verify."""
    reference: str
    """The reference for the figure."""
    of: str
    """Definition of the figure."""
    bound: float
    """Bound of the figure: for an error, 30 times the measured one, and at least 4 units in the last place."""
    measure: Callable[[], Found]
    is_time: bool = False
    """The figure is processor time, s: beyond its bound the machine is slow, and no result is wrong."""


def relative(found: Floats | float, expected: Floats | float) -> Floats:
    """Return relative errors, shape as given."""
    quotient = np.asarray(found, dtype=np.float64) / np.asarray(expected, dtype=np.float64)
    return np.asarray(np.abs(quotient - 1.0), dtype=np.float64)


def largest(errors: Floats) -> float:
    """Return the largest error; NaN if there is none, or one is NaN."""
    return float(np.max(errors)) if errors.size else float("nan")
