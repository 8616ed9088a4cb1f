"""Problems of a scene file as messages: `file: key: expected ..., got .... hint`.

A problem is a value, not an exception. The parts of the scene reader return lists of problems, and one `SceneError` at
the end has all of them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from vibroimpact.fmus.messages import reworded
from vibroimpact.fmus.safe_toml import TooDeepError
from vibroimpact.orchestrator.scene.fields import (
    Rule,
    choices_of,
    field_of,
    forms_of,
    known_keys,
    listed,
    rule_of,
)
from vibroimpact.orchestrator.scene.not_modelled import effect_not_modelled

Table = TypeVar("Table", bound=BaseModel)
KeyPath = tuple[str | int, ...]

NUMBER_TAG, ARRAY_TAG, WORD_TAG = "number alone", "array of numbers", "word alone"
"""Tags of the forms of a field "a number, or an array of them"; part of pydantic's location, not of the key."""

LONGEST_QUOTE = 60
MOST_PROBLEMS = 50
"""Largest number of problems of one file that are listed; of further problems only the number is given."""
MOST_WORDS_LISTED = 12
MODELLED = "effects that are modelled"
CHANGES = "--set"
"""The option that changes keys of a scene."""

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
_TOML_PLACE = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)\Z")
_NUMBER_IN_TEXT = re.compile(r"\s*[-+.]?\d")

