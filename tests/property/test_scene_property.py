"""Any content of a scene file gives a scene or a list of clear problems."""

from __future__ import annotations

import json
import math
import string
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel
from support.scenes import problems_of

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.body_models import OscillatorBody
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import known_keys
from vibroimpact.orchestrator.scene.forcing_models import Forcing
from vibroimpact.orchestrator.scene.models import Record, RestitutionStop, SceneHeader
from vibroimpact.orchestrator.scene.sweep import expand, run_count

MODELS: dict[str, type[BaseModel]] = {
    "scene": SceneHeader,
    "body": OscillatorBody,
    "forcing": Forcing,
    "stop": RestitutionStop,
    "record": Record,
    "execution": Execution,
}
NUMBERS = [
    ("body", "mass"),
    ("body", "stiffness"),
    ("body", "damping"),
    ("body", "displacement_start"),
    ("body", "velocity_start"),
    ("forcing", "amplitude"),
    ("forcing", "angular_frequency"),
    ("forcing", "phase"),
    ("stop", "position"),
    ("stop", "restitution"),
    ("execution", "deadline"),
]
SIZES = st.floats(1e-6, 1e6)

LETTERS = string.ascii_letters + string.digits + "[]{}=.,_-+\"'#\\\n\r\t \x7f\u00e4\u20ac\U0001f600"
bare_keys = st.text(string.ascii_lowercase + "_", min_size=1, max_size=20)
toml_values = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(LETTERS, max_size=8) | st.dates() | st.datetimes(),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(LETTERS, max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)


