"""Orbits, branches and exponents of scenes whose stops yield, beside runs: equations.md 4.18."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits import OrbitError, find_orbit
from vibroimpact.analysis.orbits.yielding_stops.joint_search import near_orbit
from vibroimpact.analysis.orbits.yielding_stops.motion import yielding_motion
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body

ONE = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
CHAIN = {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0], "dampings": [0.1, 0.1]}
KELVIN_VOIGT = {"law": "kelvin_voigt", "stiffness": 50.0, "damping": 1.0}
HERTZ = {"law": "hertz", "stiffness": 200.0}
HUNT_CROSSLEY = {"law": "hunt_crossley", "stiffness": 200.0, "damping": 0.3}
MOVED = KELVIN_VOIGT | {"motion_amplitude": 0.05, "motion_angular_frequency": 1.2}


def scene(*stops: dict[str, Any], body: dict[str, Any] = ONE, **more: Any) -> dict[str, Any]:
    amplitude = [0.5, 0.0] if body is CHAIN else 0.5
    return {
        "scene": {"units": "nondimensional"},
        "body": body,
        "forcing": {"amplitude": amplitude, "angular_frequency": 1.2} | more,
        "stop": list(stops),
        "record": {"transient_periods": 300, "recorded_periods": 6, "impacts": True, "strobe": True},
        "execution": {"contact_tolerance": 1e-13},
    }


@pytest.mark.parametrize(
    ("given", "error"),
    [
        (scene(KELVIN_VOIGT | {"position": 0.5}), 1e-12),
        (scene(MOVED | {"position": 0.5}), 1e-12),
        (scene(KELVIN_VOIGT | {"position": 0.2, "mass": 2}, body=CHAIN), 1e-12),
        (scene(HERTZ | {"position": 0.5}), 1e-9),
        (scene(HUNT_CROSSLEY | {"position": 0.2, "mass": 2}, body=CHAIN), 1e-9),
        (
            scene(
                KELVIN_VOIGT | {"position": 0.8},
                {"restitution": 0.6, "position": -1.0, "side": "lower"},
            ),
            1e-11,
        ),
    ],
    ids=[
        "oscillator",
        "stop that moves",
        "chain",
        "hertz",
        "hunt_crossley of a chain",
        "beside a rigid stop",
    ],
)
def test_a_long_run_ends_on_the_orbit_with_its_speeds_impulses_and_durations(
    given: dict[str, Any], error: float
) -> None:
    run = vi.run(given).vibroimpact.impacts()
    stable = [orbit for orbit in vi.find_orbits(given) if orbit.is_stable]
    assert stable
    best = min(stable, key=lambda orbit: abs(run.impact_velocity.values[-1] - orbit.velocities).min())
    count = best.phases.size
    last = run.isel(impact=slice(-2 * count, -count))  # the very last contact may be open at the end
    order = np.argsort(np.mod(last.impact_phase.values, 2.0 * np.pi))
    own = np.argsort(np.mod(best.phases, 2.0 * np.pi))
    for name, values in (
        ("impact_velocity", best.velocities),
        ("impact_impulse", best.impulses),
        ("impact_duration", best.durations),
        ("impact_restitution", best.restitutions),
    ):
        np.testing.assert_allclose(last[name].values[order], values[own], rtol=100 * error, atol=error)


BALL = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 0.0, "displacement_start": 1.2, "velocity_start": 3.1},
    "forcing": {"signal": "constant", "amplitude": -1.0},
    "stop": [
        {
            **{"law": "kelvin_voigt", "stiffness": 1000.0, "damping": 10.0, "position": 0.0, "side": "lower"},
            **{"motion_amplitude": 1.2, "motion_angular_frequency": 1.0, "motion_phase": -1.05},
        }
    ],
    "record": {"transient_periods": 200, "recorded_periods": 4, "impacts": True},
}


def test_a_ball_without_a_spring_is_placed_by_the_table_that_yields() -> None:
    run = vi.run(BALL).vibroimpact.impacts()
    stable, unstable = vi.find_orbits(BALL, 1)
    assert (stable.stability, unstable.stability) == ("stable", "unstable")
    assert stable.velocities[0] == pytest.approx(float(run.impact_velocity[-1]), rel=1e-13)
    assert stable.determinant == pytest.approx(np.exp(-10.0 * stable.durations[0]), rel=1e-13)
    hard = BALL | {"stop": [{"law": "hertz", "stiffness": 1e4, "position": 0.0, "side": "lower"}]}
    hard["forcing"] = [BALL["forcing"], {"amplitude": 0.5, "angular_frequency": 1.0}]
    with pytest.raises(UsageError, match=r'law: expected "restitution" or "kelvin_voigt" beside bodies'):
        vi.find_orbits(hard)


def test_an_unstable_orbit_returns_to_itself_in_a_run() -> None:
    given = scene(KELVIN_VOIGT | {"position": 1.0}, angular_frequency=1.35)
    (orbit,) = (each for each in vi.find_orbits(given, 1) if not each.is_stable)
    x, v = orbit.at(np.array([2.0 * np.pi]))
    given["body"] = ONE | {"displacement_start": float(x[0]), "velocity_start": float(v[0])}
    given["record"] = {"transient_periods": 0, "recorded_periods": 1, "strobe": True}
    end = vi.run(given)
    assert float(end.final_displacement) == pytest.approx(float(x[0]), abs=1e-12)
    assert float(end.final_velocity) == pytest.approx(float(v[0]), abs=1e-12)


def test_exponents_of_a_periodic_run_are_its_multipliers_and_a_chaotic_run_keeps_the_sum_rule() -> None:
    given = scene(KELVIN_VOIGT | {"position": 0.5})
    (orbit,) = vi.find_orbits(given, 1)
    found = vi.lyapunov(vi.run(given))
    np.testing.assert_allclose(found.lyapunov_exponent, np.log(np.abs(orbit.multipliers)), atol=1e-10)
    chaotic = scene({"law": "kelvin_voigt", "stiffness": 400.0, "position": 1.0}, angular_frequency=0.74)
    chaotic["record"] |= {"transient_periods": 200, "recorded_periods": 300}
    run = vi.run(chaotic)
    found = vi.lyapunov(run)
    assert float(found.lyapunov_exponent[0]) == pytest.approx(0.36, abs=0.1)
    assert float(found.sum_error) < 1e-13
    assert vi.classify(run)[0].name == "chaos"


@pytest.mark.long
def test_a_stop_may_lose_its_whole_stiffness_along_a_branch() -> None:
    found = vi.follow(
        scene(KELVIN_VOIGT | {"position": 1.0}),
        "stop[1].stiffness",
        0.0,
        2.0,
        impacts=1,
        doublings=0,
        step=0.2,
    )
    # next to a stop without a force the contacts of other orbits overlap; the branch has all values
    assert found.stiffness.values.min() == pytest.approx(0.0, abs=1e-9)
    assert found.stiffness.values.max() == pytest.approx(2.0)


def test_a_period_doubling_separates_the_classes_of_runs() -> None:
    given = scene(KELVIN_VOIGT | {"position": 1.0}, angular_frequency=0.902)
    given["record"] = {"transient_periods": 4000, "recorded_periods": 40, "impacts": True, "strobe": True}
    near = vi.Scene.from_dict(given)
    (orbit,) = vi.find_orbits(near, 1)
    seed = [(float(orbit.phases[0]), 1)]
    branches = vi.follow(near, "forcing.angular_frequency", 0.9018, 0.9023, doublings=0, step=0.2, seed=seed)
    special = branches.where(branches.orbit_special == int(SpecialOrbit.period_doubling), drop=True)
    assert float(special.angular_frequency.values[0]) == pytest.approx(0.90210579988, abs=1e-10)
    assert vi.classify(vi.run(near.with_values({"forcing.angular_frequency": 0.9035})))[0].name == "P(1,1)"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            lambda given: vi.find_orbits(given),
            r"relaxation_time: expected 0: a surface that relaxes at once, got 0\.1",
        ),
        (lambda given: vi.maps(given, "discontinuity"), r'law: expected "restitution"'),
        (lambda given: vi.basins(given), r"relaxation_time: expected 0"),
        (lambda given: vi.control(given, 1.0, 0.9), r'law: expected "restitution"'),
    ],
    ids=["orbit", "maps", "basins", "control"],
)
def test_what_is_not_taken_is_refused_by_name(command: Any, said: str) -> None:
    relaxing = KELVIN_VOIGT | {"position": 0.5, "relaxation_time": 0.1}
    with pytest.raises(UsageError, match=said):
        command(scene(relaxing))


def test_a_rough_train_of_two_contacts_leads_to_an_orbit_by_one_search() -> None:
    given = vi.Scene.from_dict(scene(KELVIN_VOIGT | {"position": 0.0}, angular_frequency=0.6))
    body, hit = impacting_body(given, all_kinds=True), np.zeros(2, np.int32)
    found = []
    for phases in ([0.5, 3.5], [1.0, 4.0], [2.0, 5.5], [0.2, 1.7]):
        try:
            near = near_orbit(yielding_motion(body), hit, np.array(phases), 1)
        except OrbitError:
            continue
        orbit = find_orbit(body, near.phases, [0, 0], 1, start=near.start)
        found.append(np.sort(orbit.velocities))
    assert any(np.allclose(each, [0.647, 0.8483], atol=1e-4) for each in found)
