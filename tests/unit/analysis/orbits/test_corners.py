"""Branches whose impacts pass the yield velocity, above which restitution falls with speed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits.follow import Following

FREQUENCY = "forcing.angular_frequency"


def oscillator(*stops: dict[str, Any], frequency: float = 1.0, damping: float = 0.05) -> vi.Scene:
    return vi.Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": damping},
            "forcing": {"amplitude": 0.5, "angular_frequency": frequency},
            "stop": list(stops),
            "record": {"recorded_periods": 8},
        }
    )


def branches(scene: vi.Scene, parameter: str, low: float, high: float, **options: Any) -> list[Branch]:
    return whole(Following(scene, parameter, low, high, impacts=1, grazes=0, **options)).followed.branches


def test_a_corner_over_the_yield_velocity_is_at_the_velocity_of_a_constant_restitution() -> None:
    stop = {"position": 0.8, "restitution": 0.8}
    (constant,) = vi.find_orbits(oscillator(stop), 1)
    yields = oscillator({**stop, "yield_velocity": 0.7})
    (branch,) = branches(yields, "stop[1].yield_velocity", 0.5, 1.2, step=0.1)
    (point,) = branch.points
    assert point.kind == AT_YIELD_VELOCITY
    assert point.at.value == pytest.approx(constant.velocities[0], rel=1e-12)
    sides = [branch.orbits[point.place + k].orbit for k in (0, 1)]
    by_side = {bool(each.falling[0]): each for each in sides}
    assert set(by_side) == {False, True}
    np.testing.assert_allclose(by_side[False].multipliers, constant.multipliers, rtol=1e-7)
    # r (r + r' V) is 3/4 r^2 above the yield velocity
    assert by_side[True].determinant == pytest.approx(0.75 * constant.determinant, rel=1e-6)


def test_a_multiplier_that_jumps_across_minus_1_begins_orbits_with_an_impact_on_either_side() -> None:
    stop = {"position": 1.0, "restitution": 0.7}
    (orbit,) = vi.find_orbits(oscillator(stop, frequency=0.93), 1)
    speed = float(orbit.velocities[0])
    yields = oscillator({**stop, "yield_velocity": speed}, frequency=0.93)
    single, double = branches(yields, FREQUENCY, 0.92, 0.94, step=0.05)
    (point,) = single.points
    assert point.kind == AT_YIELD_VELOCITY
    assert point.at.value == pytest.approx(0.93, abs=1e-12)
    assert (
        point.at.orbit.multipliers[0].real < -1.0 < single.orbits[point.place + 1].orbit.multipliers[0].real
    )
    assert double.name == "P(2,2)"
    assert "impact at the yield velocity of P(1,1)" in double.ends
    assert double.origin == "P(1,1) at its impact at the yield velocity 0.93"
    nearest = max(double.orbits, key=lambda each: each.value)
    assert sorted(nearest.orbit.falling) == [False, True]
    assert nearest.value == pytest.approx(0.93, abs=2e-4)
    assert all(each.orbit.is_stable for each in double.orbits)
    (_, reached) = vi.find_orbits(yields.with_values({FREQUENCY: 0.9245}))
    assert reached.name == "P(2,2)"


def test_changes_of_stability_at_either_of_two_yield_velocities_have_a_name() -> None:
    stops = (
        {"position": 0.95, "restitution": 0.62, "yield_velocity": 0.14},
        {"position": -0.95, "side": "lower", "restitution": 0.62, "yield_velocity": 0.18},
    )
    found = branches(oscillator(*stops, damping=0.19), FREQUENCY, 0.75, 0.85, step=0.1, doublings=0)
    points = [point for branch in found for point in branch.points]
    assert "stability change" not in {point.kind for point in points}
    corners = [point.at.orbit for point in points if point.kind == AT_YIELD_VELOCITY]
    assert len(corners) == 2
    for orbit in corners:
        levels = np.array([each.yield_velocity for each in orbit.body.contacts])[orbit.contacts]
        assert np.abs(orbit.velocities / levels - 1.0).min() < 2e-9


def test_a_branch_over_another_number_of_the_scene_has_the_same_corner_from_both_ends() -> None:
    scene = oscillator({"position": 0.8, "restitution": 0.8, "yield_velocity": 0.8})
    wide, narrow = (
        branches(scene, "forcing.amplitude", *ends, step=step)[0].points[0].at
        for ends, step in (((0.4, 0.6), 0.2), ((0.46, 0.5), 0.01))
    )
    assert wide.value == pytest.approx(narrow.value, rel=1e-11)
    assert replace(wide, tangent=-wide.tangent).turned.value == wide.value