def written(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {written(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(written(inner) for inner in value) + "]"
    if isinstance(value, str):
        # JSON writes characters outside the basic plane as two escapes, TOML does not; \x7f must be escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else str(value)


def scene_text(tables: dict[str, dict[str, Any]]) -> str:
    lines = []
    for name, table in tables.items():
        lines.append(f"[[{name}]]" if name == "stop" else f"[{name}]")
        lines += [
            f"{written(key) if name == 'sweep' else key} = {written(value)}" for key, value in table.items()
        ]
    return "\n".join(lines)


def valid_tables() -> dict[str, dict[str, Any]]:
    return {
        "scene": {"title": "t", "units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        "forcing": {"amplitude": 0.5, "angular_frequency": 0.8},
        "stop": {"position": 1.0, "restitution": 0.7},
        "record": {"recorded_periods": 20},
        "execution": {"how": "auto"},
    }


def found_in(text: str) -> tuple[str, ...]:
    """Return the problems of a text, none for a scene; any other exception is a failure."""
    try:
        parse_scene(text, "s.toml")
    except SceneError as error:
        return error.problems
    return ()


@given(
    mass=SIZES,
    stiffness=SIZES,
    ratio=st.floats(0.0, 100.0),
    amplitude=st.floats(-1e6, 1e6),
    frequency=SIZES,
    position=st.floats(0.0, 1e6),
    restitution=st.floats(0.0, 1.0),
)
def test_numbers_come_back_bit_for_bit(
    mass: float,
    stiffness: float,
    ratio: float,
    amplitude: float,
    frequency: float,
    position: float,
    restitution: float,
) -> None:
    tables = valid_tables()
    tables["body"] = {"mass": mass, "stiffness": stiffness, "damping_ratio": ratio}
    tables["forcing"] = {"amplitude": amplitude, "angular_frequency": frequency}
    tables["stop"] |= {"position": position, "restitution": restitution}
    scene = parse_scene(scene_text(tables), "s.toml")
    numbers = {
        "body.mass": mass,
        "body.stiffness": stiffness,
        "body.damping_ratio": ratio,
        "forcing.amplitude": amplitude,
        "forcing.angular_frequency": frequency,
        "stop[1].position": position,
        "stop[1].restitution": restitution,
    }
    assert {key: scene.value(key) for key in numbers} == numbers
    assert scene.at(numbers) == scene
    assert scene.body.damping == 2 * ratio * math.sqrt(stiffness * mass)


@given(table=st.sampled_from(sorted(MODELS)), key=bare_keys)
def test_any_unknown_key_is_reported_with_its_path(table: str, key: str) -> None:
    if key in known_keys(MODELS[table]):
        return
    tables = valid_tables()
    tables[table] |= {key: 1}
    (problem,) = problems_of(scene_text(tables))
    path = f"stop[1].{key}" if table == "stop" else f"{table}.{key}"
    assert problem.startswith(f'{path}: expected a known key, got the unknown key "{key}".')


@given(
    place=st.sampled_from(NUMBERS),
    bad=st.sampled_from(["nan", "-nan", "inf", "-inf", "true", '"1.0"', "[1.0]"]),
)
def test_nothing_but_a_finite_number_is_a_number(place: tuple[str, str], bad: str) -> None:
    table, key = place
    tables = valid_tables()
    tables[table] |= {key: "HERE"}
    text = scene_text(tables).replace('"HERE"', bad)
    (problem,) = [line for line in problems_of(text) if f".{key}: " in line]
    assert problem.startswith(f"{'stop[1]' if table == 'stop' else table}.{key}: expected ")
    assert ", got " in problem


@given(place=st.sampled_from(NUMBERS[:-1]), bad=st.sampled_from([math.nan, math.inf, -math.inf]))
def test_no_swept_value_is_nan_or_infinite(place: tuple[str, str], bad: float) -> None:
    key = f"{'stop[1]' if place[0] == 'stop' else place[0]}.{place[1]}"
    text = scene_text({**valid_tables(), "sweep": {key: {"values": [0.5, bad]}}})
    (problem,) = problems_of(text)
    assert problem.startswith(f'sweep."{key}".values[2]: expected a finite number, got ')


@given(tables=st.dictionaries(st.sampled_from([*MODELS, "sweep", "chain"]), toml_values, max_size=5))
def test_any_toml_gives_a_scene_or_problems(tables: dict[str, Any]) -> None:
    text = "\n".join(f"{name} = {written(value)}" for name, value in tables.items())
    assert all(problem.startswith("s.toml: ") and "\n" not in problem for problem in found_in(text))


@given(data=st.data(), table=st.sampled_from([*sorted(MODELS), "sweep"]), value=toml_values)
def test_any_value_under_a_known_key_gives_a_scene_or_problems(
    data: st.DataObject, table: str, value: Any
) -> None:
    tables = {**valid_tables(), "sweep": {"body.mass": {"values": [1.0]}}}
    keys = (
        ["body.mass", "stop[1].position", "stop[2].position"]
        if table == "sweep"
        else known_keys(MODELS[table])
    )
    tables[table] |= {data.draw(st.sampled_from(keys)): value}
    problems = found_in(scene_text(tables))
    assert all(": expected " in problem and ", got " in problem for problem in problems)


@given(text=st.text(LETTERS, max_size=200))
def test_any_text_gives_a_scene_or_problems(text: str) -> None:
    with pytest.raises(SceneError):
        parse_scene(text, "s.toml")


@given(
    lengths=st.lists(st.integers(1, 5), min_size=1, max_size=3),
    path=st.sampled_from(["independent", "up", "down", "up-down"]),
    data=st.data(),
)
def test_the_points_of_a_sweep_cover_the_runs_once(
    lengths: list[int], path: str, data: st.DataObject
) -> None:
    keys = ["body.mass", "forcing.amplitude", "stop[1].position"][: len(lengths)]
    carried = data.draw(st.sampled_from(keys))
    sweep = {
        key: {"values": [float(value + 1) for value in range(count)]}
        for key, count in zip(keys, lengths, strict=True)
    }
    sweep[carried] |= {"path": path}  # type: ignore[dict-item]
    scene = parse_scene(scene_text({**valid_tables(), "sweep": sweep}), "s.toml")
    points = [point for branch in expand(scene) for point in branch.points]
    assert [point.index for point in points] == list(range(run_count(scene.sweep)))
    both_ways = 2 if path == "up-down" else 1
    assert len({tuple(sorted(point.values.items())) for point in points}) * both_ways == len(points)
