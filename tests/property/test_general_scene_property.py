"""Any content of a general scene gives a scene or a list of clear problems."""

from __future__ import annotations

import json
import string
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.component_facts import component_facts

LETTERS = string.ascii_letters + string.digits + "[]{}=.,_-+\"'#\\\n\r\t \x7f\u00e4\u20ac"
values = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(LETTERS, max_size=8) | st.dates(),
    lambda inner: (
        st.lists(inner, max_size=2) | st.dictionaries(st.text(LETTERS, max_size=6), inner, max_size=2)
    ),
    max_leaves=5,
)
PLACES = [
    ("component",),
    ("component", "a"),
    ("component", "a", "fmu"),
    ("component", "b", "fmi"),
    ("component", "a", "parameters"),
    ("component", "a", "parameters", "mass"),
    ("component", "a", "parameters", "contact[1].law"),
    ("component", "a", "parameters", "impact_limit"),
    ("component", "a", "parameters", "record.impacts"),
    ("connection",),
    ("connection", 0),
    ("connection", 0, "from"),
    ("connection", 0, "to"),
    ("connection", 0, "gain"),
    ("connection", 0, "gain_unit"),
    ("event",),
    ("event", 0, "watch"),
    ("event", 0, "level"),
    ("record", "variables"),
    ("record", "variables", 0),
    ("record", "rate"),
    ("sweep", "a.mass"),
    ("sweep", "connection[1].gain"),
    ("sweep", "a"),
    ("execution", "macro_step"),
    ("execution", "guard"),
    ("execution", "exchange"),
]


def valid_scene() -> dict[str, Any]:
    return {
        "component": {
            "a": {"fmu": "Oscillator", "parameters": {"mass": 1.0}},
            "b": {"fmu": "Oscillator", "fmi": "2.0"},
        },
        "connection": [{"from": "b.displacement", "to": "a.force", "gain": 0.5, "gain_unit": "N/m"}],
        "event": [{"watch": "a.velocity", "direction": "either"}],
        "record": {"recorded_time": 1.0, "variables": ["a.velocity"], "rate": 10.0},
        "sweep": {"b.stiffness": {"values": [1.0]}},
        "execution": {"macro_step": 0.1},
    }


def written(value: Any) -> str:
    """Write a value as TOML."""
    if isinstance(value, dict):
        pairs = (f"{written(str(key))} = {written(inner)}" for key, inner in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(written(inner) for inner in value) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else str(value)


def found_in(document: dict[str, Any]) -> tuple[str, ...]:
    text = "\n".join(f"{name} = {written(value)}" for name, value in document.items())
    try:
        parse_scene(text, "s.toml")
    except SceneError as error:
        return error.problems or ("an error that says nothing",)
    return ()


def test_the_scene_that_the_properties_start_from_is_valid() -> None:
    assert found_in(valid_scene()) == ()


@given(place=st.sampled_from(PLACES), value=values)
def test_any_value_in_any_place_gives_a_scene_or_problems(place: tuple[str | int, ...], value: Any) -> None:
    document = valid_scene()
    owner: Any = document
    for part in place[:-1]:
        owner = owner[part]
    owner[place[-1]] = value
    problems = found_in(document)
    assert all(problem.startswith("s.toml: ") and "\n" not in problem for problem in problems)
    assert all(": expected " in problem and ", got " in problem for problem in problems)


@given(data=st.data())
def test_any_two_variables_are_connected_or_told_why_not(data: st.DataObject) -> None:
    names = st.sampled_from(list(component_facts(fmu_path("Oscillator", "2.0")).variables))
    document = valid_scene()
    source, target = data.draw(names), data.draw(names)
    document["connection"] = [{"from": f"b.{source}", "to": f"a.{target}"}]
    problems = found_in(document)
    # a connection to a contact of the watched component is reported at the watch
    expected = ("s.toml: connection[1]", "s.toml: event[1].watch: expected a component without a contact")
    assert all(problem.startswith(expected) for problem in problems), problems
    assert len(problems) <= 2
