"""One body FMU of ours, driven through whole runs: parameters in, the rows of its record out.

The body follows its own contacts inside one long step and keeps the record itself, so that no call into
Python or FMI is made for an impact.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.archive import UnpackedFmu, unpack
from vibroimpact.fmus.fmpy_door import read_description
from vibroimpact.orchestrator.fmi.instance import DISCARD
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.variables import VariableGroup

ROW_WIDTH = 8
ROW_CAPACITY = 512
ROW_IMPACT, ROW_STICK, ROW_PERIOD = 1.0, 2.0, 3.0
OUTPUTS = (
    "displacement",
    "velocity",
    "acceleration",
    "record.displacement_max",
    "record.displacement_min",
    "contact[1].force",
    "contact[2].force",
    "contact[1].stick_start",
    "contact[2].stick_start",
)


class ImpactLimitReached(Exception):
    """A step met `impact_limit` impacts; the run ends here with what it has."""


class DeadlineReached(Exception):
    """A run took longer than its deadline; it ends here with what it has."""


@dataclass(slots=True)
class Rows:
    """Rows taken from a body's record, in the order they were written; shape (row, 8) each."""

    blocks: list[NDArray[np.float64]] = field(default_factory=list)

    def of_kind(self, kind: float) -> NDArray[np.float64]:
        """Return the rows of one kind, shape (n, 8)."""
        rows = np.concatenate(self.blocks) if self.blocks else np.empty((0, ROW_WIDTH))
        chosen: NDArray[np.float64] = rows[rows[:, 0] == kind]
        return chosen


class BodyDriver:
    """Drives one instance of the Oscillator FMU (FMI 3.0), which is used again for every run.

    Parameters
    ----------
    floats : mapping of str to float
        Real parameters of the first run; later runs may change their values, not their names.
    integers : mapping of str to int
        Integer and enumeration parameters, the same for all runs.
    """

    def __init__(self, floats: Mapping[str, float], integers: Mapping[str, int]) -> None:
        self.fmu: UnpackedFmu = unpack(fmu_path("Oscillator", "3.0"))
        variables = read_description(self.fmu.source).modelVariables
        self._references = {v.name: v.valueReference for v in variables}
        self.instance = Instance3(self.fmu, "body", early_return=True)
        self._floats = self._group("Float64", floats)
        self._float_names = tuple(floats)
        self._integers = self._group("Int64", integers)
        self._integers.values[:] = list(integers.values())
        self._outputs = self._group("Float64", OUTPUTS)
        self._switches = self._group("Boolean", ("record.impacts", "record.extrema", "record.periods"))
        self._stuck = self._group("Boolean", ("contact[1].stuck", "contact[2].stuck"))
        self._count = self._group("Int64", ("record.count",))
        self._taken = self._group("Int64", ("record.taken",))
        self._rows = self.instance.group(
            "Float64", [self._references["record.rows"]], size=ROW_CAPACITY * ROW_WIDTH
        )
        self._table = self._rows.values.reshape(ROW_CAPACITY, ROW_WIDTH)
        self._deadline = np.inf
        self.rows = Rows()

    def _group(self, kind: str, names: Mapping[str, object] | tuple[str, ...]) -> VariableGroup:
        return self.instance.group(kind, [self._references[name] for name in names])

    @property
    def time(self) -> float:
        """The time reached, s."""
        return self.instance.time

    def begin(self, floats: Mapping[str, float], deadline: float | None) -> None:
        """Start a run at time 0 with these parameters; it may take `deadline` seconds of wall time."""
        self._deadline = np.inf if deadline is None else time.perf_counter() + deadline
        self.rows = Rows()
        instance = self.instance
        instance.reset()
        self._floats.values[:] = [floats[name] for name in self._float_names]
        self._floats.set()
        self._integers.set()
        instance.enter_initialization(0.0)
        instance.exit_initialization()

    def record(self, *, impacts: bool, extrema: bool, periods: bool) -> None:
        """Say what the body records from now on."""
        self._switches.values[:] = (impacts, extrema, periods)
        self._switches.set()

    def advance(self, end: float, slice_length: float = np.inf) -> None:
        """Advance to time `end`, s, taking the record's rows whenever it is full.

        Raises
        ------
        ImpactLimitReached, DeadlineReached
            The run ends before.
        """
        instance = self.instance
        while instance.time < end:
            if time.perf_counter() > self._deadline:
                raise DeadlineReached
            size = min(end - instance.time, slice_length)
            target = end if size == end - instance.time else instance.time + size
            status = instance.step(instance.time, size)
            if status == DISCARD:
                raise ImpactLimitReached
            if instance.returned_early:
                self.take_rows()
            else:
                instance.time = target

    def take_rows(self) -> None:
        """Take the rows that the body has recorded since the last time."""
        count = int(self._count.get()[0])
        if count:
            self._rows.get()
            self.rows.blocks.append(self._table[:count].copy())
            self._taken.values[0] = count
            self._taken.set()

    def outputs(self) -> NDArray[np.float64]:
        """Return the present values of `OUTPUTS`; the buffer is used again at the next call."""
        return self._outputs.get()

    def sticks_open(self) -> list[tuple[int, float]]:
        """Return the contacts (1-based) that the body rests on, with the time it came to rest, s."""
        stuck = self._stuck.get()
        starts = self._outputs.get()[-2:]
        return [(k + 1, float(starts[k])) for k in range(2) if stuck[k]]

    def close(self) -> None:
        """Free the instance."""
        self.instance.free()
