"""Orbits of scenes under several sines and constant forces: fixed points of runs, studies that take them or say not."""

from __future__ import annotations

from contextlib import closing
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.orbit_flow import state_at_phase_0

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.energies import orbit_energies
from vibroimpact.analysis.orbits.feedback import impact_map
from vibroimpact.analysis.orbits.normal_forms import one_mode
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.errors import UsageError, VibroimpactError
from vibroimpact.orchestrator.orbits import impacting_body
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.scene import Scene

Tables = dict[str, Any]
TWO: Tables = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "stop": [{"position": 0.5, "restitution": 0.7}],
    "forcing": [
        {"amplitude": 0.5, "angular_frequency": 0.8, "phase": 0.3},
        {"amplitude": 0.4, "angular_frequency": 1.2, "phase": 1.0},
        {"signal": "constant", "amplitude": 0.1},
    ],
    "record": {"transient_periods": 300, "recorded_periods": 10, "impacts": True},
}
"""Two sines with a common period of two periods of the first; runs end on P(3,2)."""


def scene(**changes: Any) -> Scene:
    return Scene.from_dict(deepcopy(TWO) | changes)


def test_orbit_finds_what_a_run_ends_on() -> None:
    (found,) = vi.find_orbits(scene())
    run = vi.run(scene())
    assert (found.name, found.is_stable) == ("P(3,2)", True)
    last = {
        round(float(phase), 6): float(v)
        for phase, v in zip(run.impact_phase, run.impact_velocity, strict=True)
    }
    expected = {
        round(float(phase % (2.0 * np.pi)), 6): v
        for phase, v in zip(found.phases, found.velocities, strict=True)
    }
    assert last.keys() == expected.keys()
    for phase, velocity in expected.items():
        assert last[phase] == pytest.approx(velocity, rel=1e-9)
    (kind,) = vi.classify(run)
    assert kind.name == "P(3,2)"


