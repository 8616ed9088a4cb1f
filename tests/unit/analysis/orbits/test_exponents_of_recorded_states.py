"""Exponents where a filter finds the state from the contacts: several modes on yielding stops, growing modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.orbits.yielding_stops.exponents import RecordedStretching
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.runs import ImpactsOf

Floats = np.ndarray[Any, np.dtype[np.float64]]
KELVIN_VOIGT = {"law": "kelvin_voigt", "stiffness": 2000.0, "damping": 2.0, "position": 0.0}
HERTZ = {"law": "hertz", "stiffness": 200.0, "position": 0.1}
RIGID = {"restitution": 0.7, "position": 0.0}


def chain(
    stop: dict[str, Any], rate: float, amplitude: float, damping: float, **record: Any
) -> dict[str, Any]:
    return {
        "scene": {"units": "nondimensional"},
        "body": {
            **{"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0]},
            "dampings": [damping, damping],
        },
        "forcing": {"amplitude": [amplitude, 0.0], "angular_frequency": rate},
        "stop": [stop],
        "record": {"transient_periods": 100, "recorded_periods": 260, "impacts": True} | record,
    }


def self_excited(row: list[float], **record: float) -> dict[str, Any]:
    link, mass, feeding, damping, restitution, above, below = row
    return {
        "scene": {"units": "nondimensional"},
        "body": [
            {"name": "a", "mass": 1.0, "stiffness": 1.0, "damping": feeding, "displacement_start": 0.1},
            {"name": "b", "mass": mass, "stiffness": 0.0},
        ],
        "link": [{"between": ["a", "b"], "stiffness": link, "damping": damping}],
        "stop": [
            {"at": "a", "position": above, "restitution": restitution},
            {"at": "b", "position": below, "restitution": restitution, "side": "lower"},
        ],
        "record": {"transient_time": 2000.0, "recorded_time": 2000.0, "impacts": True} | record,
    }


def exponents_by_differences(given: dict[str, Any], periods: int) -> tuple[Floats, Floats]:
    """Return exponents per forcing period, and their standard errors, from differences of runs of the engine."""
    flow = BodyFlow(vi.Scene.from_dict(given), workers=1)
    size, step = len(flow.names), 1e-6
    state, directions = flow.follow(np.zeros((1, size)), 100).states[0], np.eye(size)
    logarithms = []
    for _ in range(periods):
        moved = step * directions.T
        ends = flow.follow(np.vstack([state + moved, state - moved, state]), 1).states
        directions, upper = np.linalg.qr((ends[:size] - ends[size:-1]).T / (2.0 * step))
        logarithms.append(np.log(np.abs(np.diag(upper))))
        state = ends[-1]
    flow.close()
    blocks = np.array([each.mean(axis=0) for each in np.array_split(logarithms[10:], 20)])
    return blocks.mean(axis=0), blocks.std(axis=0, ddof=1) / np.sqrt(20)


def test_exponents_of_a_chaotic_chain_on_a_yielding_stop_are_those_of_differences_of_runs() -> None:
    given = chain(KELVIN_VOIGT, 0.7, 1.0, 0.02, recorded_periods=500)
    found = vi.lyapunov(vi.run(given))
    turn = 2.0 * np.pi / 0.7 / float(found.impact_interval)  # impacts in a period
    expected, error = exponents_by_differences(given, 110)
    both = np.hypot(error, turn * found.standard_error.values)
    assert (np.abs(turn * found.lyapunov_exponent.values - expected) < 4.0 * both).all()
    assert float(found.lyapunov_exponent[0]) > 0.25
    assert float(found.sum_error) < 1e-12


@pytest.mark.parametrize(
    "given",
    [chain(HERTZ, 0.9, 0.5, 0.1, recorded_periods=290), chain(RIGID, 1.7, 1.0, 0.0)],
    ids=["hertz", "undamped modes"],
)
def test_the_filter_gives_the_multipliers_of_an_orbit(given: dict[str, Any]) -> None:
    found = vi.lyapunov(vi.run(given))
    assert int(found.impacts) > 200
    stable = [orbit for orbit in vi.find_orbits(given) if orbit.is_stable]
    expected = [np.log(np.abs(each.multipliers)) / each.phases.size for each in stable]
    # a part of a round stays at both ends of the run
    assert min(np.abs(found.lyapunov_exponent.values - each).max() for each in expected) < 5e-3


def test_a_known_state_predicts_all_later_contacts() -> None:
    given = chain(HERTZ, 0.9, 0.5, 0.1, transient_periods=0, recorded_periods=60)
    runs = vi.run(given)
    body = impacting_body(vi.Scene.from_dict(given), all_kinds=True)
    carried = RecordedStretching(body, ImpactsOf(runs)[int(runs.run_id)])
    assert carried.first_known < 20  # four numbers of the state, two a contact
    assert carried.errors[40:].max() < 1e-8


def test_a_stop_that_is_pressed_again_before_it_is_left_shows_that_its_force_is_0() -> None:
    soft = {"law": "kelvin_voigt", "stiffness": 72.7, "damping": 3.86, "position": 0.22}
    given = chain(soft, 1.11, 1.0, 0.05, transient_periods=0, recorded_periods=160)
    given["body"] |= {"masses": [1.0, 0.38], "stiffnesses": [1.0, 6.4]}
    runs = vi.run(given)
    impacts = ImpactsOf(runs)[int(runs.run_id)]
    again = np.flatnonzero(impacts.velocities == 0.0)
    carried = RecordedStretching(impacting_body(vi.Scene.from_dict(given), all_kinds=True), impacts)
    assert again.size > 100
    assert carried.first_known < 20
    assert carried.errors[again[20:]].max() < 1e-8
    assert carried.errors[again[20:-1] + 1].max() < 1e-8
    found = vi.lyapunov(runs)
    assert float(found.lyapunov_exponent[0]) < 0.0
    assert float(found.sum_error) < 1e-12


PERIODIC = [3.62140715, 1.71961587, -0.14810117, 0.15804645, 0.73834468, 0.34256190, -0.68891728]
CHAOTIC = [2.35779117, 0.63224359, -0.23535542, 0.20882912, 0.74210261, 0.62467705, -0.45532199]


def test_chaos_without_a_force_has_exponents_across_the_motion() -> None:
    found = vi.lyapunov(vi.run(self_excited(CHAOTIC)))
    values = found.lyapunov_exponent.values
    assert float(found.sum_error) < 1e-11
    assert 0.10 < values[0] < 0.18
    assert (values[1:3] < 0.0).all()
    assert np.isnan(values[3])  # the exponent 0 of the motion itself
    trace = CHAOTIC[2] + CHAOTIC[3] * (1.0 + 1.0 / CHAOTIC[1])
    expected = 2.0 * np.log(CHAOTIC[4]) - trace * float(found.impact_interval)
    # the flow's direction keeps its length but for a bounded part
    assert np.nansum(values) == pytest.approx(expected, abs=0.01)


def test_the_filter_finds_the_growing_modes_of_a_body_without_a_force() -> None:
    given = self_excited(PERIODIC)
    runs = vi.run(given)
    (recorded,) = [ImpactsOf(runs)[int(runs.run_id)]]
    timeless = recorded._replace(phases=np.zeros(recorded.times.size))
    carried = RecordedStretching(impacting_body(vi.Scene.from_dict(given), all_kinds=True), timeless)
    found = vi.lyapunov(runs)
    count = int(found.impacts)  # impacts of its orbit
    rounds = (recorded.times.size - 100) // count
    mean = carried.logarithms[-rounds * count :].mean(axis=0)
    np.testing.assert_allclose(np.sort(mean)[::-1], found.lyapunov_exponent.values[:3], atol=2e-3)