_SYNTAX_HINTS = {
    "Cannot declare ('stop',) twice": "Write [[stop]], with two brackets, for each stop.",
    "Cannot overwrite": "Give each key once.",
    "twice": "Give each table once.",
    "Invalid value": "Text goes in double quotes, numbers use a decimal point.",
    "Expected newline": "Give each key a line of its own, numbers with a decimal point (0.5, not 0,5).",
    "Expected '=' after a key": 'A key with a dot or brackets in its name needs quotes ("stop[1].position").',
}


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem in a scene: key, expected value, found value, and a hint to fix it.

    A hint that takes time to find, such as the nearest spelling, may be a function: it is called for the message.
    """

    key: str
    expected: str
    got: str
    hint: str | Callable[[], str] = ""

    def line(self, source: str) -> str:
        """Return the problem as one line of a message."""
        hint = self.hint if isinstance(self.hint, str) else self.hint()
        said = f"expected {self.expected}, got {self.got}.{f' {hint}' if hint else ''}"
        return reworded(self.key, lambda key: f"{source}: {key}: {said}" if key else f"{source}: {said}")


def lines_of(problems: Sequence[Problem], source: str, changed: Collection[str] = ()) -> tuple[str, ...]:
    """Return the lines of a message with all problems of a file, each once, up to `MOST_PROBLEMS`.

    Problems of keys that the command line has changed name its option in place of the file.
    """
    lines: dict[str, None] = {}
    if changed:
        source = f"{source} with {CHANGES}"
    for place, problem in enumerate(problems):
        if len(lines) == MOST_PROBLEMS:
            more = len(problems) - place
            return (*lines, f"{source}: and {more} more {'problem' if more == 1 else 'problems'}.")
        lines[problem.line(CHANGES if _concerns(problem.key, changed) else source)] = None
    return tuple(lines)


def _concerns(key: str, changed: Collection[str]) -> bool:
    """Return whether a key is a changed key, within a changed key, or a table of a changed key."""

    def within(inner: str, outer: str) -> bool:
        return inner == outer or inner.startswith((f"{outer}.", f"{outer}["))

    return any(within(key, other) or within(other, key) for other in changed)


def quoted(value: object) -> str:
    """Return a value of a TOML document as one short line for a message.

    Examples
    --------
    >>> quoted(True), quoted("0.5"), quoted({}), quoted([1, 2]), quoted(None)
    ('true', '"0.5"', 'a table', 'an array of 2', 'nothing')
    >>> print(quoted("two\\x85lines"))
    "two\\u0085lines"
    """
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"an array of {len(value)}" if value else "an empty array"
    if isinstance(value, bool | str):
        quoted_text = json.dumps(value, ensure_ascii=False)
        # JSON keeps some characters that break a line, such as U+0085
        return _shortened("".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in quoted_text))
    if isinstance(value, int) and abs(value) >= 10**LONGEST_QUOTE:
        return f"a number near 1e{math.floor(math.log10(abs(value)))}"
    return _shortened(str(value))


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_QUOTE else text[: LONGEST_QUOTE - 3] + "..."


def key_path(parts: Iterable[str | int]) -> str:
    """Return the key of its parts, with 1-based indices.

    Examples
    --------
    >>> key_path(("stop", 0, "restitution")), key_path(("sweep", "body.mass", "points"))
    ('stop[1].restitution', 'sweep."body.mass".points')
    """
    path = ""
    for part in parts:
        if isinstance(part, int):
            path += f"[{part + 1}]"
        else:
            plain = _BARE_KEY.match(part) and len(part) <= LONGEST_QUOTE
            path += ("." if path else "") + (part if plain else quoted(part))
    return path


def nearest(word: object, known: Iterable[str], prefix: str = "") -> str:
    """Return a hint with the nearest spelling of a word, or with the known words if none is near.

    Examples
    --------
    >>> nearest("heigth", ["height", "velocity"], "ball.")
    'Did you mean ball.height?'
    """
    options = [option for option in known if option.isprintable()]  # a message is one line
    near = _nearest_word(word, options)
    if near:
        return f"Did you mean {prefix}{near}?"
    if not options:
        return ""
    more = len(options) - MOST_WORDS_LISTED
    listed = ", ".join(options[:MOST_WORDS_LISTED])
    return f"Known here: {listed}{f' and {more} more' if more > 0 else ''}."


def _nearest_word(word: object, options: Sequence[str]) -> str | None:
    if not isinstance(word, str):
        return None
    lower = {option.lower(): option for option in options}
    near = get_close_matches(word.lower(), lower, n=1)
    return lower[near[0]] if near else None


def unknown_key(path: Sequence[str | int], known: Iterable[str]) -> Problem:
    """Return the problem of an unknown key of a table; one that asks for an effect names the effect."""
    if said := effect_not_modelled(str(path[0]), path[-1]):
        return Problem(key_path(path), MODELLED, quoted(path[-1]), said)
    return Problem(
        key_path(path),
        "a known key",
        f"the unknown key {quoted(path[-1])}",
        partial(nearest, path[-1], list(known)),
    )


def read_table(model: type[Table], raw: object, path: KeyPath, problems: list[Problem]) -> Table | None:
    """Return a table as its model; None for an invalid table, whose problems are added to the list.

    Parameters
    ----------
    model : type of BaseModel
        The model of the table; its fields have a `Rule`.
    raw : object
        Value in the document.
    path : tuple
        Path of the table, for example ("stop", 0).
    problems : list of Problem
        List to which problems are added.
    """
    if not isinstance(raw, dict):
        # the problem of an array is its brackets, so the message names the whole array
        where = key_path(path) if path[0] == "component" else str(path[0])
        problems.append(Problem(where, "a table", quoted(raw), f"Write {_brackets(path)}."))
        return None
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        problems += problems_of(error, model, path)
        return None


def _brackets(path: KeyPath) -> str:
    if path[0] == "component":
        return f'[{key_path(path)}] and below it fmu = "FILE.fmu"'
    if isinstance(path[-1], int):
        return f"[[{path[0]}]], with two brackets"
    return f"[{path[0]}], with single brackets, once"


def problems_of(error: ValidationError, model: type[BaseModel], table: KeyPath) -> list[Problem]:
    """Return the errors of pydantic in the table at a path, as problems."""
    entries = [
        {**entry, "loc": _as_written(entry["loc"])}
        for entry in error.errors(include_url=False, include_context=False)
    ]
    return [_problem_of(entry, model, table) for entry in entries if not _is_an_echo(entry, entries, model)]


def _as_written(location: Sequence[str | int]) -> KeyPath:
    """Return a location without pydantic's own tags."""
    return (*location[:1], *(part for part in location[1:] if part not in (NUMBER_TAG, ARRAY_TAG, WORD_TAG)))


def _is_an_echo(entry: Any, entries: Sequence[Any], model: type[BaseModel]) -> bool:
    """Return whether an error only follows from another error of the same table."""
    location = entry["loc"]
    if entry["type"] == "too_short":  # bad items do not count as items
        return any(other["loc"][:-1] == location for other in entries)
    if entry["type"] != "missing":
        return False
    misspelt = (
        other["loc"][-1]
        for other in entries[:MOST_PROBLEMS]
        if other["type"] == "extra_forbidden" and other["loc"][:-1] == location[:-1]
    )
    known = known_keys(_owner(model, location)[0])
    return any(_nearest_word(word, known) == location[-1] for word in misspelt)


