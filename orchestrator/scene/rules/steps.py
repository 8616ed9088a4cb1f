"""Rules of components whose communication steps may not be cut anywhere: of one step size, or on a grid of their own.

What is known before a run is refused with the scene, by the name of the attribute; a step that an event of another
component cuts is refused where it happens (`orchestrator/fmi/instance.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from vibroimpact.orchestrator.fmi.capabilities import INTERNAL_STEP, VARIABLE_STEPS
from vibroimpact.orchestrator.scene.component_facts import ComponentFacts
from vibroimpact.orchestrator.scene.component_models import BodyPair, StopContactTable
from vibroimpact.orchestrator.scene.component_numbers import STEP_KEY, component_variable
from vibroimpact.orchestrator.scene.components import GeneralDraft
from vibroimpact.orchestrator.scene.problems import Problem, key_path

#: Largest distance of a ratio from a whole number, relative, that rounding explains: instants agree to 1e-13.
WHOLE = 1e-14


class _Grid(NamedTuple):
    """The times, s, of whose multiples the steps of a component may end, and the attribute that says so."""

    name: str
    facts: ComponentFacts
    step: float
    attribute: str

    @property
    def owner(self) -> str:
        """The file and the attribute, as a problem names them."""
        return f"{self.facts.file} ({self.attribute})"


def step_problems(draft: GeneralDraft) -> list[Problem]:
    """Return everything that would cut a step of a component that takes no cut ones."""
    if draft.record is None or draft.execution is None:
        return []
    limited = {
        name: component.facts
        for name, component in draft.components.items()
        if component.facts is not None and component.facts.capabilities.grid
    }
    if not limited:
        return []
    macro_steps = draft.swept_steps() or (draft.execution.macro_step or _duration(draft),)
    problems = [*_contact_problems(draft, limited), *_event_problems(draft, limited)]
    for macro_step in macro_steps:
        for grid in _grids(limited, macro_step):
            problems += _macro_step_problems(draft, grid, macro_step)
            problems += _rate_problems(draft, grid)
            problems += _clock_problems(draft, grid)
    return problems


def _duration(draft: GeneralDraft) -> float:
    assert draft.record is not None
    return draft.record.transient_time + draft.record.recorded_time


def _grids(limited: dict[str, ComponentFacts], macro_step: float) -> Iterator[_Grid]:
    for name, facts in limited.items():
        declared = facts.capabilities
        if not declared.variable_steps:
            yield _Grid(name, facts, macro_step, f"{VARIABLE_STEPS} = false")
        if declared.internal_step > 0.0:
            yield _Grid(name, facts, declared.internal_step, f"{INTERNAL_STEP} = {declared.internal_step:g}")


def _is_multiple(time: float, step: float) -> bool:
    """Is a time, s, a whole multiple of a step but for rounding?"""
    ratio = time / step
    if not math.isfinite(ratio):
        return False
    return abs(ratio - round(ratio)) <= WHOLE * ratio and (time == 0.0 or round(ratio) >= 1)


def _in_digits(value: float) -> str:
    """Return a number in six digits, or in all that it has, so that one off by a rounding shows it."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _macro_step_problems(draft: GeneralDraft, grid: _Grid, macro_step: float) -> Iterator[Problem]:
    assert draft.record is not None
    if not _is_multiple(macro_step, grid.step):
        expected = f"a multiple of {grid.step:g} s, the step of {grid.owner}"
        yield Problem(STEP_KEY, expected, _in_digits(macro_step))
    if grid.facts.capabilities.variable_steps:
        return
    for key in ("transient_time", "recorded_time"):
        value = getattr(draft.record, key)
        if not _is_multiple(value, macro_step):
            expected = f"a multiple of macro_step = {macro_step:g} s, the only step of {grid.owner}"
            yield Problem(key_path(("record", key)), expected, _in_digits(value), _step_hint(draft))


def _step_hint(draft: GeneralDraft) -> str:
    """Return the advice for a scene whose only step is the whole run."""
    assert draft.execution is not None
    has_step = draft.execution.macro_step is not None or draft.swept_steps()
    return "" if has_step else "Add macro_step = ... to [execution]: the size of the steps."


def _rate_problems(draft: GeneralDraft, grid: _Grid) -> Iterator[Problem]:
    """A sample inside a step is read in a shorter one, of a component with states; of others it is interpolated."""
    record = draft.record
    assert record is not None
    read = any(component_variable(variable)[0] == grid.name for variable in record.variables)
    if record.rate is None or not read or not grid.facts.restorable:
        return
    if not _is_multiple(1.0 / record.rate, grid.step) or not _is_multiple(record.transient_time, grid.step):
        expected = f"samples at multiples of {grid.step:g} s, the step of {grid.owner}"
        hint = _step_hint(draft) or f"Use a rate of {1.0 / grid.step:g}, or that over a whole number."
        got = f"{_in_digits(record.rate)} from {_in_digits(record.transient_time)} s on"
        yield Problem("record.rate", expected, got, hint)


def _clock_problems(draft: GeneralDraft, grid: _Grid) -> Iterator[Problem]:
    """The steps of all end where a clock ticks."""
    if grid.facts.capabilities.variable_steps:
        return
    for name, component in draft.components.items():
        facts = component.facts
        for clock in facts.capabilities.clocks if facts is not None else ():
            times = (clock.interval, clock.shift)
            if facts is not None and not all(t is None or _is_multiple(float(t), grid.step) for t in times):
                expected = f"clocks that tick at multiples of {grid.step:g} s, the only step of {grid.owner}"
                got = f"the input clock {clock.name} of {facts.file}"
                yield Problem(key_path(("component", name, "fmu")), expected, got)


def _contact_problems(draft: GeneralDraft, limited: dict[str, ComponentFacts]) -> Iterator[Problem]:
    """Steps end where bodies touch, and the mass of a body is measured in short ones."""
    for place, table in enumerate(draft.contacts):
        for name, facts in limited.items() if table is not None else ():
            if facts.capabilities.variable_steps and name not in _members(table):
                continue  # on its own grid, beside a contact of others
            got = f"{facts.file} ({facts.capabilities.grid})"
            hint = "A contact ends steps where bodies touch, and tries short ones."
            expected = "components whose communication steps may have any size"
            yield Problem(key_path(("contact", place)), expected, got, hint)


def _members(table: StopContactTable | BodyPair | None) -> set[str]:
    """Return the components that take part in a contact."""
    if isinstance(table, StopContactTable):
        return {table.body, table.stop}
    return {component_variable(point)[0] for point in table.between} if table is not None else set()


def _event_problems(draft: GeneralDraft, limited: dict[str, ComponentFacts]) -> Iterator[Problem]:
    """The steps of all end where a watched variable crosses its level."""
    for place, event in enumerate(draft.events):
        for facts in limited.values() if event is not None else ():
            if not facts.capabilities.variable_steps:
                expected = "components whose communication steps may have any size"
                got = f"{facts.file} ({VARIABLE_STEPS} = false)"
                hint = "A watched event ends the step of all."
                yield Problem(key_path(("event", place, "watch")), expected, got, hint)
