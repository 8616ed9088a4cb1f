"""Rules of components with restricted communication steps: a single step size, or a grid of their own.

Conflicts that are known before a run are refused with the scene, by the name of the FMI attribute. A step cut by an
event of another component is refused during the run (`orchestrator/fmi/instance.py`).
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

#: Relative distance of a ratio from a whole number, up to which it is whole by rounding: instants agree to 1e-13.
WHOLE = 1e-14


class _Grid(NamedTuple):
    """The step, s, at whose multiples communication steps of a component may end, and the attribute that demands it."""

    name: str
    facts: ComponentFacts
    step: float
    attribute: str

    @property
    def owner(self) -> str:
        """The file and the attribute, in words for a problem."""
        return f"{self.facts.file} ({self.attribute})"


def step_problems(draft: GeneralDraft) -> list[Problem]:
    """Return the problems of all settings that would cut a step of a component with restricted steps."""
    if draft.record is None or draft.execution is None:
        return []
    limited = {
        name: component.facts
        for name, component in draft.components.items()
        if component.facts is not None and component.facts.capabilities.grid
    }
    if not limited:
        return []
    if draft.execution.adapts:
        return [
            Problem(
                STEP_KEY,
                f"a number, since {name} has steps of its own: {facts.file} ({facts.capabilities.grid})",
                '"auto"',
            )
            for name, facts in limited.items()
        ]
    macro_steps = draft.swept_steps() or (draft.execution.fixed_step or _duration(draft),)
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
    """Return whether a time, s, is a whole multiple of a step up to rounding."""
    ratio = time / step
    if not math.isfinite(ratio):
        return False
    return abs(ratio - round(ratio)) <= WHOLE * ratio and (time == 0.0 or round(ratio) >= 1)


def _in_digits(value: float) -> str:
    """Return a number in six digits if they are exact, else in all digits, which show a rounding error."""
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
    """Return the hint for a scene without a macro step, whose only step is the whole run."""
    assert draft.execution is not None
    has_step = draft.execution.macro_step is not None or draft.swept_steps()
    return "" if has_step else "Add macro_step = ... to [execution]: the size of the steps."


def _rate_problems(draft: GeneralDraft, grid: _Grid) -> Iterator[Problem]:
    """Samples of a restorable component are on its grid: they need steps of their own; others are interpolated."""
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
    """A clock ends the steps of all components, so it ticks at multiples of the only step of a component."""
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
    """Contacts need components with free steps: steps end where bodies touch, and short trial steps find masses."""
    for place, table in enumerate(draft.contacts):
        for name, facts in limited.items() if table is not None else ():
            if facts.capabilities.variable_steps and name not in _members(table):
                continue  # the component keeps its own grid, and other components touch
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
    """A watched event ends the steps of all components, so none of them may have a single step size."""
    for place, event in enumerate(draft.events):
        for facts in limited.values() if event is not None else ():
            if not facts.capabilities.variable_steps:
                expected = "components whose communication steps may have any size"
                got = f"{facts.file} ({VARIABLE_STEPS} = false)"
                hint = "A watched event ends the step of all."
                yield Problem(key_path(("event", place, "watch")), expected, got, hint)
