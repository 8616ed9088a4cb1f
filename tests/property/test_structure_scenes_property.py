"""Random scenes of several bodies: valid ones keep their text and their keys, and each mistake is named by its key."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.drawn_structures import Tables, drawn_structure

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene

SEEDS = st.integers(0, 2**32 - 1)
TOO_MANY = 65


def _set(table: str, **keys: Any) -> Callable[[Tables], None]:
    return lambda tables: tables[table][0].update(keys)


def _add(table: str, **keys: Any) -> Callable[[Tables], None]:
    return lambda tables: tables.setdefault(table, []).insert(0, keys)


def _drop_name(tables: Tables) -> None:
    del tables["body"][1]["name"]


MISTAKES: dict[str, tuple[Callable[[Tables], None], str]] = {
    "two bodies of one name": (
        lambda t: t["body"][1].update(name="a"),
        "body[2].name: expected a name of its own",
    ),
    "no name": (_drop_name, "body[2].name: expected a name of letters"),
    "a number as name": (_set("body", name=1.5), "body[1].name: expected a name of letters"),
    "a contact at one point": (
        _set("contact", between=["a", "a"]),
        "contact[1].between: expected two points that",
    ),
    "a contact with nobody": (
        _set("contact", between=["a", "nobody"]),
        "contact[1].between[2]: expected a point",
    ),
    "three points": (_set("contact", between=["a", "b", "a"]), "contact[1].between: expected two points"),
    "a link at one point": (_add("link", between=["b", "b"]), "link[1].between: expected two points that"),
    "a link to no point": (_add("link", between=["a", "a.99"]), "link[1].between[2]: expected"),
    "a stiffness that is no number": (
        _add("link", between=["a", "b"], stiffness=math.nan),
        "link[1].stiffness: expected a finite number",
    ),
    "infinite clearance": (
        _set("contact", clearance=math.inf),
        "contact[1].clearance: expected a finite number",
    ),
    "a stop at no point": (
        _add("stop", at="z", position=1.0, restitution=0.5),
        "stop[1].at: expected a point",
    ),
    "a stop without a point": (_add("stop", position=1.0, restitution=0.5), "stop[1].at: expected the point"),
    "a clearance in words": (
        _set("contact", clearance="wide"),
        "contact[1].clearance: expected a finite number",
    ),
    "an unknown key": (_set("contact", gap=1.0), "contact[1].gap: expected a known key"),
    "too many modes": (
        lambda t: t["body"].append(
            {"name": "z", "kind": "chain", "masses": [1.0] * TOO_MANY, "stiffnesses": 1.0}
        ),
        "body[",
    ),
    "too many contacts": (lambda t: t.update(contact=t["contact"] * 33), "contact: expected at most 32"),
    "too many links": (
        lambda t: t.update(link=[{"between": ["a", "ground"]}] * 257),
        "link: expected at most 256 links",
    ),
    "nobody observed": (
        lambda t: t["record"].update(observed=["nobody"]),
        "record.observed[1]: expected a point",
    ),
    "a body of another kind": (_set("body", kind="plate"), 'body[1].kind: expected "oscillator"'),
}


def with_points_of_oscillators(seed: int) -> Tables:
    """Return a drawn scene whose first two bodies are oscillators, which mistakes can name."""
    tables = deepcopy(drawn_structure(seed))
    free = {"mass": 1.0, "stiffness": 1.0}
    tables["body"][:2] = [free | {"name": "a"}, free | {"name": "b"}]
    tables["contact"] = [{"between": ["a", "b"], "restitution": 0.5, "clearance": 0.1}]
    series = tables["record"].pop("time_series")
    tables["record"] = {key: value for key, value in tables["record"].items() if key != "observed"}
    tables["record"]["time_series"] = series | {"variables": ["displacement"]}
    others = {"stop", "link"}
    if "at" in tables.get("forcing", {}):
        tables["forcing"]["at"] = "a"
    return {key: value for key, value in tables.items() if key not in others}


@settings(max_examples=40)
@given(SEEDS)
def test_a_drawn_scene_is_valid_and_keeps_its_text(seed: int) -> None:
    scene = Scene.from_dict(drawn_structure(seed))
    again = Scene.from_text(scene.to_toml())
    assert again.model_dump(exclude={"text", "source"}) == scene.model_dump(exclude={"text", "source"})


@settings(max_examples=25)
@given(SEEDS)
def test_each_number_of_a_drawn_scene_can_be_set_by_its_key(seed: int) -> None:
    scene = Scene.from_dict(drawn_structure(seed))
    numbers = dict(scene.numbers())
    changed = scene.at(numbers)
    assert dict(changed.numbers()) == numbers
    key = sorted(key for key in numbers if key.endswith(("mass", "clearance", "stiffness")))[0]
    value = numbers[key] + 0.125
    assert scene.with_values({key: value}).value(key) == scene.at({key: value}).value(key) == value


@settings(max_examples=3)
@given(SEEDS)
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_drawn_scene_is_one_line_with_its_key(name: str, seed: int) -> None:
    tables = with_points_of_oscillators(seed)
    Scene.from_dict(tables)
    change, expected = MISTAKES[name]
    change(tables)
    with pytest.raises(SceneError) as refused:
        Scene.from_dict(tables)
    lines = [line.removeprefix("scene: ") for line in str(refused.value).splitlines()]
    assert len(lines) == 1, lines
    assert lines[0].startswith(expected), lines
