"""One connection of an algebraic loop: a number that is written to an input and read from an output."""

from __future__ import annotations

import math

from vibroimpact.orchestrator.importer.component import Component, kind_of
from vibroimpact.orchestrator.importer.feedthrough import connection_name
from vibroimpact.orchestrator.importer.wiring import Transfer

#: Kinds of variables that a loop solves by derivatives; all other kinds are substituted.
REAL_KINDS = ("Float64", "Float32")
#: Relative residual at which a loop counts as solved: of double numbers, and where a side is of single precision.
TOLERANCE, SINGLE_TOLERANCE = 1e-12, 1e-6
#: Exponent of 2 of the relative step of a difference: of double numbers, and where a side is of single precision.
DIFFERENCE, SINGLE_DIFFERENCE = -20, -10


class Link:
    """A connection of a loop, moved alone.

    Attributes
    ----------
    name : str
        `component.output -> component.input`.
    is_real : bool
        Both sides are real numbers without a clock.
    tolerance : float
        Relative residual at which the connection is consistent.
    source_reference, target_reference : int
        Value references of output and input.
    nominal : float
        Declared nominal value of the input or, over the gain, of the output; 0: none is declared.
    """

    def __init__(self, transfer: Transfer) -> None:
        self.transfer = transfer
        self.source, self.target = transfer.source, transfer.target
        (self.connection,) = transfer.connections
        self.name = connection_name(self.connection)
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
    def gain(self) -> float:
        """Present gain of the connection."""
        return self.transfer.gain_of(self.connection)

    def start(self) -> float:
        """Return the present value of the input; NaN where its FMU discards the call."""
        group = self.transfer.write
        return float(group.values[0]) if group.try_get() else math.nan

    def write(self, value: float) -> bool:
        """Write the input; returns whether its FMU has taken the value (it may discard it)."""
        self.transfer.write.values[0] = value
        return self.transfer.write.try_set()

    def read(self) -> float:
        """Return the input that the output causes; NaN where its FMU discards the call."""
        transfer = self.transfer
        if not transfer.read.try_get():
            return math.nan
        if transfer.convert is not None:
            transfer.convert()
        return float(transfer.write.values[0])

    def near(self, value: float, size: float, side: float) -> float:
        """Return a value near another one, on one side (1 or -1); `size` is a size of values that are not small."""
        scale = max(abs(value), size) or self.nominal or 1.0
        return value + side * math.ldexp(1.0, math.frexp(scale)[1] + self._exponent)
