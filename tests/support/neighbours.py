"""Shapes of motion, their neighbours, and the work of each: bodies, stops, laws, restitutions and excitations.

Two shapes are neighbours if they differ in one thing by one step. The steps are twice the modes, twice the stops, the
next law, the next restitution and the next rate of excitation. A cliff is a neighbour whose impacts and whose periods
both take much more work. Work is counted in evaluations of one mode, so that it is the same on a loaded machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from support.structure import Modes, Stop, Structure
from vibroimpact.fmus.core import beam_modes

Array = NDArray[np.float64]

LAWS = ("restitution", "kelvin_voigt", "hertz", "hunt_crossley")
RESTITUTIONS, RATES = (0.3, 0.7, 0.9), (0.1, 0.3, 1.0, 3.0)
#: Steps from neighbour to neighbour, by the name of the number.
LADDERS: Mapping[str, tuple[float | int | str, ...]] = {
    "modes": (1, 2, 4, 8, 16, 32, 64),
    "stops": (1, 2, 4, 8),
    "law": LAWS,
    "restitution": RESTITUTIONS,
    "rate": RATES,
}
#: Work that steps do not count, in evaluations of each mode: for the start of a flight, and for each stop beside it.
FLIGHT, STOP = 8.0, 2.0
#: Periods before a measurement, by the number of modes: small bodies make tables after some thirty contacts.
SETTLING = {1: 20, 8: 20}


@dataclass(frozen=True)
class Shape:
    """One motion: a body of a kind with stops of one law, driven at `rate` times .97 of its first natural frequency."""

    body: str
    modes: int
    stops: int = 1
    law: str = "restitution"
    restitution: float = 0.7
    rate: float = 1.0

    def neighbours(self) -> Iterator[Shape]:
        """Yield the shapes one step up on each ladder."""
        for name, ladder in LADDERS.items():
            for value in ladder[ladder.index(getattr(self, name)) + 1 :][:1]:
                yield replace(self, **{name: value})  # type: ignore[arg-type]

    def __str__(self) -> str:
        return " ".join(str(getattr(self, one.name)) for one in fields(self))


@dataclass(frozen=True)
class Cost:
    """Cost of a shape, for each period of the force and for each impact; NaN without impacts."""

    period: float
    impact: float

    def over(self, other: Cost) -> float:
        """Return the factor over another cost, of a period or of an impact: the smaller one.

        A motion with few impacts does not hide that they are dear, nor do few impacts bear the cost of long flights.
        """
        periods, impacts = self.period / other.period, self.impact / other.impact
        return periods if math.isnan(impacts) else min(periods, impacts)


@lru_cache(maxsize=16)
def _beam(modes: int) -> tuple[Array, Callable[[list[float]], Array]]:
    found = beam_modes("clamped_free", modes)
    return np.asarray(found.eigenvalues) ** 2, lambda places: np.asarray(found.shapes(places))


def _chain(modes: int) -> tuple[Array, Callable[[list[float]], Array]]:
    # equal masses and springs of 1, fixed at one end
    matrix = 2.0 * np.eye(modes) - np.eye(modes, k=1) - np.eye(modes, k=-1)
    matrix[-1, -1] = 1.0
    squares, vectors = np.linalg.eigh(matrix)
    return np.sqrt(squares), lambda places: vectors[[round(place * (modes - 1)) for place in places]]


def body(shape: Shape) -> tuple[Structure, float]:
    """Return the body at rest, and the period of its force, s."""
    natural, shapes = _beam(shape.modes) if shape.body == "beam" else _chain(shape.modes)
    frequency = shape.rate * 0.97 * float(natural[0])
    tip = shapes([1.0])[0]
    amplitude = 0.5 * float(natural[0]) ** 2 / float(tip[0]) ** 2
    response = amplitude * tip**2 / (natural**2 - frequency**2 + 0.04j * natural * frequency)
    reach = min(0.2, 0.5 * abs(response.sum()))
    places = [1.0 - 0.7 * k / max(1, shape.stops - 1) for k in range(shape.stops)]
    stiffness = 100.0 * float(natural[0]) ** 2 / float(tip[0]) ** 2
    stops = [
        Stop(
            point,
            reach * place,
            law=shape.law,
            restitution=shape.restitution,
            stiffness=stiffness,
            damping=0.1,
        )
        for point, place in zip(shapes(places) if places else [], places, strict=True)
    ]
    modes = Modes(natural, 0.02, amplitude * tip, frequency)
    return Structure(modes, stops), 2.0 * math.pi / frequency


def measured(shape: Shape, reading: Callable[[Structure], float], settling: int, periods: int) -> Cost:
    """Return the cost of a shape by a reading that grows with it, after `settling` periods."""
    structure, period = body(shape)
    with structure:
        structure.advance(settling * period)
        before, impacts = reading(structure), len(structure.impacts)
        structure.advance(periods * period)
        cost = reading(structure) - before
        impacts = len(structure.impacts) - impacts
    return Cost(cost / periods, cost / impacts if impacts else math.nan)


def work(shape: Shape) -> Cost:
    """Return the work of a shape, in evaluations of one mode."""

    def evaluations(structure: Structure) -> float:
        flights = len(structure.impacts) + structure.time * shape.rate
        return structure.work + (FLIGHT + STOP * shape.stops) * shape.modes * flights

    return measured(shape, evaluations, settling=SETTLING.get(shape.modes, 6), periods=3)


def shapes() -> tuple[Shape, ...]:
    """Return the shapes: beams and chains of each size and law, and two small bodies at each restitution and rate."""
    sizes = (8, 16, 32, 64)
    several = [
        Shape(kind, modes, stops, law)
        for kind, counts in (("beam", (1, 2, 4, 8)), ("chain", (1,)))
        for modes in sizes
        for stops in counts
        for law in LAWS
    ]
    small = [
        Shape(kind, modes, 1, law, restitution, rate)
        for kind, modes in (("chain", 1), ("beam", 8))
        for law in LAWS
        for restitution in RESTITUTIONS
        for rate in RATES
        if law == "restitution" or restitution == 0.7
    ]
    return tuple(dict.fromkeys([*several, *small]))


def cliffs(costs: Mapping[Shape, Cost], ladder: str, most: float) -> list[str]:
    """Return the neighbours on a ladder of which one costs over `most` times the other, in words."""
    found = []
    for shape, cost in costs.items():
        for other in shape.neighbours():
            if other not in costs or getattr(other, ladder) == getattr(shape, ladder):
                continue
            factor = max(costs[other].over(cost), cost.over(costs[other]))
            if not factor <= most:
                found.append(f"{factor:.1f} between {shape} and {other}")
    return found
