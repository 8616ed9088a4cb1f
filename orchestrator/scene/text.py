"""The text of a scene with other numbers in it: comments, layout and the order of keys stay as they were written."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping, Sequence
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.scene.keys import OVERRIDDEN_BY, Key, numeric_key


def text_with_values(text: str, values: Mapping[str, float], recordings: Sequence[str] = ()) -> str:
    """Return the TOML text of a scene with other numbers.

    A key that the text leaves at its default is added to its table, and one that would have the last word over a new
    number (`damping_ratio` over `damping`) is taken out. Where an unusual layout cannot be kept, the same scene is
    written without its comments.

    Parameters
    ----------
    text : str
        Of a scene that is valid.
    values : mapping of str to float
        By key, each a number of the scene.
    recordings : sequence of str
        What `replay.recordings` is to name; none to leave it as it is.

    Examples
    --------
    >>> print(text_with_values("[body]\\nmass = 1 # kg\\nstiffness = 4.0", {"body.mass": 2.5}))
    [body]
    mass = 2.5 # kg
    stiffness = 4.0
    """
    wanted = parse_toml(text)
    _put_all(wanted, values, recordings)
    try:
        document = tomlkit.parse(text)
        _put_all(document, values, recordings)
        edited = tomlkit.dumps(document)
        if parse_toml(edited) == wanted:
            return edited
    except (TOMLKitError, ValueError):
        pass  # what tomlkit cannot read or has written wrong is written anew
    return tomlkit.dumps(wanted)


def _put_all(
    document: MutableMapping[str, Any], values: Mapping[str, float], recordings: Sequence[str]
) -> None:
    for key, value in values.items():
        _put(document, numeric_key(key), value)
    if recordings:
        table = document["replay"]
        if len(table.get("recordings", ())) != len(recordings):
            _set(table, "recordings", [""] * len(recordings))
        for place, name in enumerate(recordings):
            table["recordings"][place] = name


def _put(document: MutableMapping[str, Any], key: Key, value: float) -> None:
    if key.table == "execution" and key.table not in document:
        document[key.table] = {}
    table = key.owner_in(document)
    table.pop(OVERRIDDEN_BY.get(key.name, ""), None)
    if key.element is not None:
        table[key.name][key.element] = value
    else:
        _set(table, key.name, key.typed(value))


def _set(table: MutableMapping[str, Any], name: str, value: float | list[str]) -> None:
    """Set a key; a new one goes after the last: comments at the end of a table are those of the next."""
    if name in table or not isinstance(table, Table):
        table[name] = value
        return
    body, rest = table.value.body, []
    while body and body[-1][0] is None:
        rest.append(body.pop())
    table.append(name, value)
    body.extend(reversed(rest))
