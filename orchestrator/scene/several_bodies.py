"""Scenes of several `[[body]]` tables during the checks: their parts as drafts of their own; a list of one body."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, MutableMapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

from vibroimpact.orchestrator.scene.body_models.growing import has_negative, sweeps_negative
from vibroimpact.orchestrator.scene.body_models.modes import is_listed
from vibroimpact.orchestrator.scene.body_models.points import BODY_NAME, GROUND
from vibroimpact.orchestrator.scene.body_models.structure import NOT_IN_STRUCTURES
from vibroimpact.orchestrator.scene.problems import Problem, quoted
from vibroimpact.orchestrator.scene.sweep import SweepAxis

JOINING_TABLES = ("link", "contact")
"""Tables that make a structure even of one `[[body]]`."""
ONLY_BODY = "body"
"""Name of a single `[body]` that runs as a structure."""
_TABLE, _LIST = (re.compile(rf"^[ \t]*{re.escape(head)}", re.M) for head in ("[body]", "[[body]]"))
_SWEPT, _SWEPT_OF_LIST = (re.compile(rf"^([ \t]*\"){re.escape(key)}", re.M) for key in ("body.", "body[1]."))


def is_structure(document: Mapping[str, Any]) -> bool:
    """Return whether a document of the short form has several bodies, or joins points of one.

    Examples
    --------
    >>> is_structure({"body": [{}, {}]}), is_structure({"body": {}}), is_structure({"body": [{}], "contact": []})
    (True, False, True)
    """
    joined = any(name in document for name in JOINING_TABLES)
    return isinstance(document.get("body"), list) or ("body" in document and joined)


def is_left_out(key: str) -> bool:
    """Return whether a key names a number of one of several bodies that a structure does not have.

    >>> is_left_out("body[1].frequency_slope"), is_left_out("body[1].mass"), is_left_out("body.frequency_slope")
    (True, False, False)
    """
    return key.startswith("body[") and key.rpartition(".")[2] in NOT_IN_STRUCTURES


def with_one_body(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document in which a list of one body without links and contacts is a single table `[body]`.

    Points of the body become the places that a scene of one body has. A single table beside links or contacts, or with
    a negative spring or dashpot, becomes a list of one.

    Examples
    --------
    >>> with_one_body({"body": [{"name": "ball", "mass": 1.0}], "stop": [{"at": "ball", "position": 1.0}]})
    {'body': {'mass': 1.0}, 'stop': [{'position': 1.0}]}
    """
    bodies = document.get("body")
    if any(name in document for name in JOINING_TABLES):
        is_short = "body" in document and "component" not in document
        is_table = is_short and isinstance(bodies, dict)
        return _renamed({**document, "body": [bodies]}, "body.", "body[1].") if is_table else document
    if isinstance(bodies, dict) and _stays_listed(bodies, document, "body."):
        return _with_named_body(document)
    if not isinstance(bodies, list) or len(bodies) != 1 or not isinstance(bodies[0], dict):
        return document
    if _stays_listed(bodies[0], document, "body[1]."):
        return document
    found = _renamed(deepcopy(document), "body[1].", "body.")
    found["body"] = found["body"][0]
    _leave_out_names(found)
    return found


def _stays_listed(body: dict[str, Any], document: Mapping[str, Any], owner: str) -> bool:
    """Return whether a body runs in a list: as given modes, or with a negative spring or dashpot, which no beam has."""
    if is_listed(body):
        return True
    negative = has_negative(body) or sweeps_negative(document.get("sweep"), owner)
    return negative and body.get("kind") != "beam"


def _with_named_body(document: dict[str, Any]) -> dict[str, Any]:
    """Return the document of one body as a list of one, with the points of its stops and of its force."""
    found = _renamed(deepcopy(document), "body.", "body[1].")
    found["body"] = [{"name": ONLY_BODY, **found["body"]}]
    for stop in _tables(found.get("stop")):
        if isinstance(stop, dict) and "at" not in stop:
            mass = stop.pop("mass", None)
            stop["at"] = ONLY_BODY if mass is None else f"{ONLY_BODY}.{mass}"
    forces = found.get("forcing")
    for force in forces if isinstance(forces, list) else [forces]:
        if isinstance(force, dict) and force.get("kind", "force") == "force":
            force.setdefault("at", ONLY_BODY)
    return found


