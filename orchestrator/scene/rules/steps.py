"""Rules of components with restricted communication steps: a single step size, or a grid of their own.

A component with one step size keeps its own grid where other steps are cut (`orchestrator/importer/own_grid.py`). A
part in a contact, a watched event and clocks need free steps: they are refused by the name of the FMI attribute.
"""

from __future__ import annotations

from collections.abc import Iterator

from vibroimpact.orchestrator.fmi.capabilities import VARIABLE_STEPS
from vibroimpact.orchestrator.importer.own_grid import is_multiple
from vibroimpact.orchestrator.scene.component_facts import ComponentFacts
from vibroimpact.orchestrator.scene.component_models import BodyPair, StopContactTable
from vibroimpact.orchestrator.scene.component_numbers import STEP_KEY, component_variable
from vibroimpact.orchestrator.scene.components import GeneralDraft
from vibroimpact.orchestrator.scene.problems import Problem, key_path

ANY_SIZE = "components whose communication steps may have any size"


def step_problems(draft: GeneralDraft) -> list[Problem]:
    """Return the problems of all settings that need other steps than a component makes."""
    if draft.record is None or draft.execution is None:
        return []
    limited = {
        name: component.facts
        for name, component in draft.components.items()
        if component.facts is not None and component.facts.capabilities.grid
    }
    if draft.execution.adapts:
        return [
            Problem(
                STEP_KEY,
                f"a number, since {name} has steps of its own: {facts.file} ({facts.capabilities.grid})",
                '"auto"',
            )
            for name, facts in limited.items()
        ]
    problems = [*_contact_problems(draft, limited), *_event_problems(draft, limited)]
    for name, facts in limited.items():
        if not facts.capabilities.variable_steps:
            problems += [*_size_problems(draft, name, facts), *_clock_problems(draft, name, facts)]
    return problems


def _size_problems(draft: GeneralDraft, name: str, facts: ComponentFacts) -> Iterator[Problem]:
    """Without a macro step the only step of a component would be the whole run."""
    assert draft.record is not None
    assert draft.execution is not None
    is_sized = draft.execution.macro_step is not None or draft.swept_steps()
    if is_sized or facts.capabilities.internal_step > 0.0:
        return
    is_sampled = any(component_variable(variable)[0] == name for variable in draft.record.variables)
    if is_sampled or draft.record.transient_time > 0.0:
        expected = f"the size of the steps of {facts.file} ({facts.capabilities.grid})"
        yield Problem(STEP_KEY, expected, "none", "Add macro_step = ... to [execution].")


def _clock_problems(draft: GeneralDraft, name: str, facts: ComponentFacts) -> Iterator[Problem]:
    """A clock of a component with one step size ticks at the ends of its steps."""
    assert draft.execution is not None
    steps = draft.swept_steps() or (draft.execution.fixed_step,)
    for clock in facts.capabilities.clocks:
        times = (clock.interval, clock.shift)
        for step in steps:
            if step and not all(t is None or is_multiple(float(t), step) for t in times):
                expected = (
                    f"clocks that tick at multiples of {step:g} s, its only step ({VARIABLE_STEPS} = false)"
                )
                got = f"the clock {clock.name} of {facts.file}"
                yield Problem(key_path(("component", name, "fmu")), expected, got)


def _contact_problems(draft: GeneralDraft, limited: dict[str, ComponentFacts]) -> Iterator[Problem]:
    """Contacts need free steps of their members: steps end where bodies touch, and short trial steps find masses."""
    for place, table in enumerate(draft.contacts):
        for name in _members(table) & set(limited):
            got = f"{limited[name].file} ({limited[name].capabilities.grid})"
            hint = "A contact ends steps where bodies touch, and tries short ones."
            yield Problem(key_path(("contact", place)), ANY_SIZE, got, hint)


def _members(table: StopContactTable | BodyPair | None) -> set[str]:
    """Return the components that take part in a contact."""
    if isinstance(table, StopContactTable):
        return {table.body, table.stop}
    return {component_variable(point)[0] for point in table.between} if table is not None else set()


def _event_problems(draft: GeneralDraft, limited: dict[str, ComponentFacts]) -> Iterator[Problem]:
    """A watched component is searched within its steps, so it may not have a single step size."""
    for place, event in enumerate(draft.events):
        facts = limited.get(component_variable(event.watch)[0]) if event is not None else None
        if facts is not None and not facts.capabilities.variable_steps:
            got = f"{facts.file} ({VARIABLE_STEPS} = false)"
            hint = "A step of a watched component is divided."
            yield Problem(key_path(("event", place, "watch")), ANY_SIZE, got, hint)
