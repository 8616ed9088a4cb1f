"""Keys of scenes of components, and their numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.importer.specification import (
    ComponentSpec,
    ConnectionSpec,
    PairSpec,
    StopContactSpec,
)

STEP_KEY = "execution.macro_step"
_GAIN_KEY = re.compile(r"connection\[([1-9][0-9]{0,8})\]\.gain")
_CONTACT_KEY = re.compile(r"contact\[([1-9][0-9]{0,8})\]\.([a-z_]+)")


def component_variable(reference: str) -> tuple[str, str]:
    """Return the component and the variable of `COMPONENT.VARIABLE`, split at the first dot.

    Examples
    --------
    >>> component_variable("body.contact[1].velocity")
    ('body', 'contact[1].velocity')
    """
    component, _, variable = reference.partition(".")
    return component, variable


def gain_place(key: str) -> int | None:
    """Return the 0-based place of the connection whose gain a key names; None for other keys.

    Examples
    --------
    >>> gain_place("connection[1].gain"), gain_place("ball.e")
    (0, None)
    """
    match = _GAIN_KEY.fullmatch(key)
    return int(match[1]) - 1 if match else None


def contact_key(key: str) -> tuple[int, str] | None:
    """Return the 0-based place of a contact and the name of its number in a key; None for other keys.

    Examples
    --------
    >>> contact_key("contact[2].restitution"), contact_key("ball.mass")
    ((1, 'restitution'), None)
    """
    match = _CONTACT_KEY.fullmatch(key)
    return (int(match[1]) - 1, match[2]) if match else None


def is_step(components: Sequence[ComponentSpec], key: str) -> bool:
    """Return whether a key is the step of the exchange, not a number of a component named `execution`."""
    return key == STEP_KEY and all(component.name != "execution" for component in components)


Part = ComponentSpec | ConnectionSpec | StopContactSpec | PairSpec


@dataclass(frozen=True, slots=True)
class ComponentNumbers:
    """The numbers of a scene of components by key: start values, gains, numbers of contacts, the step (s)."""

    components: tuple[ComponentSpec, ...]
    connections: tuple[ConnectionSpec, ...]
    contacts: tuple[StopContactSpec | PairSpec, ...]
    macro_step: float = math.inf

    def value(self, key: str) -> float:
        """Return the number of `COMPONENT.VARIABLE`, `connection[N].gain` or `contact[N].NAME`.

        UsageError: the scene gives no such number.
        """
        if is_step(self.components, key):
            return self.macro_step
        owner, name = _taken_apart(key)
        part = self._parts().get(owner)
        numbers = {} if part is None else _numbers_of(part)
        if name not in numbers:
            raise UsageError(f"{key}: expected {self._known(key)}")
        return float(numbers[name])

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Yield each start value that is a number, each gain and each number of a contact, with its key."""
        for owner, part in self._parts().items():
            for name, number in _numbers_of(part).items():
                yield f"{owner}.{name}", float(number)

    def at(self, values: Mapping[str, float]) -> ComponentNumbers:
        """Return the numbers with other start values, gains and numbers of contacts, without validation.

        UsageError: a key is neither swept nor given in the scene.
        """
        parts, macro_step = self._parts(), self.macro_step
        for key, value in values.items():
            self.value(key)  # refuses an unknown key
            if is_step(self.components, key):
                macro_step = float(value)
            else:
                owner, name = _taken_apart(key)
                parts[owner] = _with_number(parts[owner], name, value)
        changed: Any = tuple(parts.values())
        first, last = len(self.components), len(parts) - len(self.contacts)
        return ComponentNumbers(changed[:first], changed[first:last], changed[last:], macro_step)

    def _parts(self) -> dict[str, Part]:
        """Return the parts of the scene that have numbers, by their name in keys."""
        return {
            **{component.name: component for component in self.components},
            **{f"connection[{number}]": each for number, each in enumerate(self.connections, start=1)},
            **{f"contact[{number}]": each for number, each in enumerate(self.contacts, start=1)},
        }

    def _known(self, key: str) -> str:
        """Return the expected kind of key, in words, for a key without a number."""
        if gain_place(key) is not None:
            return f"one of {len(self.connections)} connections, got an absent one."
        if contact_key(key) is not None:
            return "a number of a contact that this scene gives or sweeps, got none."
        return (
            "a number that this scene gives or sweeps, got none. Write it in the parameters of its component."
        )


def _taken_apart(key: str) -> tuple[str, str]:
    """Return the name of the part of a scene in a key, and the name of its number."""
    if gain_place(key) is None and contact_key(key) is None:
        return component_variable(key)
    owner, _, name = key.rpartition(".")
    return owner, name


def _numbers_of(part: Part) -> Mapping[str, float]:
    if isinstance(part, ConnectionSpec):
        return {"gain": part.gain}
    if not isinstance(part, ComponentSpec):
        return part.numbers
    return {
        name: start
        for name, start in part.parameters.items()
        if isinstance(start, int | float) and not isinstance(start, bool)
    }


def _with_number(part: Part, name: str, value: float) -> Part:
    if not isinstance(part, ComponentSpec):
        number: dict[str, Any] = {name: float(value)}
        return replace(part, **number)
    typed = float(value) if isinstance(part.parameters[name], float) else int(value)
    return replace(part, parameters={**part.parameters, name: typed})
