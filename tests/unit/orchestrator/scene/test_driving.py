"""The highest frequency that drives a scene, from its document: signals, moving stops, swept numbers, any content."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.orchestrator.scene.driving import highest_drive

CONTENT: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
KEYS = (
    *("signal", "frequency", "angular_frequency", "band", "density", "duration", "rise"),
    *("motion_angular_frequency", "start", "stop", "values", "mean", "deviation", "forcing.band[2]"),
    *("forcing[2].frequency", "stop[1].motion_angular_frequency"),
)
ROW = st.dictionaries(st.sampled_from(KEYS), CONTENT | st.sampled_from(["pulse", "random", 3.0, [1.0]]))


@pytest.mark.parametrize(
    ("forcing", "highest"),
    [
        ({"amplitude": 1.0, "frequency": 2.0}, 4.0 * math.pi),
        ([{"angular_frequency": 2.0}, {"angular_frequency": 5}, {"signal": "constant"}], 5.0),
        ({"kind": "base_acceleration", "angular_frequency": 7.0}, 7.0),
        ({"signal": "chirp", "angular_frequency": 9.0, "end_angular_frequency": 1.0}, 9.0),
        ({"signal": "pulse", "shape": "half_sine", "duration": 0.5}, 4.0 * math.pi),
        ({"signal": "pulse", "shape": "trapezoid", "duration": 0.5, "rise": 0.1}, 10.0 * math.pi),
        ({"signal": "random", "band": [1.0, 6.0]}, 6.0),
        ({"signal": "random", "density": [[1.0, 0.1], [8.0, 0.2]]}, 8.0),
        ({"signal": "table", "times": [0.0, 1e-6], "values": [0.0, 1.0]}, 0.0),
        ({"angular_frequency": "fast"}, 0.0),
        (None, 0.0),
    ],
)
def test_a_signal_drives_up_to_its_highest_frequency(forcing: Any, highest: float) -> None:
    stops = [{"position": 1.0}, {"motion_angular_frequency": 3.0, "motion_amplitude": 0.1}]
    assert highest_drive({"forcing": forcing}) == pytest.approx(highest)
    assert highest_drive({"forcing": forcing, "stop": stops}) == pytest.approx(max(highest, 3.0))


@pytest.mark.parametrize(
    ("key", "axis", "highest"),
    [
        ("forcing.angular_frequency", {"start": 9.0, "stop": 1.0, "points": 5}, 9.0),
        ("forcing[1].frequency", {"values": [1.0, 2.0, 1.5]}, 4.0 * math.pi),
        ("forcing[2].band[2]", {"distribution": "uniform", "low": 5.0, "high": 8.0}, 8.0),
        (
            "forcing[2].band[2]",
            {"distribution": "normal", "mean": 8.0, "deviation": 0.5, "low": 7.0, "high": 9.0},
            10.0,
        ),
        ("forcing[3].duration", {"values": [1.0, 0.25]}, 8.0 * math.pi),
        ("stop[1].motion_angular_frequency", {"start": 1.0, "stop": 30.0}, 30.0),
        ("forcing[1].amplitude", {"values": [900.0]}, 3.0),
    ],
)
def test_the_ends_of_a_swept_number_count(key: str, axis: dict[str, Any], highest: float) -> None:
    forces = [
        {"amplitude": 1.0, "angular_frequency": 2.0},
        {"signal": "random", "band": [1.0, 3.0]},
        {"signal": "pulse", "duration": 3.0},
    ]
    document = {"forcing": forces, "stop": [{"motion_amplitude": 1.0}], "sweep": {key: axis}}
    assert highest_drive(document) == pytest.approx(highest)


@given(st.fixed_dictionaries({key: CONTENT | ROW | st.lists(ROW) for key in ("forcing", "stop", "sweep")}))
def test_a_document_of_any_content_has_a_finite_frequency(document: dict[str, Any]) -> None:
    found = highest_drive(document)
    assert found >= 0.0
    assert math.isfinite(found * found)
