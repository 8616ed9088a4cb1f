"""Basins of scenes whose stops yield: states at forcing phase 0 are complete, also those of a pressed stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow

KELVIN_VOIGT = {"law": "kelvin_voigt", "stiffness": 500.0, "damping": 1.0}
HERTZ = {"law": "hertz", "stiffness": 500.0}


def scene(stop: dict[str, Any]) -> vi.Scene:
    return vi.Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.02},
            "forcing": {"amplitude": 0.5, "angular_frequency": 2.6},
            "stop": [stop | {"position": 0.3}],
            "record": {"recorded_periods": 20},
        }
    )


@pytest.mark.parametrize("stop", [KELVIN_VOIGT, HERTZ], ids=["kelvin_voigt", "hertz"])
def test_a_run_that_is_cut_at_phase_0_goes_on_as_it_was_also_while_a_stop_is_pressed(
    stop: dict[str, Any],
) -> None:
    flow = BodyFlow(scene(stop | {"stiffness": 20.0}), workers=1)
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (200, 2))
    whole, half = flow.follow(states, 4).states, flow.follow(states, 2).states
    cut = flow.follow(half, 2).states
    flow.close()
    assert (states[:, 0] > 0.3).any()
    assert (half[:, 0] > 0.3).any()
    np.testing.assert_allclose(cut, whole, atol=1e-7 if stop is HERTZ else 1e-12)


def test_each_start_ends_where_its_long_run_ends_and_the_edge_has_a_saddle() -> None:
    given = scene(KELVIN_VOIGT)
    found = vi.basins(given, points=(8, 8), x=(-1.0, 0.5), y=(-1.0, 1.0), periods=3000, edges=True)
    assert [str(each) for each in found.attractor_name.values] == ["P(1,2)", "no impacts"]
    x, y = np.meshgrid(found.displacement_start, found.velocity_start)
    flow = BodyFlow(given, workers=1)
    ends = flow.follow(np.column_stack([x.ravel(), y.ravel()]), 600, first=True).states
    free = flow.free_state
    flow.close()
    hits = np.abs(ends - free).max(axis=1) > 1e-3
    np.testing.assert_array_equal(found.basin.values.ravel() == 0, hits)
    assert 0 < hits.sum() < hits.size
    assert {str(each) for each in found.edge_orbit.values} == {"P(1,2)"}
    assert float(found.edge_multiplier[0].max()) > 1.0


def test_control_and_discontinuity_sets_of_a_stop_that_yields_stay_refused() -> None:
    said = r'stop\[1\].law: expected "restitution"'
    with pytest.raises(UsageError, match=said):
        vi.control(scene(KELVIN_VOIGT), 2.5, 2.7)
    with pytest.raises(UsageError, match=said):
        vi.maps(scene(KELVIN_VOIGT), "discontinuity")


def test_maps_mark_the_orbit_of_a_stop_that_yields() -> None:
    given = scene(KELVIN_VOIGT).with_values({"forcing.angular_frequency": 1.2, "body.damping_ratio": 0.05})
    orbits = vi.find_orbits(given, 1, 1)
    found = vi.maps(given, "impact")
    assert len(orbits) >= 1
    np.testing.assert_allclose(
        found.orbit_velocity.values, [each.velocities[0] for each in orbits], rtol=1e-9
    )
