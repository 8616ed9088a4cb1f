"""Keys such as `forcing.amplitude` or `stop[1].position`: what they name and whether a sweep may vary it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from pydantic import BaseModel

from vibroimpact.fmus.errors import UsageError

SWEEPABLE: dict[str, tuple[str, ...]] = {
    "body": ("mass", "stiffness", "damping", "damping_ratio", "displacement_start", "velocity_start"),
    "forcing": ("amplitude", "angular_frequency", "frequency", "phase"),
    "stop": ("position", "restitution"),
}
START_STATE = ("body.displacement_start", "body.velocity_start")

# The second of each pair has the last word in its model, so that giving the first must clear it.
_OVERRIDDEN_BY = {"damping": "damping_ratio", "angular_frequency": "frequency"}
_KEY = re.compile(r"(?:(body|forcing)|(stop)\[([1-9][0-9]{0,8})\])\.([a-z_]+)")


class Key(NamedTuple):
    """A key taken apart; `place` is 0-based and None where the table is not an array."""

    table: str
    place: int | None
    name: str


@lru_cache(maxsize=256)
def parse_key(text: str) -> Key | None:
    """Take a key with 1-based indices apart; None when it is not of the form of one.

    Examples
    --------
    >>> parse_key("stop[1].position")
    Key(table='stop', place=0, name='position')
    >>> parse_key("stop.position") is None
    True
    """
    match = _KEY.fullmatch(text)
    if match is None:
        return None
    table, stop, number, name = match.groups()
    return Key(table or stop, int(number) - 1 if number else None, name)


def numeric_key(text: str) -> Key:
    """Return the parts of a key that names a number of a scene.

    Raises
    ------
    UsageError
        When it names none.
    """
    key = parse_key(text)
    if key is None or key.name not in SWEEPABLE[key.table]:
        expected = "a numeric key such as body.mass or stop[1].position"
        raise UsageError(f'scene key: expected {expected}, got "{text}".')
    return key


@lru_cache(maxsize=64)
def field_name(model: type[BaseModel], key: str) -> str:
    """Return the attribute that stores a key of the scene file in its model."""
    return next(name for name, field in model.model_fields.items() if key in (field.alias, name))


def replacement(model: type[BaseModel], key: str, value: float) -> dict[str, float | None]:
    """Return the attributes to change so that a key has a value, whichever of two related keys was given."""
    update: dict[str, float | None] = {field_name(model, key): value}
    if key in _OVERRIDDEN_BY:
        update[_OVERRIDDEN_BY[key]] = None
    return update


def coordinate_name(key: str, swept: Sequence[str]) -> str:
    """Return the name of a swept key as a coordinate of the dataset.

    It is the last part of the key, or the whole key joined by `_` where two swept keys end alike; a name has
    letters, digits and `_` only.

    Examples
    --------
    >>> coordinate_name("stop[1].position", ["stop[1].position", "body.mass"])
    'position'
    >>> coordinate_name("stop[1].position", ["stop[1].position", "stop[2].position"])
    'stop_1_position'
    >>> coordinate_name("chain.mass[2]", ["chain.mass[2]", "connection[1].gain"])
    'mass_2'
    """
    last = _last_part(key)
    if any(other != key and _last_part(other) == last for other in swept):
        return dataset_name(key)
    return last or dataset_name(key)


def _last_part(key: str) -> str:
    return dataset_name(key.rpartition(".")[2])


def dataset_name(text: str) -> str:
    """Return a key or a variable as a name of letters, digits and `_`."""
    return re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")
