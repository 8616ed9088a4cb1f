"""Keys of scenes of components, and the numbers that they name."""

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
    """Take `COMPONENT.VARIABLE` apart at its first dot.

    Examples
    --------
    >>> component_variable("body.contact[1].velocity")
    ('body', 'contact[1].velocity')
    """
    component, _, variable = reference.partition(".")
    return component, variable


def gain_place(key: str) -> int | None:
    """Return the 0-based place of the connection whose gain a key names; None when it names none.

    Examples
    --------
    >>> gain_place("connection[1].gain"), gain_place("ball.e")
    (0, None)
    """
    match = _GAIN_KEY.fullmatch(key)
    return int(match[1]) - 1 if match else None


def contact_key(key: str) -> tuple[int, str] | None:
    """Return the 0-based place of the contact of which a key names a number, and that name; None when it names none.

    Examples
    --------
    >>> contact_key("contact[2].restitution"), contact_key("ball.mass")
    ((1, 'restitution'), None)
    """
    match = _CONTACT_KEY.fullmatch(key)
    return (int(match[1]) - 1, match[2]) if match else None


def is_step(components: Sequence[ComponentSpec], key: str) -> bool:
    """Whether a key is the step of the exchange, and no number of a component of that name."""
    return key == STEP_KEY and all(component.name != "execution" for component in components)


@dataclass(frozen=True, slots=True)
class ComponentNumbers:
    """The numbers of a scene of components by their keys.

    Attributes
    ----------
    components : tuple of ComponentSpec
        Start values have the type of their variable: float, int (also for enumerations), bool or str. A swept start
        value that the file leaves out has its first swept value.
    connections : tuple of ConnectionSpec
        Their gains.
    contacts : tuple of StopContactSpec and PairSpec
    macro_step : float
        Time between two exchanges, s.
    """

    components: tuple[ComponentSpec, ...]
    connections: tuple[ConnectionSpec, ...]
    contacts: tuple[StopContactSpec | PairSpec, ...]
    macro_step: float = math.inf

    def value(self, key: str) -> float:
        """Return the number that `COMPONENT.VARIABLE`, `connection[N].gain` or `contact[N].NAME` has.

        Raises
        ------
        UsageError
            When the scene gives no such number.
        """
        if is_step(self.components, key):
            return self.macro_step
        place = gain_place(key)
        if place is not None:
            return self._connection(place, key).gain
        named = contact_key(key)
        if named is not None:
            return self._contact_number(*named, key)
        component, variable = self._start_value(key)
        return float(self.components[component].parameters[variable])

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Yield each start value that is a number, each gain and each number of a contact, with its key."""
        for component in self.components:
            for variable, start in component.parameters.items():
                if isinstance(start, int | float) and not isinstance(start, bool):
                    yield f"{component.name}.{variable}", float(start)
        for number, connection in enumerate(self.connections, start=1):
            yield f"connection[{number}].gain", connection.gain
        for number, contact in enumerate(self.contacts, start=1):
            for name, value in contact.numbers.items():
                yield f"contact[{number}].{name}", value

    def at(self, values: Mapping[str, float]) -> ComponentNumbers:
        """Return these parts with other start values, gains and numbers of contacts, without validating it again.

        Raises
        ------
        UsageError
            For a key that is neither swept nor given in the scene.
        """
        components, connections = list(self.components), list(self.connections)
        contacts, macro_step = list(self.contacts), self.macro_step
        for key, value in values.items():
            if is_step(self.components, key):
                macro_step = float(value)
                continue
            place = gain_place(key)
            if place is not None:
                self._connection(place, key)
                connections[place] = replace(connections[place], gain=float(value))
                continue
            named = contact_key(key)
            if named is not None:
                self._contact_number(*named, key)
                number: dict[str, Any] = {named[1]: float(value)}
                contacts[named[0]] = replace(contacts[named[0]], **number)
                continue
            index, variable = self._start_value(key)
            before = components[index].parameters
            typed = float(value) if isinstance(before[variable], float) else int(value)
            components[index] = replace(components[index], parameters={**before, variable: typed})
        return ComponentNumbers(tuple(components), tuple(connections), tuple(contacts), macro_step)

    def _connection(self, place: int, key: str) -> ConnectionSpec:
        if place < len(self.connections):
            return self.connections[place]
        raise UsageError(f"{key}: expected one of {len(self.connections)} connections, got an absent one.")

    def _contact_number(self, place: int, name: str, key: str) -> float:
        numbers = self.contacts[place].numbers if place < len(self.contacts) else {}
        if name in numbers:
            return numbers[name]
        raise UsageError(f"{key}: expected a number of a contact that this scene gives or sweeps, got none.")

    def _start_value(self, key: str) -> tuple[int, str]:
        """Return the place of the component and the variable that a key names."""
        name, _, variable = key.partition(".")
        for place, component in enumerate(self.components):
            if component.name == name and isinstance(component.parameters.get(variable), int | float):
                if isinstance(component.parameters[variable], bool):
                    break
                return place, variable
        raise UsageError(
            f"{key}: expected a number that this scene gives or sweeps, got none. "
            "Write it in the parameters of its component."
        )