some = st.floats(0.2, 1.0)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Draw a chain of one to three masses under two or three sines, perhaps a constant force and a moving stop."""
    masses = draw(st.integers(1, 3))
    ratios = draw(st.lists(st.sampled_from([0.5, 1.5, 2.0, 3.0, 2.5]), min_size=1, max_size=2, unique=True))
    forces: list[Tables] = [
        {
            "amplitude": [draw(some)] * masses,
            "angular_frequency": 0.9 * ratio,
            "phase": draw(st.floats(-3.0, 3.0)),
        }
        for ratio in (1.0, *ratios)
    ]
    if draw(st.booleans()):
        forces.append({"signal": "constant", "amplitude": [draw(st.floats(-0.3, 0.3))] * masses})
    chain = {
        "kind": "chain",
        "masses": [draw(some) for _ in range(masses)],
        "stiffnesses": [draw(some) for _ in range(masses)],
        "dampings": [0.1 * draw(some) for _ in range(masses)],
    }
    stop: Tables = {"position": draw(st.floats(0.1, 0.8)), "restitution": draw(st.floats(0.3, 0.9))}
    if draw(st.booleans()):
        stop |= {"motion_amplitude": 0.2 * draw(some), "motion_phase": draw(st.floats(-3.0, 3.0))}
        stop |= {"motion_angular_frequency": 0.9 * draw(st.sampled_from([0.5, 1.0, 2.0]))}
    return scene(body=chain, stop=[stop], forcing=forces)


@settings(max_examples=8, derandomize=True, deadline=None)
@given(scenes())
def test_orbits_are_fixed_points_of_runs(drawn: Scene) -> None:
    body = impacting_body(drawn)
    found = [each for q in (1, 2) for each in orbits_of(body, 1, q)] + orbits_of(body, 2, 1, starts=16)
    for orbit in found:
        state = state_at_phase_0(orbit)
        record = {"transient_periods": 0, "recorded_periods": orbit.periods}
        with closing(PointRunner(drawn.with_values({"record": record}), execution="fused")) as runner:
            run = runner.run({}, tuple(state.tolist()))
        grown = max(1.0, float(np.abs(orbit.multipliers[0])))
        assert run.final_state is not None
        assert np.abs(run.final_state - state).max() <= 1e-10 * grown * (1.0 + np.abs(state).max())


@pytest.mark.parametrize("first", [True, False])
def test_basins_follow_states_in_lanes_and_one_by_one_alike(first: bool) -> None:
    states = np.array([[0.1, -0.4], [-0.3, 0.2], [0.4, 1.1]])
    ends = []
    for how in ("auto", "fused"):
        flow = BodyFlow(scene(execution={"how": how}), workers=1)
        with closing(flow):
            ends.append(flow.follow(states, 3, first=first))
    assert all(each.well.all() for each in ends)
    np.testing.assert_allclose(ends[0].states, ends[1].states, rtol=0.0, atol=1e-12)


def test_states_that_come_to_rest_in_lanes_are_followed_as_one_by_one() -> None:
    load = {"signal": "constant", "amplitude": 0.8}  # presses the body on its stop
    weak = TWO["forcing"][0] | {"amplitude": 0.01}
    states = np.array([[0.45, 0.3], [0.2, 0.1], [0.3, -0.4]])
    ends, classes = [], []
    for how in ("auto", "fused"):
        flow = BodyFlow(scene(forcing=[weak, load], execution={"how": how}), workers=1)
        with closing(flow):
            ends.append(flow.follow(states, 6))
            classes.append([each.name for each in flow.classes(states, 4)[0]])
    assert all(each.well.all() for each in ends)
    np.testing.assert_allclose(ends[0].states, ends[1].states, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ends[0].states, [[0.5, 0.0]] * 3, rtol=0.0, atol=1e-12)
    assert classes == [["rest"] * 3] * 2


def test_basins_take_a_moving_stop() -> None:
    stop = {"position": 0.5, "restitution": 0.7, "motion_amplitude": 0.1, "motion_angular_frequency": 0.8}
    found = vi.basins(scene(stop=[stop]), points=(3, 3))
    assert found.attractor_name.values.tolist() == ["P(1,1)"]
    beyond = found.displacement_start.values > 0.5 + 0.1  # of the stop at time 0
    np.testing.assert_array_equal(found.basin.values, np.broadcast_to(np.where(beyond, -2, 0), (3, 3)))


def ball(gamma: float) -> Scene:
    """Return a ball on a table that is shaken with an acceleration of gamma g; g = 1 and the frequency is 1."""
    table = {"position": 0.0, "side": "lower", "restitution": 0.5, "motion_amplitude": gamma}
    return Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 0.0, "displacement_start": 3.0},
            "forcing": [{"signal": "constant", "amplitude": -1.0}],
            "stop": [table | {"motion_angular_frequency": 1.0, "motion_phase": 0.3}],
            "record": {"transient_periods": 40, "recorded_periods": 4, "impacts": True},
        }
    )


def test_a_ball_on_a_shaken_table_has_its_known_orbits() -> None:
    stable, unstable = vi.find_orbits(ball(1.2))
    assert (stable.name, stable.is_stable, unstable.is_stable) == ("P(1,1)", True, False)
    np.testing.assert_allclose(
        [each.velocities[0] for each in (stable, unstable)], 4.0 * np.pi / 3.0, rtol=1e-14
    )
    with closing(PointRunner(ball(1.2), execution="fused")) as runner:
        impacts = runner.run({}, tuple(state_at_phase_0(stable).tolist())).impacts
    assert impacts is not None
    np.testing.assert_allclose(impacts[:, 2], stable.velocities[0], rtol=1e-12)
    found = vi.follow(ball(1.2), "stop[1].motion_amplitude", 1.2, 1.6, doublings=0, grazes=0)
    doubling = found.motion_amplitude.values[found.orbit_special.values == SpecialOrbit.period_doubling]
    np.testing.assert_allclose(doubling, 1.526823700519061, rtol=1e-12)


def test_follow_takes_the_amplitude_of_a_further_sine_and_refuses_its_frequency() -> None:
    (start,) = vi.find_orbits(scene(), 3, 2)
    seed = [(float(phase), 1) for phase in start.phases]
    found = vi.follow(
        scene(), "forcing[2].amplitude", 0.4, 0.402, periods=2, seed=seed, doublings=0, grazes=0
    )
    assert found.sizes["amplitude"] > 2
    with pytest.raises(
        VibroimpactError, match=r"forcing\[2\]\.angular_frequency: expected a number that the common"
    ):
        vi.follow(scene(), "forcing[2].angular_frequency", 1.2, 1.3)


def test_sines_without_a_common_period_are_refused_by_name() -> None:
    apart = scene(forcing=[{"amplitude": 0.5, "angular_frequency": w} for w in (0.8, 0.8 * np.sqrt(2.0))])
    with pytest.raises(
        VibroimpactError, match=r"forcing: expected sines with a common period, .* got sines without one"
    ):
        vi.find_orbits(apart)


def test_exponents_obey_the_sum_rule_under_several_sines() -> None:
    chaotic = scene(record={"transient_periods": 50, "recorded_periods": 200, "impacts": True})
    chaotic = chaotic.with_values({"forcing[2].amplitude": 0.9})
    found = vi.lyapunov(vi.run(chaotic))
    assert found.impacts > 300
    assert found.sum_error < 1e-12


def test_studies_of_one_sine_refuse_several_by_name() -> None:
    (orbit,) = vi.find_orbits(scene(), 3, 2)
    with pytest.raises(OrbitError, match="maps: expected one sine and stops that do not move"):
        one_mode(orbit.body)
    with pytest.raises(UsageError, match=r"energies: expected one sine and stops that do not move"):
        orbit_energies(orbit)
    once = PeriodicOrbit(orbit.body, 1, orbit.phases[:1], orbit.contacts[:1], orbit.velocities[:1])
    with pytest.raises(OrbitError, match="control: expected one sine and stops that do not move"):
        impact_map(once, 1.0)
