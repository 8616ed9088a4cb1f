"""Scenes of several `[[forcing]]` tables in their documents: a list of one force, and keys of the first force."""

from __future__ import annotations

import re
from collections.abc import Mapping, MutableMapping
from typing import Any

_LIST = re.compile(r"^[ \t]*\[\[forcing\]\]", re.M)
_OF_ONE, _OF_FIRST = (
    re.compile(rf"^([ \t]*\"){re.escape(key)}", re.M) for key in ("forcing[1].", "forcing.")
)


def with_one_force(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document in which a list of one force is a table, and swept keys of the first force have its number.

    Examples
    --------
    >>> with_one_force({"forcing": [{"amplitude": 1.0}], "sweep": {"forcing[1].amplitude": {}}})
    {'forcing': {'amplitude': 1.0}, 'sweep': {'forcing.amplitude': {}}}
    >>> with_one_force({"forcing": [{}, {}], "sweep": {"forcing.amplitude": {}}})["sweep"]
    {'forcing[1].amplitude': {}}
    """
    forces = document.get("forcing")
    if is_list_of_one(document):
        return {**document, "forcing": document["forcing"][0], **_swept(document, "forcing[1].", "forcing.")}
    if isinstance(forces, list):
        return {**document, **_swept(document, "forcing.", "forcing[1].")}
    return {**document, **_swept(document, "forcing[1].", "forcing.")}


def is_list_of_one(document: Mapping[str, Any]) -> bool:
    """Return whether a document has a list of one force."""
    forces = document.get("forcing")
    return isinstance(forces, list) and len(forces) == 1 and isinstance(forces[0], dict)


def _swept(document: Mapping[str, Any], before: str, after: str) -> dict[str, Any]:
    """Return the sweep of a document with keys that begin in another way; nothing where it has none."""
    sweep = document.get("sweep")
    if not isinstance(sweep, dict) or not any(key.startswith(before) for key in sweep):
        return {}
    keys = {key: after + key.removeprefix(before) if key.startswith(before) else key for key in sweep}
    if len(set(keys.values())) < len(keys):
        return {}  # both names of one key: the rules of sweeps refuse the other one
    return {"sweep": {keys[key]: axis for key, axis in sweep.items()}}


def with_one_force_in_text(text: str) -> str:
    """Return the text of `with_one_force` for the text of a valid scene, with its comments.

    Examples
    --------
    >>> print(with_one_force_in_text('[[forcing]]\\namplitude = 1.0 # N'))
    [forcing]
    amplitude = 1.0 # N
    """
    import tomlkit  # the import takes time, and few scenes are written anew

    forces = tomlkit.parse(text).get("forcing")
    if not isinstance(forces, list):
        return _OF_ONE.sub(r"\1forcing.", text)
    if len(forces) > 1:
        return _OF_FIRST.sub(r"\1forcing[1].", text)
    document: MutableMapping[str, Any] = tomlkit.parse(
        _OF_ONE.sub(r"\1forcing.", _LIST.sub("[forcing]", text))
    )
    if isinstance(document["forcing"], list):  # written in one line, or by a quoted name
        document["forcing"] = document["forcing"][0]
    return tomlkit.dumps(document)
