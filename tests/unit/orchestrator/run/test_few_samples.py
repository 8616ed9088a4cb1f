"""Contacts with too few samples of their force: a message names the variable with the largest forces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import vibroimpact as vi

# a contact of a unit mass with this spring lasts pi / 100 s
SCENE: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 1.0, "angular_frequency": 0.9},
    "stop": [{"law": "kelvin_voigt", "position": 0.4, "stiffness": 1e4}],
    "record": {"transient_periods": 2, "recorded_periods": 3},
}


def message_of(rate: float, variables: list[str], **record: Any) -> tuple[str, Any]:
    series = {"time_series": {"rate": rate, "variables": variables}}
    run = vi.run(SCENE | {"record": SCENE["record"] | series | record}, progress=False)
    return str(run.message.values), run


@pytest.mark.parametrize("variable", ["contact_force", "contact_force[1]", "acceleration"])
def test_a_contact_of_few_samples_is_told_with_the_rate_that_would_do(variable: str) -> None:
    message, run = message_of(50.0, ["displacement", variable])
    count = run.sizes["impact"]
    shortest = float(run.impact_duration.min()) * 50.0
    assert message == (
        f"{count} of {count} contacts with fewer than 10 samples, the shortest has {shortest:.2g}: "
        "the time series misses their largest forces. impact_peak_force has them, and a rate of 320 would show them"
    )
    again, finer = message_of(320.0, ["displacement", variable])
    assert again == ""
    assert finer.impact_peak_force.values == pytest.approx(run.impact_peak_force.values, rel=1e-9)


def test_displacements_are_no_matter_of_contacts() -> None:
    assert message_of(50.0, ["displacement", "velocity"])[0] == ""


def test_without_recorded_impacts_it_is_told_as_well() -> None:
    message, run = message_of(50.0, ["contact_force"], impacts=False)
    assert "impact" not in run.dims
    assert "impact_peak_force of recorded impacts has them" in message


def test_an_impact_on_a_rigid_stop_has_no_largest_force() -> None:
    run = vi.run(
        SCENE | {"stop": [{"position": -0.3, "side": "lower", "restitution": 0.7}, SCENE["stop"][0]]},
        progress=False,
    )
    rigid = run.impact_contact.values == 1
    assert rigid.any()
    assert np.isnan(run.impact_peak_force.values[rigid]).all()


def test_the_loop_over_points_has_the_largest_forces_of_single_runs() -> None:
    positions = [0.3, 0.35, 0.4, 0.45]
    sweep = {"sweep": {"stop[1].position": {"values": positions}}}
    together = vi.run(SCENE | sweep | {"execution": {"how": "fused"}}, progress=False)
    for place, position in enumerate(positions):
        stop = SCENE["stop"][0] | {"position": position}
        alone = vi.run(SCENE | {"stop": [stop]}, progress=False)
        hits = together.vibroimpact.impacts(run_id=place)
        assert np.array_equal(hits.impact_peak_force.values, alone.impact_peak_force.values, equal_nan=True)
        assert np.isfinite(alone.impact_peak_force.values[:-1]).all()