def with_one_body_in_text(text: str) -> str:
    """Return the text of `with_one_body` for the text of a valid scene, with its comments where the layout is usual.

    Examples
    --------
    >>> print(with_one_body_in_text('[[body]]\\nname = "ball"\\nmass = 1.0 # kg'))
    [body]
    mass = 1.0 # kg
    """
    import tomlkit  # the import takes time, and few scenes are written anew

    if any(name in tomlkit.parse(text) for name in JOINING_TABLES):
        return _SWEPT.sub(r"\1body[1].", _TABLE.sub("[[body]]", text))
    document = tomlkit.parse(_SWEPT_OF_LIST.sub(r"\1body.", _LIST.sub("[body]", text)))
    if isinstance(document["body"], list):  # written in one line, or by a quoted name
        document["body"] = document["body"][0]
    _leave_out_names(document)
    return tomlkit.dumps(document)


def _leave_out_names(document: MutableMapping[str, Any]) -> None:
    """Take the name from the table `[body]`, and the points with this name from the other tables."""
    body = document["body"]
    name = body.pop("name", None)
    forcing = document.get("forcing")
    for table in (forcing, *_tables(forcing), *_tables(document.get("stop"))):
        if isinstance(table, dict) and isinstance(table.get("at"), str):
            _place(table, name, body)


def _renamed(document: dict[str, Any], before: str, after: str) -> dict[str, Any]:
    """Return a document whose swept keys begin in another way."""
    sweep = document.get("sweep")
    if not isinstance(sweep, dict):
        return document
    keys = {key: after + key.removeprefix(before) if key.startswith(before) else key for key in sweep}
    return {**document, "sweep": {keys[key]: axis for key, axis in sweep.items()}}


def _tables(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _place(table: dict[str, Any], name: object, body: Mapping[str, Any]) -> None:
    """Put the place that a scene of one body has in the place of `at`; an unknown point stays."""
    owner, _, rest = table["at"].partition(".")
    if owner != name:
        return
    number = rest.removeprefix("mass[").removesuffix("]")
    kind = body.get("kind", "oscillator")
    if rest in ("", "mass" if kind == "oscillator" else "tip"):
        del table["at"]
    elif kind == "chain" and number.isdecimal() and "position" in table:
        del table["at"]
        table["mass"] = int(number)
    elif kind == "beam" and rest.replace(".", "", 1).isdecimal():
        del table["at"]
        table["location"] = float(rest)


def named_bodies(document: Mapping[str, Any], problems: list[Problem]) -> tuple[str | None, ...]:
    """Return the names of the bodies, None for each invalid one, whose problem is added to the list."""
    names: list[str | None] = []
    for number, body in enumerate(_bodies(document), start=1):
        name = body.get("name") if isinstance(body, dict) else None
        problem = _name_problem(f"body[{number}].name", name, names)
        problems += [] if problem is None or not isinstance(body, dict) else [problem]
        names.append(None if problem else str(name))
    return tuple(names)


def _bodies(document: Mapping[str, Any]) -> list[Any]:
    raw = document["body"]
    return raw if isinstance(raw, list) else [raw]


def _name_problem(where: str, name: object, before: list[str | None]) -> Problem | None:
    expected = "a name of letters, digits, _ and -, with a letter first"
    if name is None:
        return Problem(where, expected, "nothing", "Links, contacts and stops find a body by its name.")
    if not isinstance(name, str) or not BODY_NAME.fullmatch(name):
        return Problem(where, expected, quoted(name))
    if name == GROUND:
        return Problem(
            where, "another name", quoted(name), "The ground is the end of links that does not move."
        )
    if name in before:
        return Problem(
            where, "a name of its own", f"{quoted(name)}, which body[{before.index(name) + 1}] has"
        )
    return None


def part_documents(document: Mapping[str, Any], problems: list[Problem]) -> Iterator[dict[str, Any]]:
    """Yield each body as the document of a scene of one body; a body that is no table is a problem."""
    for number, body in enumerate(_bodies(document), start=1):
        if not isinstance(body, dict):
            problems.append(
                Problem(f"body[{number}]", "a table", quoted(body), "Write [[body]] for each body.")
            )
        else:
            yield {"body": {key: value for key, value in body.items() if key != "name"}}


def axes_of_part(number: int, axes: tuple[SweepAxis, ...]) -> tuple[SweepAxis, ...]:
    """Return the swept keys of one body, named as in a scene of one body."""
    owner = f"body[{number}]."
    own = (axis for axis in axes if axis.key.startswith(owner))
    return tuple(replace(axis, key=f"body.{axis.key.removeprefix(owner)}") for axis in own)


def of_part(number: int, problem: Problem) -> Problem:
    """Return a problem of one body with the key that it has among several."""
    key = problem.key
    return replace(
        problem, key=f"body[{number}]{key.removeprefix('body')}" if key.startswith("body") else key
    )