def _problem_of(entry: Any, model: type[BaseModel], table: KeyPath) -> Problem:
    path = (*table, *entry["loc"])
    owner, name = _owner(model, entry["loc"])
    if entry["type"] == "extra_forbidden":
        return unknown_key(path, known_keys(owner))
    field = field_of(owner, name)
    if entry["type"] == "missing":
        hint = f"Add {key_path(path[-1:])} = ... to {_header(path[:-1])}."
        return Problem(key_path(path), rule_of(field).expected, "nothing", hint)
    return value_problem(path, field, entry["input"])


def _owner(model: type[BaseModel], location: Sequence[str | int]) -> tuple[type[BaseModel], str]:
    """Return the model of the innermost table on a location, and the key in it."""
    name = str(location[0])
    if len(location) == 1 or isinstance(location[1], int):
        return model, name
    annotation = field_of(model, name).annotation
    inner, rest = forms_of(annotation)[0], location[1:]
    if get_origin(inner) is dict:  # tables by name
        inner, rest = get_args(inner)[1], location[2:]
    is_table = isinstance(inner, type) and issubclass(inner, BaseModel)
    return _owner(inner, rest) if is_table and rest else (model, name)  # else numbers by name


def value_problem(path: Sequence[str | int], field: FieldInfo, value: object) -> Problem:
    """Return the problem of a value that breaks the rule of its field."""
    rule = rule_of(field)
    expected = rule.item if rule.item and isinstance(path[-1], int) else rule.expected
    hint = _value_hint(rule, path, value, choices_of(field.annotation))
    return Problem(key_path(path), expected, quoted(value), hint)


def choice_problem(
    path: Sequence[str | int], field: FieldInfo, value: object, choices: Collection[str]
) -> Problem:
    """Return the problem of a word that should choose a kind of table, and is none of the choices."""
    rule = rule_of(field)
    expected = listed([quoted(choice) for choice in choices], "or")
    return Problem(key_path(path), expected, quoted(value), _value_hint(rule, path, value, choices))


def _value_hint(rule: Rule, path: Sequence[str | int], value: object, words: Iterable[object]) -> str:
    if isinstance(value, str) and value in rule.unavailable:
        return f'"{value}" is not available in this version.'
    choices = [word for word in words if isinstance(word, str)]
    if isinstance(value, str) and choices:
        if said := effect_not_modelled(str(path[0]), value):
            return said
        near = _nearest_word(value, choices)
        return f'Did you mean "{near}"?' if near else rule.hint
    if isinstance(value, str) and _NUMBER_IN_TEXT.match(value):
        unit = f"; the unit of this key is {rule.unit} in an SI scene" if rule.unit else ""
        return f"Write the number alone, without quotes{unit}."
    return rule.hint


def _header(table: KeyPath) -> str:
    if len(table) > 1 and isinstance(table[1], int):
        return f"[[{table[0]}]]"
    return f"[{key_path(table)}]"


def syntax_problem(error: ValueError, text: str) -> Problem:
    """Return the problem of a text that is not TOML, with the place and the text of the line."""
    if isinstance(error, TooDeepError):
        where = "" if error.line is None else f"line {error.line}"
        hint = "A scene has tables and short arrays only."
        return Problem(where, "shallow tables and arrays", "nesting too deep to read", hint)
    if not _TOML_PLACE.search(str(error)):
        return Problem("", "numbers of a usual length", "one of thousands of digits")
    message = str(error)
    place = _TOML_PLACE.search(message)
    what = message[: place.start()].rstrip() if place else message
    hint = next((advice for start, advice in _SYNTAX_HINTS.items() if start in what), "")
    said = f"{what.rstrip('.')}. {hint}".rstrip()
    lines = re.split(r"\r?\n", text.rstrip())
    if place is None or place[1] is None:
        return Problem("end of file", "valid TOML", quoted(lines[-1].strip()), said)
    number = int(place[1])
    line = lines[number - 1] if number <= len(lines) else ""
    return Problem(f"line {number}, column {place[2]}", "valid TOML", quoted(line.strip()), said)
