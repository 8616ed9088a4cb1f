"""Any list of forces is a scene that reads itself again, with a key for each number; others are lists of problems."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import MOST_PERIODS, Clock, clock_of
from vibroimpact.orchestrator.scene.forcing_models import FORCING_MODELS, Forcing

numbers = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 1e3)
angular = st.floats(1e-2, 1e2)


def force(signal: str, **keys: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({"signal": st.just(signal), "amplitude": numbers, **keys})


@st.composite
def tables(draw: st.DrawFn) -> dict[str, Any]:
    steps = draw(st.lists(positive, min_size=1, max_size=5))
    times = np.cumsum([draw(numbers), *steps]).tolist()
    values = draw(st.lists(numbers, min_size=len(times), max_size=len(times)))
    table = {"signal": "table", "times": times, "values": values}
    return table | {"interpolation": draw(st.sampled_from(["linear", "cubic"]))}


@st.composite
def pulses(draw: st.DrawFn) -> dict[str, Any]:
    shape = draw(st.sampled_from(["half_sine", "triangle", "trapezoid"]))
    pulse = draw(force("pulse", duration=positive, start=numbers)) | {"shape": shape}
    return pulse | ({"rise": draw(st.floats(0.0, 0.5)) * pulse["duration"]} if shape == "trapezoid" else {})


sines = force("sine", angular_frequency=angular, phase=numbers)
constants = force("constant")
chirps = force(
    "chirp",
    angular_frequency=angular,
    end_angular_frequency=angular,
    duration=positive,
    spacing=st.sampled_from(["linear", "logarithmic"]),
)
random = force(
    "random", band=st.floats(0.0, 5.0).map(lambda low: [low, low + 5.0]), seed=st.integers(0, 10**9)
)
some_forces = st.lists(sines | constants | chirps | pulses() | tables() | random, min_size=1, max_size=8)


def scene_of(forces: list[dict[str, Any]]) -> Scene:
    has_sine = any(each["signal"] == "sine" for each in forces)
    record = {"recorded_periods": 3} if has_sine else {"recorded_time": 3.0}
    return Scene.from_dict({"body": {"mass": 2.0, "stiffness": 3.0}, "forcing": forces, "record": record})


@given(some_forces)
@settings(max_examples=60)
def test_a_scene_of_forces_reads_itself_again(forces: list[dict[str, Any]]) -> None:
    scene = scene_of(forces)
    again = Scene.from_text(scene.to_toml())
    assert again.forces == scene.forces
    assert (again.clock, again.body) == (scene.clock, scene.body)
    assert float_parameters(again, None) == float_parameters(scene, None)
    assert integer_parameters(again) == integer_parameters(scene)


@given(some_forces, st.data())
@settings(max_examples=25)
def test_each_number_of_a_force_has_a_key_to_sweep_and_to_set(
    forces: list[dict[str, Any]], data: st.DataObject
) -> None:
    scene = scene_of(forces)
    keys = [key for key, _ in scene.numbers() if key.startswith("forcing")]
    assert len([key for key in keys if key.endswith(".amplitude")]) == len(forces)
    key = data.draw(st.sampled_from(keys))
    value = int(scene.value(key)) if key.endswith(".seed") else scene.value(key)
    swept = scene.with_sweep({key: [value]})
    assert [axis.key for axis in swept.sweep] == [key]
    assert swept.at({key: value}).value(key) == value
    assert scene.with_values({key: value}).value(key) == value
    first = key.replace("forcing[1].", "forcing.")
    assert scene.with_sweep({first: [value]}).sweep == swept.sweep


junk = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("ab"), inner, max_size=2),
    max_leaves=4,
)
KEYS = sorted(
    {
        key
        for model in FORCING_MODELS.values()
        for key in (field.alias or name for name, field in model.model_fields.items())
    }
)
spoilt = st.builds(
    lambda whole, other: whole | other, st.one_of(sines, constants, chirps, pulses(), tables(), random),
    st.dictionaries(st.sampled_from(KEYS), junk.filter(lambda value: value is not None), max_size=3),
)  # fmt: skip


@given(st.lists(spoilt | junk.filter(lambda value: value is not None), max_size=4))
@settings(max_examples=150)
def test_anything_else_is_a_list_of_problems(forces: list[Any]) -> None:
    try:
        Scene.from_dict(
            {"body": {"mass": 2.0, "stiffness": 3.0}, "forcing": forces, "record": {"recorded_time": 3.0}}
        )
    except SceneError as refused:
        for line in str(refused).splitlines():
            assert line.startswith("scene: "), line


@given(
    st.floats(1e-3, 1e3),
    st.lists(st.fractions(min_value="1/64", max_value=64, max_denominator=64), min_size=1, max_size=3),
)
def test_sines_of_whole_ratios_have_a_common_period(first: float, ratios: list[Any]) -> None:
    forces = [
        Forcing(amplitude=1.0, angular_frequency=w) for w in (first, *(first * float(r) for r in ratios))
    ]
    clock = clock_of(forces)
    assert isinstance(clock, Clock)
    periods = int(np.lcm.reduce([ratio.denominator for ratio in ratios]))
    assert clock.is_common == (periods <= MOST_PERIODS)
    if clock.is_common:
        assert clock.periods == periods
        assert clock.angular_frequency == pytest.approx(first / periods, rel=1e-15)
        turns = [force.angular_frequency / clock.angular_frequency for force in forces]
        assert turns == pytest.approx(np.round(turns), rel=1e-14)
