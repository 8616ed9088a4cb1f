"""Components with one step size, on a grid of their own where the steps of the others are cut.

Such a component declares `canHandleVariableCommunicationStepSize = false`. Its step is made when the others have
reached its end: nothing is taken back, so it needs no states. It takes the inputs of the start of its own step, and
its outputs are held in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vibroimpact.orchestrator.fmi.capabilities import INTERNAL_STEP, VARIABLE_STEPS
from vibroimpact.orchestrator.fmi.instance import SAME_SIZE
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component

#: Relative distance of a ratio from a whole number, up to which it is whole by rounding: instants agree to 1e-13.
WHOLE = 1e-14


def is_multiple(time: float, step: float) -> bool:
    """Return whether a time, s, is a whole multiple of a step up to rounding.

    Examples
    --------
    >>> is_multiple(0.3, 0.1), is_multiple(0.25, 0.1)
    (True, False)
    """
    ratio = time / step
    if not math.isfinite(ratio):
        return False
    return abs(ratio - round(ratio)) <= WHOLE * ratio and (time == 0.0 or round(ratio) >= 1)


def own_step(macro_step: float, internal_step: float) -> float:
    """Return the step, s, of a component with one step size.

    Parameters
    ----------
    macro_step : float
        Longest communication step, s; it may be infinite.
    internal_step : float
        Declared step of the FMU's own solver, s; 0: none.

    Returns
    -------
    float
        `macro_step`, or the largest multiple of the internal step up to it, at least one.

    Examples
    --------
    >>> own_step(0.01, 0.0), own_step(0.01, 0.004), own_step(0.01, 0.05)
    (0.01, 0.008, 0.05)
    """
    if internal_step == 0.0 or is_multiple(macro_step, internal_step):
        return macro_step
    if not math.isfinite(macro_step):
        return internal_step
    return max(1, math.floor(macro_step / internal_step * (1.0 + SAME_SIZE))) * internal_step


@dataclass(frozen=True, slots=True)
class Divisions:
    """The times that divide runs.

    Attributes
    ----------
    macro_steps : tuple of float
        Longest communication steps of the runs, s; they may be infinite.
    ends : tuple of float
        Times from the start to which a run advances, s.
    """

    macro_steps: tuple[float, ...] = ()
    ends: tuple[float, ...] = ()

    def cut(self, internal_step: float) -> bool:
        """Do they cut steps of a component with one step size, whose solver has this step, s (0: none)?"""
        own = [own_step(step, internal_step) for step in self.macro_steps]
        return own != list(self.macro_steps) or not all(
            is_multiple(end, step) for end in self.ends for step in own if math.isfinite(step)
        )


def cut_components(
    components: Iterable[Component], divisions: Divisions, *, has_events: bool
) -> list[Component]:
    """Return the components with one step size whose steps may be cut.

    Parameters
    ----------
    components : iterable of Component
        All components.
    divisions : Divisions
        The times that divide runs.
    has_events : bool
        Contacts or watched events cut steps.
    """
    found = list(components)
    cutters = [c for c in found if c.event_mode or c.event_times is not None or c.capabilities.clocks]
    return [
        c
        for c in found
        if not c.capabilities.variable_steps
        and not c.capabilities.clocks  # its ticks need event mode
        and (
            has_events
            or any(other is not c for other in cutters)
            or divisions.cut(c.capabilities.internal_step)
        )
    ]


class OwnGrids:
    """The components with one step size among all; some are on a grid of their own.

    Attributes
    ----------
    components : list of Component
        Those on a grid of their own.
    next : float
        The next end of one of their steps, s, or infinite.
    """

    def __init__(self, components: Iterable[Component]) -> None:
        self._sized = [c for c in components if not c.capabilities.variable_steps]
        self.components = [component for component in self._sized if component.on_own_grid]
        self._start = 0.0
        self.next = math.inf

    def __bool__(self) -> bool:
        """Whether there is any such component."""
        return bool(self.components)

    def begin(self, start: float, macro_step: float) -> None:
        """Start a run at `start`, s, where the grid of each component begins."""
        self._start, self._count = start, [0] * len(self.components)
        for component in self._sized:
            step = own_step(macro_step, component.instance.internal_step)
            component.instance.only_step = step if math.isfinite(step) else 0.0
        self._find_next()

    def take_inputs(self, time: float) -> None:
        """Note the inputs of the components whose steps begin at `time`, s."""
        for place, component in enumerate(self.components):
            if abs(self._point(place) - time) <= _room(time):
                component.note_inputs()

    def reach(self, time: float) -> bool:
        """Make the steps that end at `time`, s; return whether a component requests the end of the run.

        ComponentError: a component fails, or discards its step.
        """
        ends = False
        for place, component in enumerate(self.components):
            if self._point(place, 1) > time + _room(time):
                continue
            component.write_inputs()
            component.instance.step_undiscarded(self._point(place), component.instance.only_step)
            ends = ends or component.instance.wants_to_end
            self._count[place] += 1
        self._find_next()
        return ends

    def remarks(self) -> list[str]:
        """Return the remarks on these components."""
        return [
            f"{c.name} takes steps of {c.instance.only_step:g} s alone ({VARIABLE_STEPS} = false) and was stepped on "
            "this grid: its outputs were held, and its inputs taken at the start of its steps"
            for c in self.components
        ]

    def _point(self, place: int, ahead: int = 0) -> float:
        """Return the start of a component's present step, s, or a later point of its grid."""
        return self._start + (self._count[place] + ahead) * self.components[place].instance.only_step

    def _find_next(self) -> None:
        self.next = min((self._point(place, 1) for place in range(len(self.components))), default=math.inf)


def step_remarks(component: Component, macro_step: float, samples: tuple[float, float] | None) -> list[str]:
    """Return the remark on values of a component between the points of its grid.

    Parameters
    ----------
    component : Component
        The component; it has run, and its steps were not cut.
    macro_step : float
        Longest communication step, s.
    samples : tuple of float, or None
        Time of the first sample of its variables, s, and the time between two; None without samples.
    """
    instance, declared, name = component.instance, component.capabilities, component.name
    if component.on_own_grid:
        return []
    if declared.variable_steps and not component.has_states and not _are_multiples(samples or (), macro_step):
        flag = f"canGetAndSet{instance.state_word} = false"
        return [f"samples of {name} between communication steps are interpolated ({flag})"]
    step = instance.internal_step if declared.variable_steps else instance.only_step
    times = (*(samples or ()), *((macro_step,) if declared.variable_steps else ()))
    if step == 0.0 or _are_multiples(times, step):
        return []
    if declared.variable_steps:
        what = f"has the values of the last multiple of {step:g} s ({INTERNAL_STEP})"
        return [f"{name} {what} between these multiples"]
    return [f"samples of {name} between its steps of {step:g} s are interpolated ({VARIABLE_STEPS} = false)"]


def _are_multiples(times: Iterable[float], step: float) -> bool:
    return all(is_multiple(time, step) for time in times)


def _room(time: float) -> float:
    return SAME_INSTANT * (1.0 + abs(time))
