"""Impacts of `[[contact]]` are recorded in the order of their starts, each with its results."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.orchestrator.run.empty_record import MOST_CONTACTS

FASTER, SLOWER = "faster", "slower"


def flying(
    contact: dict[str, Any], speed: float = 2.0, masses: tuple[float, float] = (1.0, 3.0)
) -> dict[str, Any]:
    """Return a scene of two free bodies: the first hits the second from behind after half a second."""
    body = {"fmu": "Oscillator"}
    return {
        "scene": {"title": "Two bodies"},
        "component": {
            FASTER: body | {"parameters": {"mass": masses[0], "stiffness": 0.0, "velocity_start": speed}},
            SLOWER: body | {"parameters": {"mass": masses[1], "stiffness": 0.0}},
        },
        "contact": [{"between": [FASTER, SLOWER], "clearance": 0.5 * speed} | contact],
        "record": {"recorded_time": 2.0, "variables": [f"{FASTER}.velocity"], "rate": 20},
        "execution": {"macro_step": 0.1},
    }


def impacts_of(scene: dict[str, Any]) -> xr.Dataset:
    return vi.run(scene, progress=False).vibroimpact.impacts_table()


def test_the_impacts_of_a_cradle_go_from_ball_to_ball() -> None:
    table = impacts_of_cradle(5)
    assert table["impact_contact"].values.tolist() == [1, 2, 3, 4, 4, 3, 2, 1]
    assert table["impact_contact"].attrs["flag_meanings"].split()[1] == "ball2_contact_1_ball3_contact_1"
    speed = 0.1 * np.sqrt(9.81)
    assert table["impact_velocity"].values == pytest.approx([speed] * 8, rel=1e-9)
    assert table["impact_impulse"].values == pytest.approx([0.1 * speed] * 8, rel=1e-9)
    assert (table["impact_restitution"] == 1.0).all()
    assert (table["impact_duration"] == 0.0).all()


def impacts_of_cradle(balls: int, time: float = 2.0) -> xr.Dataset:
    """Return the impacts of a cradle whose first ball falls."""
    return impacts_of(cradle(balls, time))


def cradle(balls: int, time: float) -> dict[str, Any]:
    """Return the scene of a cradle whose first ball falls."""
    own = {"mass": 0.1, "stiffness": 0.981}
    components = {f"ball{n}": {"fmu": "Oscillator", "parameters": dict(own)} for n in range(1, balls + 1)}
    components["ball1"]["parameters"]["displacement_start"] = -0.1  # type: ignore[index]
    pairs = [{"between": [f"ball{n}", f"ball{n + 1}"], "restitution": 1.0} for n in range(1, balls)]
    return {
        "scene": {"title": "Cradle"},
        "component": components,
        "contact": pairs,
        "record": {"recorded_time": time, "variables": ["ball1.displacement"], "rate": 10},
        "execution": {"macro_step": 0.25},
    }


@given(
    masses=st.tuples(st.floats(0.1, 10.0), st.floats(0.1, 10.0)),
    restitution=st.floats(0.0, 1.0),
    speed=st.floats(0.1, 10.0),
)
@settings(max_examples=10, deadline=None)
def test_a_rigid_impact_has_the_impulse_of_its_restitution(
    masses: tuple[float, float], restitution: float, speed: float
) -> None:
    table = impacts_of(flying({"restitution": restitution}, speed, masses))
    reduced = 1.0 / (1.0 / masses[0] + 1.0 / masses[1])
    assert table["impact_time"].values == pytest.approx([0.5], rel=1e-9)
    assert table["impact_impulse"].values == pytest.approx([(1.0 + restitution) * reduced * speed], rel=1e-9)
    assert np.isnan(table["impact_peak_force"]).all()


def test_a_hertz_contact_has_the_force_and_the_duration_of_its_closed_form() -> None:
    stiffness, speed, reduced = 1e4, 2.0, 0.75
    table = impacts_of(flying({"law": "hertz", "stiffness": stiffness}, speed)).isel(impact=0)
    depth = (1.25 * reduced * speed**2 / stiffness) ** 0.4
    assert float(table["impact_impulse"]) == pytest.approx(2.0 * reduced * speed, rel=1e-9)
    assert float(table["impact_restitution"]) == pytest.approx(1.0, rel=1e-9)
    assert float(table["impact_peak_force"]) == pytest.approx(stiffness * depth**1.5, rel=3e-3)
    assert float(table["impact_duration"]) == pytest.approx(2.943275 * depth / speed, rel=3e-3)


def test_a_dashpot_takes_speed_from_a_contact() -> None:
    table = impacts_of(flying({"law": "kelvin_voigt", "stiffness": 1e4, "damping": 20.0}))
    assert float(table["impact_restitution"][0]) < 0.9
    assert float(table["impact_impulse"][0]) == pytest.approx(
        0.75 * 2.0 * (1.0 + float(table["impact_restitution"][0])), rel=1e-6
    )


def test_a_contact_that_is_open_at_the_end_has_no_impulse() -> None:
    scene = flying({"law": "hertz", "stiffness": 1.0})
    scene["record"]["recorded_time"] = 0.7
    table = impacts_of(scene).isel(impact=0)
    assert float(table["impact_velocity"]) == pytest.approx(2.0)
    assert np.isnan([table["impact_impulse"], table["impact_duration"], table["impact_peak_force"]]).all()


def test_impacts_before_a_recording_are_not_of_it() -> None:
    scene = cradle(3, 2.0)
    whole = impacts_of(scene)
    scene["record"] |= {"transient_time": 1.0, "recorded_time": 1.0}
    late = impacts_of(scene)
    assert whole["impact_contact"].values.tolist() == [1, 2, 2, 1]
    assert late["impact_contact"].values.tolist() == [2, 1]
    assert np.array_equal(late["impact_time"].values, whole["impact_time"].values[2:])


@pytest.mark.parametrize("contacts", [MOST_CONTACTS, MOST_CONTACTS + 1])
def test_what_cannot_be_numbered_is_not_there_and_said(contacts: int) -> None:
    runs = vi.run(cradle(contacts + 1, 1.0), progress=False)
    if contacts == MOST_CONTACTS:
        assert runs["impact_contact"].values.tolist() == list(range(1, contacts + 1))
    else:
        assert "impact_time" not in runs
        assert runs["message"].values.item() == "128 contacts: of more than 127 no impacts are kept"


def test_a_scene_that_records_no_impacts_has_none() -> None:
    scene = cradle(3, 1.0)
    scene["record"]["events"] = False
    assert not {"impact_time", "event_time"} & set(vi.run(scene, progress=False))


# ---- classes ----


def class_of(scene: dict[str, Any]) -> tuple[str, str]:
    (found,) = vi.classify(vi.run(scene, progress=False))
    return found.name, found.reason


def test_a_cradle_repeats_after_eight_impacts() -> None:
    assert class_of(cradle(5, 8.0)) == ("P(8,1)", "")


def test_free_bodies_have_no_class() -> None:
    assert class_of(flying({"restitution": 1.0}))[1] == "fewer than 6 recorded impacts"


def driven(**changes: Any) -> dict[str, Any]:
    """Return a scene of a driven body that hits a heavy body at rest."""
    own = {
        "mass": 1.0,
        "stiffness": 1.0,
        "damping": 0.1,
        "forcing.amplitude": 0.5,
        "forcing.angular_frequency": 0.8,
    }
    return {
        "scene": {"title": "Driven"},
        "component": {
            "a": {"fmu": "Oscillator", "parameters": own | changes},
            "b": {"fmu": "Oscillator", "parameters": {"mass": 1e9, "stiffness": 1e9}},
        },
        "contact": [{"between": ["a", "b"], "restitution": 0.8, "clearance": 0.8}],
        "record": {"transient_time": 800.0, "recorded_time": 160.0, "variables": ["a.velocity"], "rate": 1},
        "execution": {"macro_step": 1.0},
    }


@pytest.mark.parametrize("frequency", [0.8, 1.2])
def test_a_driven_body_has_the_class_of_the_fused_one(frequency: float) -> None:
    fused = {
        "scene": {"title": "Driven"},
        "body": {"kind": "oscillator", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        "forcing": {"kind": "force", "amplitude": 0.5, "angular_frequency": frequency},
        "stop": [{"law": "restitution", "position": 0.8, "side": "upper", "restitution": 0.8}],
        "record": {"transient_periods": 100, "recorded_periods": 20},
    }
    name, reason = class_of(driven(**{"forcing.angular_frequency": frequency}))
    assert (name, reason) == class_of(fused)
    assert name.startswith("P(")


def test_several_frequencies_are_no_class() -> None:
    scene = driven()
    scene["component"]["b"]["parameters"] |= {"forcing.amplitude": 0.1, "forcing.angular_frequency": 1.1}
    assert class_of(scene) == ("unknown", "several forcing frequencies")


def test_impacts_that_die_away_are_no_class() -> None:
    scene = cradle(2, 60.0)
    for each in scene["contact"]:
        each["restitution"] = 0.7
    assert class_of(scene) == ("unknown", "no forcing, and its impacts die away")
