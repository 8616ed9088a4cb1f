"""Changes of a scene before its checks, new numbers in its text, and a start on its stops."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import MOST_PARTS, parse_toml
from vibroimpact.orchestrator.scene.keys import ALTERNATIVES, OVERRIDDEN_BY, Key, numeric_key
from vibroimpact.orchestrator.scene.problems import CHANGES, KeyPath, Problem, key_path, quoted
from vibroimpact.orchestrator.scene.several_forces import with_one_force

_PART = re.compile(
    r"""\s*(?P<name>[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')\s*(?P<places>(?:\[[1-9][0-9]{0,8}\]\s*)*)"""
)
START = "displacement_start"
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
        """The key in the notation of messages."""
        return key_path(self.path)


class _NoChange(Exception):
    """A change is impossible, with the problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        super().__init__(problem)


def changed_document(
    document: Mapping[str, Any], texts: Sequence[str]
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return a document with other values, and the changed keys in the notation of messages.

    The later of two changes of one key counts. A changed key replaces its alternative, such as `damping_ratio` for
    `damping`.

    Parameters
    ----------
    document : mapping
        A parsed TOML document; it stays as it is.
    texts : sequence of str
        `KEY=VALUE`, with a TOML value; text that begins with a letter may come without quotes.

    Raises
    ------
    SceneError
        Some changes are impossible; the message has all of them.

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


def changed_key(text: str) -> KeyPath:
    """Return the path of the key in `KEY=VALUE`, with 0-based places; an empty path without a key.

    >>> changed_key("body.frequencies[2]=70")
    ('body', 'frequencies', 1)
    """
    return _path(text)[0]


def changed_values(document: Mapping[str, Any], values: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Return a document with other values by key, in the notation of messages; see `changed_document`."""
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
    """Return a copy with all changes; raise SceneError with all problems."""
    changed, made = with_one_force(deepcopy(dict(document))), []
    for change in changes:
        try:
            placed = _of_force(changed, change)
            _make(changed, placed)
            made.append(placed)
        except _NoChange as refused:
            problems.append(refused.problem)
    _leave_out_alternatives(changed, made)
    problems += [problem for change in made for problem in _without_effect(changed, change)]
    if problems:
        raise SceneError(list(dict.fromkeys(problem.line(source) for problem in problems)))
    return changed


def _read(text: str) -> Change:
    """Return the change in `KEY=VALUE`."""
    path, rest = _path(text)
    if not path or not rest.startswith("="):
        raise _NoChange(Problem("", _FORM, quoted(text)))
    return Change(path, _value(key_path(path), rest[1:].strip()))


def _path(text: str) -> tuple[KeyPath, str]:
    """Return the path of the key at the start of a text, and the rest of the text; an empty path without a key."""
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
    except ValueError:  # invalid TOML, or more than one value
        if text[0].isalpha() and text.isprintable():
            return text
        raise _NoChange(Problem(key, _VALUE, quoted(text), _VALUE_HINT)) from None
    return value


def _of_force(document: Mapping[str, Any], change: Change) -> Change:
    """Return a change of a force with the number of the force where there are several, and else without."""
    table, *rest = change.path
    if table != "forcing" or not rest:
        return change
    is_list, first = isinstance(document.get("forcing"), list), rest[0]
    if is_list and isinstance(first, str):
        return Change((table, 0, *rest), change.value)
    if not is_list and first == 0 and len(rest) > 1:
        return Change((table, *rest[1:]), change.value)
    return change


def _make(document: dict[str, Any], change: Change) -> None:
    """Set the value of a key; absent tables are created, absent elements of arrays are not."""
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
    """Raise _NoChange unless a name is for a table, or a place is within an array."""
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
    keys, execution = {change.path for change in changes}, document.get("execution")
    step, tolerance = ("execution", "macro_step"), ("execution", "coupling_tolerance")
    if (
        step in keys
        and tolerance not in keys
        and isinstance(execution, dict)
        and execution["macro_step"] != "auto"
    ):
        execution.pop("coupling_tolerance", None)  # it belongs to chosen steps
    for change in changes:
        table, name = change.path[:-1], change.path[-1]
        other = ALTERNATIVES.get(name) if isinstance(name, str) else None
        if table[:1] in (("body",), ("forcing",)) and other is not None and (*table, other) not in keys:
            owner = document[str(table[0])]
            if len(table) == 2 and isinstance(owner, list) and isinstance(table[1], int):
                owner = owner[table[1]]
            if isinstance(owner, dict):  # a later change may have replaced the table
                owner.pop(other, None)


def _without_effect(document: Mapping[str, Any], change: Change) -> list[Problem]:
    """Return the problem of a changed number that the sweep replaces at every point."""
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


# ---- numbers in a text ----


def text_with_values(text: str, values: Mapping[str, float], recordings: Sequence[str] = ()) -> str:
    """Return the TOML text of a scene with other numbers.

    A key at its default is added to its table. A key that would override a new number (`damping_ratio` over `damping`)
    is removed. If an unusual layout cannot be kept, the same scene is written without its comments.

    Parameters
    ----------
    text : str
        Text of a valid scene.
    values : mapping of str to float
        New values by key, each a number of the scene.
    recordings : sequence of str
        New `replay.recordings`; empty to leave them as they are.

    Examples
    --------
    >>> print(text_with_values("[body]\\nmass = 1 # kg\\nstiffness = 4.0", {"body.mass": 2.5}))
    [body]
    mass = 2.5 # kg
    stiffness = 4.0
    """
    import tomlkit  # the import takes time, and few scenes are written anew

    target = parse_toml(text)
    _put_all(target, values, recordings)

    def edit(text: str) -> str:
        document = tomlkit.parse(text)
        _put_all(document, values, recordings)
        return tomlkit.dumps(document)

    return edited_text(text, edit, target)


def edited_text(text: str, edit: Callable[[str], str], target: Mapping[str, Any]) -> str:
    """Return a TOML text after an edit that keeps comments; without comments if it is not the text of `target`."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        edited = edit(text)
        if parse_toml(edited) == target:
            return edited
    except (TOMLKitError, ValueError):
        pass  # tomlkit cannot read the text, or has written it wrong: it is written anew
    return tomlkit.dumps(target)


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
    """Set a key; a new key goes after the last key, as comments at the end of a table belong to the next table."""
    from tomlkit.items import Table

    if name in table or not isinstance(table, Table):
        table[name] = value
        return
    body, rest = table.value.body, []
    while body and body[-1][0] is None:
        rest.append(body.pop())
    table.append(name, value)
    body.extend(reversed(rest))


# ---- a start on the stops ----


def with_resting_start(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document in which a missing start is on the rigid stops that keep the body from 0.

    Examples
    --------
    >>> with_resting_start({"body": {"mass": 1.0}, "stop": [{"position": -0.5}]})["body"]
    {'mass': 1.0, 'displacement_start': -0.5}
    """
    found = deepcopy(dict(document))
    body = found.get("body")
    if not isinstance(body, dict) or START in body or f"body.{START}" in _table_of(found.get("sweep")):
        return found
    kind, masses = body.get("kind", "oscillator"), body.get("masses")
    size = len(masses) if kind == "chain" and isinstance(masses, list) else 1
    starts = [0.0] * size
    for side, position, mass in _rigid_limits(found, size):
        if 1 <= mass <= size:
            nearest = min if side == "upper" else max
            starts[mass - 1] = nearest(starts[mass - 1], position)
    if any(starts) and kind in ("oscillator", "chain"):
        body[START] = starts if kind == "chain" else starts[0]
    return found


def _rigid_limits(document: Mapping[str, Any], size: int) -> Iterator[tuple[str, float, int]]:
    """Yield side, worst position over the sweep, and mass (given, or the last) of each rigid stop."""
    stops, swept = document.get("stop"), _table_of(document.get("sweep"))
    for number, stop in enumerate(stops if isinstance(stops, list) else [], start=1):
        if not isinstance(stop, dict) or stop.get("law", "restitution") != "restitution":
            continue
        side, mass = stop.get("side", "upper"), stop.get("mass", size)
        positions = [*_axis_values(swept.get(f"stop[{number}].position")), stop.get("position")]
        known = [float(each) for each in positions if type(each) in (int, float) and each == each]
        if known and type(mass) is int:
            yield side, (min(known) if side == "upper" else max(known)), mass


def _axis_values(axis: Any) -> list[Any]:
    """Return the ends and the values of a swept key, as written."""
    table = _table_of(axis)
    values = table.get("values")
    return [*(values if isinstance(values, list) else []), table.get("start"), table.get("stop")]


def _table_of(raw: Any) -> Mapping[str, Any]:
    return raw if isinstance(raw, dict) else {}
