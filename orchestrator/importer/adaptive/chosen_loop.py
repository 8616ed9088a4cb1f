"""A step on trial and its two halves in C: the calls of `AdaptiveSteps`, with the same bits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from ctypes import c_void_p
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.coupling import (
    CallKind,
    ChosenStep,
    CouplingCalls,
    CouplingComponent,
    CouplingEnd,
    try_chosen_step,
)
from vibroimpact.orchestrator.importer.adaptive.outputs import ROUNDING, SMALLEST, STEADY, Outputs
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.plain_loop import PlainLoop, can_loop
from vibroimpact.orchestrator.importer.progress import Progress
from vibroimpact.orchestrator.importer.step_plan import StepPlan


class ChosenLoop:
    """Makes steps on trial in C.

    Parameters
    ----------
    plain : PlainLoop
        The calls of a step; all components have saved states.
    plan : StepPlan
        The moves between two trial steps.
    outputs : Outputs
        The compared variables, whose scales C code updates.
    slots : mapping of str to c_void_p
        The saved states of half steps, by component.
    share : float
        Part of the error of a step that its halves do not leave in the difference.

    Attributes
    ----------
    plain : PlainLoop
        As given.
    """

    def __init__(
        self,
        plain: PlainLoop,
        plan: StepPlan,
        outputs: Outputs,
        slots: Mapping[str, c_void_p],
        share: float,
    ) -> None:
        self.plain, self._outputs = plain, outputs
        paths = plan.paths
        components = [component for component, _ in paths]
        self._trial = (CouplingComponent * len(paths))(
            *(plain.component(c, inputs, slots[c.name]) for c, inputs in paths)
        )
        count, units = len(outputs), outputs.largest.size
        # memory whose addresses C code holds
        self._whole, self._before, self._halves = (np.zeros(count) for _ in range(3))
        self._times, self._flags = np.zeros(2 * len(paths)), np.zeros(len(paths), np.int32)
        self._at_event = np.zeros(len(paths), np.int32)
        arrays: dict[str, NDArray[Any]] = {
            "at_event": self._at_event,
            "kept_times": self._times,
            "kept_flags": self._flags,
            "whole": self._whole,
            "before": self._before,
            "halves": self._halves,
            "unit": outputs.unit,
            "known": outputs.known,
            "since": outputs.since,
            "rounding": outputs.rounding,
            "all_known": outputs.all_known,
            "largest": outputs.largest,
        }
        self._chosen = ChosenStep(
            trial=self._trial,
            moves=plain.calls(plan.trial_moves.calls),
            read=plain.calls(outputs.reads.calls),
            save_end=self._states(components, CallKind.save),
            restore_end=self._states(components, CallKind.restore),
            count=count,
            units=units,
            share=share,
            rounding_part=ROUNDING,
            steady=STEADY,
            smallest=SMALLEST,
            **{name: array.ctypes.data for name, array in arrays.items()},
        )

    def _states(self, components: Sequence[Component], kind: CallKind) -> CouplingCalls:
        return self.plain.array([self.plain.state_call(c, kind, c.at_end) for c in components])

    def begin(self, first_size: float) -> None:
        """Start a run with steps of a first size, s: the scales of the variables are new."""
        self._chosen.first_size = first_size
        self._chosen.window, self._chosen.tolerance = self._outputs.window, self._outputs.tolerance

    def try_step(self, time: float, target: float, progress: Progress) -> bool:
        """Make a step to `target`, s, and its halves; returns false with all components at the start.

        ComponentError: a call has failed.
        """
        run, chosen = self.plain.run, self._chosen
        run.start, run.target = time, target
        self.plain.give_times()
        came_to = try_chosen_step(self.plain.plan, chosen, progress, run)
        self.plain.take_times()
        if came_to is CouplingEnd.failed:
            self.plain.explain()
        if came_to is CouplingEnd.stepped:
            self.plain.explain_step()
        return came_to is CouplingEnd.reached

    def bound(self, shortest: float) -> None:
        """Set the shortest size of the next step, s: an event within it counts as one at its end."""
        self._chosen.shortest = shortest

    @property
    def error(self) -> tuple[float, str]:
        """The largest error of the last step over the tolerance, and the name of its variable."""
        return self._chosen.error, self._outputs.names[self._chosen.worst]


def chosen_loop(
    plan: StepPlan, outputs: Outputs, slots: Mapping[str, c_void_p], share: float
) -> ChosenLoop | None:
    """Return the loop of a plan; None where only Python can make its steps."""
    plain = plan.plain_loop
    components = [component for component, _ in plan.paths]
    if plain is None or not outputs.are_float64 or any(c.capabilities.asynchronous for c in components):
        return None
    if not can_loop(components, [plan.trial_moves, outputs.reads]):
        return None
    return ChosenLoop(plain, plan, outputs, slots, share)
