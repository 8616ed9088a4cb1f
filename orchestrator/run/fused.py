"""One body FMU of the package driven alone: it resolves its contacts inside its own long steps (`fused`)."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.core import runs, stepping
from vibroimpact.fmus.core.arrays import address
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging.archive import array_shapes, unpack, value_references
from vibroimpact.orchestrator.fmi.instance import DISCARD, WrapOf
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.run.record import (
    ROW_CAPACITY,
    ROW_WIDTH,
    DeadlineReached,
    ImpactLimitReached,
    RecordedBody,
    UnboundedMotion,
)


@dataclass(frozen=True, slots=True)
class HeldExciter:
    """An exciter that turns a voltage into a force at the start of a step: its numbers, its displacement variable."""

    magnet: stepping.Magnet
    displacement: str


class BodyDriver(RecordedBody):
    """Drives one instance of a body FMU (FMI 3.0), which all runs share.

    Parameters
    ----------
    floats : mapping of str to float
        Real parameters of the first run; later runs may change their values, not their names.
    integers : mapping of str to int
        Integer and enumeration parameters, the same for all runs.
    body : str
        Name of the FMU: `Oscillator`, `Chain` or `Beam`.
    wrap : callable or None
        Returns, for a component's name, the wrapper of its FMU's functions.

    Attributes
    ----------
    references : dict of str to int
        Value reference of each variable of the body.
    float_names : tuple of str
        Names of the real parameters, in the order of their values.
    integers : list of VariableGroup
        Integer and Boolean parameters, with their values.
    """

    def __init__(
        self,
        floats: Mapping[str, float],
        integers: Mapping[str, int],
        body: str = "Oscillator",
        *,
        wrap: WrapOf | None = None,
    ) -> None:
        self.fmu = unpack(fmu_path(body, "3.0"))
        self.references = value_references(self.fmu)
        self._shapes = array_shapes(self.fmu)
        self.instance = Instance3(self.fmu, "body", early_return=True, wrap=wrap and wrap("body"))
        super().__init__(self._group)
        self.float_names = tuple(floats)
        self._floats, self._places = self._parameters(self.float_names)
        self._held: tuple[str, ...] | None = None  # outputs of the last block without a record
        self.integers = []
        for kind, is_boolean in (("Int64", False), ("Boolean", True)):
            values = {name: v for name, v in integers.items() if isinstance(v, bool) is is_boolean}
            if values:
                group = self._group(kind, tuple(values))
                group.values[:] = list(values.values())
                self.integers.append(group)

    def _group(self, kind: str, names: Sequence[str], size: int | None = None) -> VariableGroup:
        count = size or sum(map(self.size, names))
        return self.instance.group(kind, [self.references[name] for name in names], size=count)

    def size(self, variable: str) -> int:
        """Return the number of values of a variable: more than one for an array."""
        return math.prod(self._shapes.get(variable, ()))

    @property
    def sets_arrays(self) -> bool:
        """Whether some real parameters are elements of arrays of the FMU, which are set as a whole."""
        return any(name not in self.references for name in self.float_names)

    @property
    def float_layout(self) -> tuple[NDArray[np.uint32], NDArray[np.int64], int]:
        """Value references of the variables with the real parameters, the place of each, and their size."""
        references = np.array(self._floats.references, dtype=np.uint32)
        return references, self._places, len(self._floats.values)

    def _parameters(self, names: Sequence[str]) -> tuple[VariableGroup, NDArray[np.int64]]:
        """Return the group of the variables that hold parameters, and the place of each parameter in its buffer.

        A parameter is a variable, or an element of an array: `mode.contact_shape[2,1]`.
        """
        first: dict[str, int] = {}
        places, size = [], 0
        for name in names:
            variable, element = name, 0
            if name not in self.references:
                variable, _, numbers = name.removesuffix("]").rpartition("[")
                index = tuple(int(number) - 1 for number in numbers.split(","))
                element = int(np.ravel_multi_index(index, self._shapes[variable]))
            if variable not in first:
                first[variable], size = size, size + self.size(variable)
            places.append(first[variable] + element)
        return self._group("Float64", tuple(first)), np.array(places, dtype=np.int64)

    @property
    def time(self) -> float:
        """The time reached, s."""
        return self.instance.time

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of the body's FMU."""
        return {"body": self.fmu.sha256}

    def begin(self, floats: Mapping[str, float], deadline: float | None) -> None:
        """Start a run at time 0 with these parameters; it may take `deadline` seconds of wall time."""
        self._deadline.begin(deadline)
        self.rows.blocks = []
        self._held = None
        instance = self.instance
        instance.log.take()  # discard messages of the run before
        instance.reset()
        self._floats.values[self._places] = [floats[name] for name in self.float_names]
        self._floats.set()
        for integers in self.integers:
            integers.set()
        instance.enter_initialization(0.0)
        instance.exit_initialization()
        self.warnings = instance.log.take()

    def advance(self, end: float) -> None:
        """Advance to time `end`, s.

        The body ends a step early when its record is full, and after some hundredths of a second of work. The rows are
        then taken, and Python checks the deadline and signals.
        """
        instance = self.instance
        while instance.time < end:
            self._deadline.refuse_late()
            status = instance.step(instance.time, end - instance.time)
            if instance.wants_to_end:
                raise UnboundedMotion(self._last_words())
            if status == DISCARD:
                raise ImpactLimitReached
            if instance.returned_early:
                self.take_rows()
            else:
                instance.time = end

    def advance_sampling(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Advance through all instants by one call; return the sampled variables at each of them."""
        return self.hold(times, None, self._sampled_names, recording=True)

    def hold(
        self,
        ends: NDArray[np.float64],
        forces: NDArray[np.float64] | None,
        outputs: Sequence[str],
        *,
        renewed: NDArray[np.uint8] | None = None,
        exciter: HeldExciter | None = None,
        recording: bool = False,
    ) -> NDArray[np.float64]:
        """Advance through all samples by one call, a force held before each; return outputs, shape (sample, output).

        The ends, s, ascend from the time reached. Each force, N, is held until its sample; with an exciter the forces
        are voltages, V. Without forces the force stays as it is. `renewed` is 1 where the force is set anew for the
        step to a sample; the default is every step. `outputs` are variables of the body, read at each sample. With
        `recording` the body records as set by `record`; without it, it records nothing from the first call on.

        ImpactLimitReached, UnboundedMotion, DeadlineReached: the run ends early; the error has its samples.
        ComponentError: the body fails, or touches the exciter.
        """
        if recording:
            self._held = None  # the next block without a record switches the record off
        elif self._held != tuple(outputs):
            self.record(impacts=False, extrema=False, periods=False)
            self._held = tuple(outputs)
        if forces is None:
            forces, renewed = np.zeros(len(ends)), np.zeros(len(ends), dtype=np.uint8)
        read = self._references_of(outputs)
        plan = self._hold_plan("force", read, exciter, recording=recording)
        return self._run_block(plan, ends, forces, renewed=renewed)

    def follow(
        self, times: NDArray[np.float64], name: str, inputs: NDArray[np.float64], rates: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Advance through all instants by one call; return the sampled variables at the begin of each step.

        The instants, s, ascend from the time reached, shape (step + 1,). At each but the last the input `name` is set,
        with its slope over the step; then the variables are read, shape (step, variable). Errors as of `hold`.
        """
        self._held = None
        read = self._references_of(self._sampled_names)
        plan = self._hold_plan(name, read, None, recording=True)
        plan.reads_begin = 1
        return self._run_block(plan, times[1:], inputs, rates=rates)

    def _run_block(
        self,
        plan: stepping.HoldPlan,
        ends: NDArray[np.float64],
        inputs: NDArray[np.float64],
        *,
        rates: NDArray[np.float64] | None = None,
        renewed: NDArray[np.uint8] | None = None,
    ) -> NDArray[np.float64]:
        """Advance through all samples by calls of C, and return the outputs of the plan."""
        samples = np.empty((len(ends), plan.outputs.count))
        rows = np.empty((plan.row_capacity, ROW_WIDTH))
        block = stepping.HoldBlock(
            count=len(ends),
            ends=address(ends),
            inputs=address(inputs),
            rates=None if rates is None else address(rates),
            renewed=None if renewed is None else address(renewed),
            samples=address(samples),
            time=self.instance.time,
            rows=address(rows),
            rows_room=len(rows),
        )
        end = stepping.HoldEnd.again
        while end == stepping.HoldEnd.again:
            if self._deadline.is_over:
                raise DeadlineReached(samples[: block.at])
            end = stepping.hold_samples(self._functions, plan, block)
            self.instance.time = block.time
            if block.rows_used:
                self.rows.blocks.append(rows[: block.rows_used].copy())
                block.rows_used = 0
        if end == stepping.HoldEnd.limit:
            raise ImpactLimitReached(samples[: block.at])
        if end == stepping.HoldEnd.ends:
            raise UnboundedMotion(self._last_words(), samples[: block.at])
        if end == stepping.HoldEnd.touches:
            raise ComponentError(
                f"exciter.distance: expected a body that stays away from its exciter, got one that touches it at time "
                f"{block.time:.17g}. Drive less, or give a larger distance.",
                instance="body",
            )
        if end == stepping.HoldEnd.refused:
            self.instance.fail("DoStep", f"refused the step to the sample at time {ends[block.at]:.17g}")
        return samples

    def _last_words(self) -> str:
        """Return the last message of the body, without the function that wrote it."""
        return "".join(self.instance.log.take()[-1:]).partition("DoStep: ")[2]

    def _references_of(self, names: Sequence[str]) -> NDArray[np.uint32]:
        return np.array([self.references[name] for name in names], dtype=np.uint32)

    def _hold_plan(
        self, name: str, read: NDArray[np.uint32], exciter: HeldExciter | None, *, recording: bool
    ) -> stepping.HoldPlan:
        """Return the plan of a block with an input; `read` are references of outputs, which the caller keeps."""
        references = self.references
        plan = stepping.HoldPlan(
            # a chain has other inputs, which are not set here
            input=references.get(name, 0),
            input_rate=references.get(f"{name}_rate", 0),
            outputs=runs.RunsVariables(address(read), len(read)),
        )
        if exciter is not None:
            plan.magnet = ctypes.pointer(exciter.magnet)
            plan.displacement = references[exciter.displacement]
        if recording:
            plan.record_count, plan.record_taken = references["record.count"], references["record.taken"]
            plan.record_rows, plan.row_capacity = references["record.rows"], ROW_CAPACITY
        return plan

    @cached_property
    def _functions(self) -> runs.RunsFmu:
        instance = self.instance
        functions = [instance.address_of(name) for name in runs.RunsFmu.FUNCTIONS]
        return runs.RunsFmu(instance.pointer, *functions, instance.log.environment)

    def close(self) -> None:
        """Free the instance."""
        self.instance.free()
