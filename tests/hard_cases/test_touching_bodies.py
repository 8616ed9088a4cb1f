"""Bodies that touch without load pass an impact on from contact to contact, as with small clearances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import vibroimpact as vi

QUARTER = 0.5 * np.pi
STILL = 1e-14
"""Approach of a contact, for an impact of speed 1, up to which it takes no part in the sequence."""

Row = NDArray[np.float64]


def row(masses: list[float], restitution: float, clearance: float = 0.0, **changes: Any) -> vi.Scene:
    """Return a row of bodies on pendulums of 1 rad/s; the first arrives at speed 1 after a quarter period."""
    bodies = [
        {"name": f"b{i}", "mass": mass, "stiffness": mass, "displacement_start": -1.0 if i == 0 else 0.0}
        for i, mass in enumerate(masses)
    ]
    contacts = [
        {"between": [f"b{i}", f"b{i + 1}"], "restitution": restitution, "clearance": clearance}
        for i in range(len(masses) - 1)
    ]
    return vi.Scene.from_dict(
        {"body": bodies, "contact": contacts, "record": {"recorded_time": QUARTER + 1.0}} | changes
    )


def velocities(scene: vi.Scene, run: xr.Dataset) -> Row:
    """Return the velocities of the bodies at the lowest point, 1 s before the end, if they did not meet since."""
    q, p = run.final_state.values.reshape(2, -1)
    shapes = scene.body.assembly.shapes
    return np.asarray(np.cos(1.0) * (shapes @ p) + np.sin(1.0) * (shapes @ q))


def sequence(masses: list[float], restitution: float) -> tuple[Row, list[int], list[float]]:
    """Return velocities after binary impacts, fastest first, and the contact (from 1) and speed of each impact."""
    v = np.array([1.0] + [0.0] * (len(masses) - 1))
    contacts, speeds = [], []
    while (closing := v[:-1] - v[1:]).max() > STILL:
        i = int(closing.argmax())
        impulse = (1.0 + restitution) * closing[i] / (1.0 / masses[i] + 1.0 / masses[i + 1])
        contacts.append(i + 1)
        speeds.append(float(closing[i]))
        v[i] -= impulse / masses[i]
        v[i + 1] += impulse / masses[i + 1]
    return v, contacts, speeds


@pytest.mark.parametrize("count", [3, 5])
def test_an_elastic_cradle_hands_the_motion_to_its_last_ball(count: int) -> None:
    turns = 6
    scene = row([0.1] * count, 1.0, record={"recorded_time": turns * np.pi})
    run = vi.run(scene)
    out = list(range(1, count))
    assert run.impact_contact.values.tolist() == [
        k for i in range(turns) for k in (out if i % 2 == 0 else out[::-1])
    ]
    assert run.impact_velocity.values == pytest.approx(1.0, abs=1e-13)
    times = np.repeat(QUARTER + np.pi * np.arange(turns), count - 1)
    assert run.impact_time.values == pytest.approx(times, abs=1e-13)
    q, p = run.final_state.values.reshape(2, -1)
    assert p @ p + q @ q == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize(("count", "restitution"), [(3, 1.0), (3, 0.9), (5, 1.0), (5, 0.9)])
def test_touching_balls_move_as_the_limit_of_small_clearances(count: int, restitution: float) -> None:
    """Times and velocities of a cradle with clearances differ from the limit in proportion to the clearance."""
    masses = [0.1] * count
    scene = row(masses, restitution)
    run = vi.run(scene)
    v, contacts, speeds = sequence(masses, restitution)
    assert run.impact_contact.values.tolist() == contacts
    assert run.impact_velocity.values == pytest.approx(speeds, abs=1e-13)
    assert velocities(scene, run) == pytest.approx(v, abs=1e-13)
    for clearance in (1e-6, 1e-9):
        near = row(masses, restitution, clearance)
        apart = vi.run(near)
        slowest = min(speeds)
        assert sorted(apart.impact_contact.values.tolist()) == sorted(contacts)
        assert apart.impact_time.values == pytest.approx(QUARTER, abs=5.0 * clearance / slowest)
        assert velocities(near, apart) == pytest.approx(v, abs=5.0 * clearance / slowest + 1e-13)


def test_two_balls_that_arrive_together_set_two_balls_going() -> None:
    scene = row([0.1] * 5, 1.0)
    scene = scene.with_values({"body[2].displacement_start": -1.0})
    run = vi.run(scene)
    assert velocities(scene, run) == pytest.approx([0.0, 0.0, 0.0, 1.0, 1.0], abs=1e-13)


def test_a_plastic_impact_moves_all_touching_balls_as_one() -> None:
    scene = row([1.0, 2.0, 3.0, 2.0], 0.0)
    assert velocities(scene, vi.run(scene)) == pytest.approx(0.125, abs=1e-13)


def test_a_light_ball_between_heavy_ones_takes_more_impacts_than_an_event_has_rounds() -> None:
    masses = [1.0, 1e-4, 1.0]
    scene = row(masses, 1.0)
    run = vi.run(scene)
    v, contacts, _ = sequence(masses, 1.0)
    assert len(contacts) > 200
    assert run.impact_contact.values.tolist() == contacts
    assert velocities(scene, run) == pytest.approx(v, abs=1e-10)


def test_an_endless_sequence_is_an_error_that_names_its_contacts() -> None:
    message = str(vi.run(row([1.0, 1e-10, 1.0], 1.0)).message.values)
    assert (
        "contact[1], contact[2]: expected a motion that goes on, got 1000 events at 1.57079632679" in message
    )


@pytest.mark.parametrize("load", [0.0, 1e-3])
def test_a_ball_that_is_pressed_takes_part_at_once(load: float) -> None:
    """The second and third ball rest on each other: with a load they meet the first as one, without as a row."""
    run = vi.run(
        row([1.0, 1.0, 1.0], 1.0, forcing={"at": "b2", "amplitude": -load, "angular_frequency": 0.0})
    )
    assert run.impact_contact.values[0] == 1
    assert (2 in run.impact_contact.values[:2].tolist()) == (load == 0.0)


@settings(max_examples=15)
@given(
    masses=st.lists(st.floats(0.2, 5.0), min_size=3, max_size=6),
    restitution=st.one_of(st.just(1.0), st.just(0.0), st.floats(0.3, 1.0)),
)
def test_random_rows_follow_the_sequence_and_balance_their_energy(
    masses: list[float], restitution: float
) -> None:
    scene = row(masses, restitution)
    run = vi.run(scene)
    v, _, _ = sequence(masses, restitution)
    assert velocities(scene, run) == pytest.approx(v, abs=1e-10)
    m = np.array(masses)
    assert m @ velocities(scene, run) == pytest.approx(m[0], rel=1e-12)
    pairs = {k + 1: m[k] * m[k + 1] / (m[k] + m[k + 1]) for k in range(len(m) - 1)}
    reduced = np.array([pairs[int(k)] for k in run.impact_contact.values])
    lost = 0.5 * (1.0 - restitution**2) * reduced @ run.impact_velocity.values**2
    q, p = run.final_state.values.reshape(2, -1)
    if restitution > 0.0:
        assert 0.5 * (p @ p + q @ q) + lost == pytest.approx(0.5 * m[0], rel=1e-10)


def test_a_row_with_forces_of_unlike_sizes_goes_on() -> None:
    """Seven bodies with stops at one place: forces of 0.1 N and of 1e-17 N decide at one instant, after 26.5 s."""
    masses = [6.691310059954052, 4.2825960119971, 0.2245490599131724, 0.11393032658242408]
    masses += [1.7012581665586313, 2.3500871561213788, 2.7731711941435315]
    speeds = [
        0.0,
        -1.2459109472530652,
        1.0425133694426776,
        0.0,
        0.0,
        -0.15922500991447772,
        -0.12961363369296769,
    ]
    bodies = [
        {"name": f"b{i}", "mass": mass, "stiffness": 0.0, "velocity_start": speed}
        for i, (mass, speed) in enumerate(zip(masses, speeds, strict=True))
    ]
    bodies[0]["stiffness"] = 6.60552479805031
    restitutions = [0.35779519670907023, 0.32186939107594215, 0.33791122550713326]
    restitutions += [0.8902743520047923, 0.6231871446860424, 0.0]
    contacts = [
        {"between": [f"b{i}", f"b{i + 1}"], "restitution": restitution, "clearance": 0.0}
        for i, restitution in enumerate(restitutions)
    ]
    of_stops = {"b2": 0.8764842308107038, "b3": 0.3361170605456604}
    of_stops |= {"b4": 0.450339366649287, "b6": 0.05202130106440961}
    scene = vi.Scene.from_dict(
        {
            "body": bodies,
            "contact": contacts,
            "stop": [{"at": at, "position": 0.0, "restitution": each} for at, each in of_stops.items()],
            "link": [{"between": ["b6", "b3"], "stiffness": 10.374917068196309, "damping": 0.1}],
            "forcing": {
                "at": "b4",
                "amplitude": 1.4923917463750624,
                "angular_frequency": 0.9991417509051704,
            },
            "record": {"recorded_periods": 5, "impacts": False},
        }
    )
    assert int(vi.run(scene).outcome) == 0


@pytest.mark.parametrize(
    ("masses", "restitutions", "below", "loads"),
    [
        ([1.07, 1.91, 0.37], [0.92, 0.5], [0.048, 0.084], [1.0, 1.11, -2.0]),
        ([1.32, 1.72, 1.23], [0.47, 0.85], [0.056, 0.056], [1.0, 1.63, -2.0]),
        ([0.66, 1.71, 0.34], [0.78, 0.42], [0.045, 0.031], [1.0, 1.76, -2.0]),
    ],
)
def test_two_balls_that_chatter_against_one_plate_come_to_rest(
    masses: list[float], restitutions: list[float], below: list[float], loads: list[float]
) -> None:
    """Each impact of one ball throws the other off, however low both bounce: rounding must not raise them again."""
    heights = [0.3 - below[0], 0.3 - below[1], 0.3]
    bodies = [
        {"name": name, "mass": mass, "stiffness": 1.0, "displacement_start": height}
        for name, mass, height in zip("abc", masses, heights, strict=True)
    ]
    contacts = [
        {"between": [name, "c"], "clearance": clearance, "restitution": restitution}
        for name, clearance, restitution in zip("ab", (1e-9, 0.0), restitutions, strict=True)
    ]
    forces = [
        {"signal": "constant", "at": name, "amplitude": load} for name, load in zip("abc", loads, strict=True)
    ]
    record = {"recorded_time": 4.0}
    scene = vi.Scene.from_dict({"body": bodies, "contact": contacts, "forcing": forces, "record": record})
    run = vi.run(scene)
    assert (run.impact_velocity.values < 1e-8).sum() < 100
    assert np.isnan(run.stick_end.values[-2:]).all()
    ball, other, plate = scene.body.assembly.shapes @ run.final_state.values.reshape(2, -1)[1]
    assert [ball, other] == pytest.approx([plate, plate], abs=1e-13)
