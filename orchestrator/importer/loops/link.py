"""One number of an algebraic loop, written to an input and read from an output: a connection, or an element of it."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.feedthrough import connection_name
from vibroimpact.orchestrator.importer.wiring import Transfer

#: Kinds of variables that a loop solves by derivatives; all other kinds are substituted.
REAL_KINDS = ("Float64", "Float32")
#: Relative residual at which a loop counts as solved: of double numbers, and where a side is of single precision.
TOLERANCE, SINGLE_TOLERANCE = 1e-12, 1e-6
#: Exponent of 2 of the relative step of a difference: of double numbers, and where a side is of single precision.
DIFFERENCE, SINGLE_DIFFERENCE = -20, -10


class Link:
    """A connection of a loop, moved alone, or one element of a connection of arrays.

    Parameters
    ----------
    transfer : Transfer
        Moves the connection alone.
    element : int
        Place of the element in the array; 0 for a single number.
    written : ndarray
        The values written last, which all elements of a connection share.

    Attributes
    ----------
    name : str
        `component.output -> component.input`, with the number of the element.
    is_element : bool
        The connection is one of arrays.
    is_real : bool
        Both sides are real numbers without a clock.
    tolerance : float
        Relative residual at which the connection is consistent.
    source_reference, target_reference : int
        Value references of output and input.
    nominal : float
        Declared nominal value of the input or, over the gain, of the output; 0: none is declared.
    """

    def __init__(self, transfer: Transfer, element: int, written: NDArray[Any]) -> None:
        self.transfer = transfer
        self._element, self._written = element, written
        self.source, self.target = transfer.source, transfer.target
        (self.connection,) = transfer.connections
        self.is_element = self.connection.source[1] in self.source.shapes
        self.name = connection_name(self.connection) + (f" [{element + 1}]" if self.is_element else "")
        ends = ((self.source, self.connection.source[1]), (self.target, self.connection.target[1]))
        kinds = [kind_of(component.variables[name]) for component, name in ends]
        clocks = [component.clocks_of(name) for component, name in ends]
        self.is_real = all(kind in REAL_KINDS for kind in kinds) and not any(clocks)
        is_single = "Float32" in kinds
        self.tolerance = SINGLE_TOLERANCE if is_single else TOLERANCE
        self._exponent = SINGLE_DIFFERENCE if is_single else DIFFERENCE
        self.source_reference = int(ends[0][0].variables[ends[0][1]].valueReference)
        self.target_reference = int(ends[1][0].variables[ends[1][1]].valueReference)
        self.nominal = max(self._nominal(*ends[0]) * abs(self.gain), self._nominal(*ends[1]))

    @staticmethod
    def _nominal(component: Component, name: str) -> float:
        value = abs(float(component.variables[name].nominal or 0.0))
        return value if math.isfinite(value) else 0.0

    @property
    def output(self) -> object:
        """The number that the link reads."""
        return self.connection.source, self._element

    @property
    def gain(self) -> float:
        """Present gain of the connection."""
        return self.transfer.gain_of(self.connection)

    def start(self) -> float:
        """Return the present value of the input; NaN where its FMU discards the call."""
        group = self.transfer.write
        if not group.try_get():
            return math.nan
        self._written[:] = group.values
        return float(self._written[self._element])

    def write(self, value: float) -> bool:
        """Write the input; returns whether its FMU has taken the value (it may discard it)."""
        self._written[self._element] = value
        self.transfer.write.values[:] = self._written
        return self.transfer.write.try_set()

    def read(self) -> float:
        """Return the input that the output causes; NaN where its FMU discards the call."""
        transfer = self.transfer
        if not transfer.read.try_get():
            return math.nan
        if transfer.convert is not None:
            transfer.convert()
        return float(transfer.write.values[self._element])

    def near(self, value: float, size: float, side: float) -> float:
        """Return a value near another one, on one side (1 or -1); `size` is a size of values that are not small."""
        scale = max(abs(value), size) or self.nominal or 1.0
        return value + side * math.ldexp(1.0, math.frexp(scale)[1] + self._exponent)
