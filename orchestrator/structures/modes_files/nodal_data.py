"""Dataset 55 of universal files: one mode, with values at nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, isfinite

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes_files.real_shapes import Shapes
from vibroimpact.orchestrator.structures.readers.fortran_numbers import integer_of, real_of

LINES_BEFORE_NODES = 8
"""Records before the first node: five texts, the kind of the data, and the parameters of the analysis."""
MOST_LABEL = 10**9
"""Largest label of a node; a larger one is refused."""
_REAL_WIDTH, _REALS_PER_LINE = 13, 6
_NORMAL, _COMPLEX = 2, frozenset({3, 7})
_ANALYSES = {
    0: "an unknown analysis",
    1: "a static analysis",
    4: "a transient",
    5: "a frequency response",
    6: "buckling",
}
_TRANSLATIONS, _ROTATIONS = 3, 6
_DISPLACEMENT = frozenset({0, 1, 8})
_MOTIONS = {11: "velocities", 12: "accelerations"}
_REAL_DATA, _COMPLEX_DATA = 2, 5


@dataclass(frozen=True, slots=True, eq=False)
class NodalMode:
    """A mode.

    Attributes
    ----------
    number : int
    natural : float
        Natural angular frequency, rad/s.
    damping_ratio : float
    modal_mass : float or complex
        Shapes are divided by its square root.
    nodes : ndarray of int, shape (node,)
    values : ndarray of float or complex, shape (node, direction)
        Along x, y, z, and about them if there are six.
    is_conjugate : bool
        Whether the frequency is negative.
    """

    number: int
    natural: float
    damping_ratio: float
    modal_mass: float | complex
    nodes: NDArray[np.int64]
    values: Shapes
    is_conjugate: bool = False

    def scaled(self, modal_mass: float | complex, factors: Floats) -> NodalMode:
        """Return the mode with another modal mass, and its values times a factor of each direction."""
        return replace(self, modal_mass=modal_mass, values=self.values * factors)


def shape_of(first: int, lines: list[str]) -> NodalMode | str:
    """Return the mode of a dataset 55, or the name of other data.

    Parameters
    ----------
    first : int
        Line of the first record, for errors.
    lines : list of str
        At least `LINES_BEFORE_NODES`.

    Raises
    ------
    UsageError
        A record is damaged, the mode has no modal mass, or its shape is no displacement.
    """
    at = 5
    try:
        kinds = [integer_of(each) for each in lines[at].split()]
        if len(kinds) != 6:
            raise ValueError(f"expected 6 integers, got {len(kinds)}")
        _, analysis, characteristic, quantity, data_type, per_node = kinds
        other = _other_data(analysis, characteristic, quantity, per_node)
        if other:
            return other
        if quantity not in _DISPLACEMENT:
            raise ValueError(f"expected shapes of displacements (8), got {_MOTIONS[quantity]} ({quantity})")
        if data_type not in (_REAL_DATA, _COMPLEX_DATA):
            raise ValueError(f"expected real (2) or complex (5) data, got type {data_type}")
        at += 1
        number, reals = _parameters(lines[at])
        at += 1
        mode = _parameters_of_mode(analysis, number, reals_of(lines[at], _REAL_WIDTH, reals))
        each = per_node * (2 if data_type == _COMPLEX_DATA else 1)
        at += 1
        nodes, values = _values(lines, at, each)
    except _AtLine as problem:
        raise UsageError(f"line {first + problem.line}: dataset 55: {problem}.") from None
    except ValueError as problem:
        raise UsageError(f"line {first + at}: dataset 55: {problem}.") from None
    return replace(
        mode, nodes=nodes, values=values.view(np.complex128) if data_type == _COMPLEX_DATA else values
    )


class _AtLine(ValueError):
    """A fault in one of the lines of a dataset."""

    def __init__(self, line: int, why: object) -> None:
        self.line = line
        super().__init__(str(why))


def _other_data(analysis: int, characteristic: int, quantity: int, per_node: int) -> str:
    """Return the name of data that are no shape of a mode; empty for a shape."""
    if analysis != _NORMAL and analysis not in _COMPLEX:
        return _ANALYSES.get(analysis, f"an analysis of type {analysis}")
    if quantity not in _DISPLACEMENT and quantity not in _MOTIONS:
        return f"quantities of type {quantity}"
    if characteristic > 3 or per_node not in (_TRANSLATIONS, _ROTATIONS):
        return f"{per_node} values a node of characteristic {characteristic}"
    return ""


def _parameters(line: str) -> tuple[int, int]:
    """Return the number of the mode, and the count of its real parameters."""
    integers = [integer_of(each) for each in line.split()]
    if len(integers) < 4 or integers[0] != 2 or not 1 <= integers[1] <= _REALS_PER_LINE:
        raise ValueError(f"expected the load case and the number of a mode, got {line.strip()[:60]!r}")
    return integers[3], integers[1]


def _parameters_of_mode(analysis: int, number: int, reals: list[float]) -> NodalMode:
    """Return a mode without values."""
    expected = 4 if analysis == _NORMAL else 6
    if len(reals) != expected:
        raise ValueError(f"expected {expected} parameters of a mode, got {len(reals)}")
    mass: float | complex
    if analysis == _NORMAL:
        frequency, mass, viscous, hysteretic = reals
        natural, ratio = 2.0 * np.pi * frequency, viscous or 0.5 * hysteretic
    else:
        natural, ratio, mass = _from_eigenvalue(*reals)
    is_conjugate = analysis != _NORMAL and reals[1] < 0.0
    if not abs(ratio) < 1.0:
        raise ValueError(f"expected a damping ratio below 1, got {ratio:g}")
    if mass == 0.0 or (isinstance(mass, float) and not mass > 0.0):
        hint = "Write 1 for mass-normalised shapes" if analysis == _NORMAL else "Modal A or B gives it"
        raise ValueError(f"mode {number}: expected a modal mass > 0, got {mass:g}. {hint}")
    return NodalMode(number, natural, ratio, mass, np.empty(0, np.int64), np.empty((0, 3)), is_conjugate)


def _from_eigenvalue(
    real: float, imaginary: float, a_real: float, a_imaginary: float, b_real: float, b_imaginary: float
) -> tuple[float, float, complex]:
    """Return natural angular frequency, damping ratio and complex modal mass of a complex mode.

    Modal A is phi' (2 lambda M + C) phi, and modal B is -lambda A. Where the damping is proportional, modal A is
    2 j omega_d times the modal mass (docs/equations.md 8.11).
    """
    eigenvalue, modal_a, modal_b = (
        complex(real, imaginary),
        complex(a_real, a_imaginary),
        complex(b_real, b_imaginary),
    )
    if imaginary == 0.0:
        raise ValueError(f"expected the eigenvalue of an oscillation, got {eigenvalue:g}")
    if modal_a == 0.0:
        modal_a = -modal_b / eigenvalue
    natural = hypot(real, imaginary)
    return natural, -real / natural, modal_a / (2.0j * imaginary)


def _values(lines: list[str], start: int, each: int) -> tuple[NDArray[np.int64], Floats]:
    """Return the labels of nodes, and their values, shape (node, value)."""
    per_node = 1 + -(-each // _REALS_PER_LINE)
    count, rest = divmod(len(lines) - start, per_node)
    if rest:
        raise _AtLine(len(lines) - 1, f"expected {per_node} lines for each node, got {rest} for the last")
    nodes, values = np.empty(count, np.int64), np.empty((count, each))
    for place in range(count):
        at = start + place * per_node
        try:
            nodes[place] = _label(lines[at])
            for done in range(0, each, _REALS_PER_LINE):
                at += 1
                here = min(_REALS_PER_LINE, each - done)
                values[place, done : done + here] = reals_of(lines[at], _REAL_WIDTH, here)
        except ValueError as problem:
            raise _AtLine(at, problem) from None
    if len(np.unique(nodes)) < count:
        raise _AtLine(start, "expected each node once, got one again")
    return nodes, values


def _label(line: str) -> int:
    label = integer_of(line)
    if not 0 <= label <= MOST_LABEL:
        raise ValueError(f"expected the label of a node, got {label}")
    return label


def reals_of(line: str, width: int, count: int) -> list[float]:
    """Return the numbers of a line, each of some characters, or parted by blanks; ValueError: it has others.

    >>> reals_of(" 1.000000e+00-2.000000e+00", 13, 2)
    [1.0, -2.0]
    >>> reals_of("1.5 2.5", 13, 2)
    [1.5, 2.5]
    """
    line = line.rstrip()
    parts = [line[at : at + width] for at in range(0, width * count, width)]
    if len(line) != width * count:
        parts = line.split()
    found = [real_of(each) for each in parts]
    if len(found) != count or not all(map(isfinite, found)):
        raise ValueError(f"expected {count} finite numbers, got {line[:60]!r}")
    return found
