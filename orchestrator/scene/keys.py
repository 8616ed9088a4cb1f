"""Keys such as `forcing.amplitude` or `stop[1].position`: their numbers, and whether a sweep may vary them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from pydantic import BaseModel

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene.body_models import BODY_MODELS, LinkTable
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import field_name, field_of, is_whole, known_keys, numeric_keys
from vibroimpact.orchestrator.scene.forcing_models import FORCING_MODELS
from vibroimpact.orchestrator.scene.measuring_models import Daq, Exciter, LoadCell, Noise, Sensor
from vibroimpact.orchestrator.scene.models import CONTACT_MODELS, STOP_MODELS

_MODELS: dict[str, tuple[type[BaseModel], ...]] = {
    "body": tuple(BODY_MODELS.values()),
    "forcing": tuple(FORCING_MODELS.values()),
    "sensor": (Sensor,),
    "load_cell": (LoadCell,),
    "exciter": (Exciter,),
    "noise": (Noise,),
    "daq": (Daq,),
    "stop": tuple(STOP_MODELS.values()),
    "link": (LinkTable,),
    "contact": tuple(CONTACT_MODELS.values()),
    "execution": (Execution,),
}
CHAIN_TABLES = ("load_cell", "exciter", "noise", "daq")
"""Tables of a measuring chain, except `sensor`, which other scenes have, too."""
SINGLE_TABLES = ("body", "forcing", "sensor", *CHAIN_TABLES)
"""Tables with numbers that a scene has at most once, unless it lists them: `[[body]]`, `[[forcing]]`."""
ARRAY_TABLES = ("body", "forcing", "stop", "link", "contact")
"""Tables with numbers of which a scene may have several: `[[body]]`, `[[stop]]`."""
SWEEPABLE: dict[str, tuple[str, ...]] = {
    table: tuple(dict.fromkeys(key for model in models for key in numeric_keys(model)))
    for table, models in _MODELS.items()
}
"""The numbers that a sweep may vary, by table."""
MODES = "body.modes"
START_STATE = (".displacement_start", ".velocity_start")
"""Last parts of the keys of a start state."""

# The second key of each pair overrides the first in its model, so setting the first must clear the second.
OVERRIDDEN_BY = {
    "damping": "damping_ratio",
    "angular_frequency": "frequency",
    "angular_frequencies": "frequencies",
}
ALTERNATIVES = OVERRIDDEN_BY | {second: first for first, second in OVERRIDDEN_BY.items()}
"""Alternative keys of one table for the same quantity; a scene gives one of each pair."""
_NUMBER = r"\[([1-9][0-9]{0,8})\]"
_OWNER = rf"(?:({'|'.join(SINGLE_TABLES)}|execution)|({'|'.join(ARRAY_TABLES)}){_NUMBER})"
_KEY = re.compile(rf"{_OWNER}\.([a-z_]+)(?:{_NUMBER})?")


class Key(NamedTuple):
    """The parts of a key; `place` and `element` are 0-based, None where table or value are not an array."""

    table: str
    place: int | None
    name: str
    element: int | None = None

    @property
    def owner(self) -> str:
        """Name of the table in keys: `body`, or `stop[1]`."""
        return self.table if self.place is None else f"{self.table}[{self.place + 1}]"

    def owner_in(self, document: Mapping[str, Any]) -> Any:
        """Return the table of the key in a document; `forcing` is the first of several forces."""
        tables = document[self.table]
        if self.table == "forcing":
            key = self.among(len(tables) if isinstance(tables, list) else 1)
            return tables if key.place is None else tables[key.place]
        return tables if self.place is None else tables[self.place]

    def among(self, forces: int) -> Key:
        """Return the key as a scene with a number of forces has it: `forcing[1]` for `forcing` of several.

        Examples
        --------
        >>> numeric_key("forcing.amplitude").among(2).owner, numeric_key("forcing[1].amplitude").among(1).owner
        ('forcing[1]', 'forcing')
        """
        place = 0 if forces > 1 else None
        if self.table != "forcing" or (self.place or 0) > 0 or self.place == place:
            return self
        return self._replace(place=place)

    def typed(self, value: float) -> float:
        """Return a number in the type of its field: int for whole numbers."""
        return int(value) if _is_whole(self.table, self.name) else value


@lru_cache(maxsize=256)
def _is_whole(table: str, name: str) -> bool:
    """Return whether a number of a table is whole."""
    return any(is_whole(field_of(model, name)) for model in _MODELS[table] if name in known_keys(model))


@lru_cache(maxsize=256)
def parse_key(text: str) -> Key | None:
    """Return the parts of a key with 1-based indices; None for a text of another form.

    Examples
    --------
    >>> parse_key("stop[1].position")
    Key(table='stop', place=0, name='position', element=None)
    >>> parse_key("body.masses[2]")
    Key(table='body', place=None, name='masses', element=1)
    >>> parse_key("stop.position") is None
    True
    """
    match = _KEY.fullmatch(text)
    if match is None:
        return None
    table, array, number, name, element = match.groups()
    return Key(
        table or array, int(number) - 1 if number else None, name, int(element) - 1 if element else None
    )


def model_of(table: str) -> type[BaseModel]:
    """Return the model of a table without kinds."""
    return _MODELS[table][0]


def numeric_key(text: str) -> Key:
    """Return the parts of a key that names a number of a scene.

    Raises
    ------
    UsageError
        The key names no number.
    """
    key = parse_key(text)
    if key is None or key.name not in SWEEPABLE[key.table]:
        expected = "a numeric key such as body.mass or stop[1].position"
        raise UsageError(f'scene key: expected {expected}, got "{text}".')
    return key


def number_of(owner: object, key: Key) -> float | None:
    """Return the number of a key in its table; None where there is none."""
    value = getattr(owner, key.name, None)
    if key.element is not None:
        array = isinstance(value, tuple) and key.element < len(value)
        return float(value[key.element]) if array and value is not None else None
    return float(value) if isinstance(value, int | float) else None


def is_missing(document: Mapping[str, Any], text: str) -> bool:
    """Return whether a document of the short form has neither a numeric key nor its alternative."""
    key = parse_key(text)
    if key is None:
        return False
    try:
        owner = key.owner_in(document)
    except (KeyError, IndexError):
        return True
    return isinstance(owner, Mapping) and not {key.name, ALTERNATIVES.get(key.name)} & owner.keys()


def table_named(name: str, document: Mapping[str, Any]) -> str:
    """Return the key of a named body or of a component's parameters; an empty text for a name of neither.

    Examples
    --------
    >>> table_named("ball", {"body": [{"name": "frame"}, {"name": "ball"}]})
    'body[2]'
    >>> table_named("ball", {"component": {"ball": {}}}), table_named("ball", {})
    ('component.ball.parameters', '')
    """
    bodies, components = document.get("body"), document.get("component")
    for number, body in enumerate(bodies if isinstance(bodies, list) else (), start=1):
        if isinstance(body, dict) and body.get("name") == name:
            return f"body[{number}]"
    return f"component.{name}.parameters" if isinstance(components, dict) and name in components else ""


def with_alternatives(texts: Iterable[str]) -> set[str]:
    """Return keys together with their alternatives.

    Examples
    --------
    >>> sorted(with_alternatives(["forcing.frequency"]))
    ['forcing.angular_frequency', 'forcing.frequency']
    """
    keys = set(texts)
    parts = [each.rpartition(".") for each in keys]
    return keys | {f"{table}.{ALTERNATIVES[name]}" for table, _, name in parts if name in ALTERNATIVES}


def numbers_of(owner: BaseModel, table: str) -> Iterator[tuple[str, float]]:
    """Yield each number of a table that a sweep may vary, with its key; of two alternatives the one in effect."""
    for word in SWEEPABLE[table.partition("[")[0]]:
        value = getattr(owner, word, None)
        if getattr(owner, OVERRIDDEN_BY.get(word, ""), None) is not None:
            continue
        if isinstance(value, tuple):
            yield from ((f"{table}.{word}[{place}]", number) for place, number in enumerate(value, start=1))
        elif value is not None and not isinstance(value, str):
            yield f"{table}.{word}", value


def replacement(owner: BaseModel, key: Key, value: float) -> dict[str, Any]:
    """Return the attributes to change so that a key has a value, also where its alternative was given."""
    model = type(owner)
    attribute = field_name(model, key.name)
    if key.element is not None:
        numbers = getattr(owner, attribute)
        return {attribute: (*numbers[: key.element], value, *numbers[key.element + 1 :])}
    update: dict[str, Any] = {attribute: key.typed(value)}
    other = OVERRIDDEN_BY.get(key.name)
    if other in model.model_fields:
        update[str(other)] = None
    return update


def coordinate_name(key: str, swept: Sequence[str]) -> str:
    """Return the name of a swept key as a coordinate of the dataset.

    The name is the last part of the key. Where two swept keys have the same last part, it is the whole key joined by
    `_`. A name has only letters, digits and `_`.

    Examples
    --------
    >>> coordinate_name("stop[1].position", ["stop[1].position", "body.mass"])
    'position'
    >>> coordinate_name("stop[1].position", ["stop[1].position", "stop[2].position"])
    'stop_1_position'
    >>> coordinate_name("body.masses[2]", ["body.masses[2]"])
    'masses_2'
    >>> coordinate_name("noise.load_cell", ["noise.load_cell"])
    'noise_load_cell'
    >>> coordinate_name("chain.mass[2]", ["chain.mass[2]", "connection[1].gain"])
    'mass_2'
    """
    last = _last_part(key)
    if key.startswith("noise."):  # keys of noise have the names of channels
        return dataset_name(key)
    if any(other != key and _last_part(other) == last for other in swept):
        return dataset_name(key)
    return last or dataset_name(key)


def _last_part(key: str) -> str:
    return dataset_name(key.rpartition(".")[2])


def dataset_name(text: str) -> str:
    """Return a key or a variable as a name of letters, digits and `_`."""
    return re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")
