"""Changes of a scene, asked for by `--set KEY=VALUE` or from Python; they are made before the scene is checked."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import MOST_PARTS, parse_toml
from vibroimpact.orchestrator.scene.keys import ALTERNATIVES
from vibroimpact.orchestrator.scene.problems import CHANGES, KeyPath, Problem, key_path, quoted

_PART = re.compile(
    r"""\s*(?P<name>[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')\s*(?P<places>(?:\[[1-9][0-9]{0,8}\]\s*)*)"""
)
_FORM = "KEY=VALUE, the key as messages write it (stop[1].restitution=0.8)"
_KEY_FORM = "a key as messages write it, such as stop[1].restitution"
_VALUE = "a TOML value: a number, true, false, text, an array or a table"
_VALUE_HINT = "Numbers are written like 0.5; text that does not begin with a letter goes in double quotes."
_SWEPT_HINT = (
    """A swept key is in quotes, all of it in others: --set 'sweep."stop[1].restitution".points=11'."""
)


@dataclass(frozen=True, slots=True)
class Change:
    """A key of a scene, with 0-based places in arrays, and its new value."""

    path: KeyPath
    value: Any

    @property
    def key(self) -> str:
        """The key as messages write it."""
        return key_path(self.path)


class _NoChange(Exception):
    """Why a change cannot be made."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        super().__init__(problem)


def changed_document(
    document: Mapping[str, Any], texts: Sequence[str]
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return a document with other values, and the keys that were changed, as messages write them.

    Of two changes of one key the later one counts. Of two keys for one thing, such as `damping` and `damping_ratio`,
    the one that is changed takes the place of the other.

    Parameters
    ----------
    document : mapping
        A parsed TOML document; it stays as it is.
    texts : sequence of str
        `KEY=VALUE`, with a TOML value; text that begins with a letter may come without quotes.

    Raises
    ------
    SceneError
        With all changes that cannot be made.

    Examples
    --------
    >>> changed_document({"stop": [{"law": "hertz"}]}, ["stop[1].law=restitution", "body.mass=2"])
    ({'stop': [{'law': 'restitution'}], 'body': {'mass': 2}}, ('stop[1].law', 'body.mass'))
    """
    problems, changes = [], []
    for text in texts:
        try:
            changes.append(_read(text))
        except _NoChange as refused:
            problems.append(refused.problem)
    return _changed(document, changes, problems, CHANGES), tuple(change.key for change in changes)


def changed_values(document: Mapping[str, Any], values: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Return a document with other values, by key as messages write it; else as `changed_document`.

    Raises
    ------
    SceneError
        With all changes that cannot be made.
    """
    problems, changes = [], []
    for key, value in values.items():
        path, rest = _path(key) if isinstance(key, str) else ((), "")
        if not path or rest:
            problems.append(Problem("", _KEY_FORM, quoted(key)))
        else:
            changes.append(Change(path, value))
    return _changed(document, changes, problems, source)


def _changed(
    document: Mapping[str, Any], changes: Sequence[Change], problems: list[Problem], source: str
) -> dict[str, Any]:
    """Make all changes of a copy."""
    changed, made = deepcopy(dict(document)), []
    for change in changes:
        try:
            _make(changed, change)
            made.append(change)
        except _NoChange as refused:
            problems.append(refused.problem)
    _leave_out_alternatives(changed, made)
    problems += [problem for change in made for problem in _without_effect(changed, change)]
    if problems:
        raise SceneError(list(dict.fromkeys(problem.line(source) for problem in problems)))
    return changed


def _read(text: str) -> Change:
    """Take `KEY=VALUE` apart."""
    path, rest = _path(text)
    if not path or not rest.startswith("="):
        raise _NoChange(Problem("", _FORM, quoted(text)))
    return Change(path, _value(key_path(path), rest[1:].strip()))


def _path(text: str) -> tuple[KeyPath, str]:
    """Return the path of the key that a text begins with, and what follows it; no path where there is no key."""
    path: list[str | int] = []
    position = 0
    while match := _PART.match(text, position):
        position = match.end()
        path += parse_toml(f"{match['name']} = 0")
        path += [int(number) - 1 for number in re.findall(r"\d+", match["places"])]
        if text[position : position + 1] != "." or len(path) > MOST_PARTS:
            break
        position += 1
    if not match or len(path) > MOST_PARTS:
        return (), text
    return tuple(path), text[position:]


def _value(key: str, text: str) -> Any:
    if not text:
        raise _NoChange(Problem(key, "a value", "nothing", 'Write "" for an empty text.'))
    try:
        [value] = parse_toml(f"value = {text}").values()
    except ValueError:  # no TOML, or more than one value
        if text[0].isalpha() and text.isprintable():
            return text
        raise _NoChange(Problem(key, _VALUE, quoted(text), _VALUE_HINT)) from None
    return value


def _make(document: dict[str, Any], change: Change) -> None:
    """Give a key its value; tables that are absent come into being, elements of arrays do not."""
    owner: Any = document
    for depth, part in enumerate(change.path):
        _refuse_misfit(owner, part, change, depth)
        if depth == len(change.path) - 1:
            owner[part] = change.value
        elif isinstance(owner, dict):
            owner = owner.setdefault(part, {})
        else:
            owner = owner[part]


def _refuse_misfit(owner: Any, part: str | int, change: Change, depth: int) -> None:
    """Refuse a name in what is no table, and a place in what is no array or too short."""
    where = key_path(change.path[:depth])
    if isinstance(part, str) and isinstance(owner, dict):
        return
    if isinstance(part, int) and isinstance(owner, list) and part < len(owner):
        return
    if isinstance(owner, list) and owner:
        last = f" to {where}[{len(owner)}]" if len(owner) > 1 else ""
        got = quoted(owner) if isinstance(part, str) else key_path(change.path[: depth + 1])
        raise _NoChange(Problem(change.key, f"{where}[1]{last}", got))
    expected = "a table" if isinstance(part, str) else "an array"
    hint = _SWEPT_HINT if change.path[0] == "sweep" else ""
    got = "nothing" if owner == {} else quoted(owner)
    raise _NoChange(Problem(change.key, f"{expected} at {where}", got, hint))


def _leave_out_alternatives(document: dict[str, Any], changes: Sequence[Change]) -> None:
    keys = {change.path for change in changes}
    for change in changes:
        table, name = change.path[:-1], change.path[-1]
        other = ALTERNATIVES.get(name) if isinstance(name, str) else None
        if table in (("body",), ("forcing",)) and other is not None and (*table, other) not in keys:
            document[str(table[0])].pop(other, None)


def _without_effect(document: Mapping[str, Any], change: Change) -> list[Problem]:
    """Return the problem of a number that the sweep replaces at every point."""
    swept = document.get("sweep")
    match change.path:
        case ("component", component, "parameters", variable):
            key = f"{component}.{variable}"
        case _:
            key = change.key
    if not isinstance(swept, dict) or key not in swept:
        return []
    hint = f"Set its values, {key_path(('sweep', key))}={{values=[...]}}, or sweep nothing: sweep={{}}."
    return [Problem(change.key, "a key that the scene does not sweep", "one of [sweep]", hint)]
