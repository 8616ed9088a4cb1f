"""Followed orbits against runs of the FMUs: on both sides of bifurcations, along P(2,2), on yielding stops."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.analysis.study import whole
from vibroimpact.fmus.core.modes import chain_modes
from vibroimpact.orchestrator.orbits.branches import Followed
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.study.ways.equal_restitution import laws_of_equal_restitution

FREQUENCY = "forcing.angular_frequency"
LONG = {
    # beside a doubling a motion leaves its orbit by 0.4 % in two periods, and starts up to 1e-7 from it
    "transient_periods": 16_000,
    "recorded_periods": 256,  # near a fold, chaos stays close to the lost orbit for some tens of periods
    "impacts": True,
    "extrema": True,
    "strobe": True,
}
CHAIN = EXAMPLES / "thesis" / "figure_6_13.toml"
OSCILLATOR = EXAMPLES / "bifurcation.toml"
BESIDE = 2e-4
"""Distance from a bifurcation, rad/s: multipliers there leave or come back within ten thousand periods."""


def scene(path: Path, **changes: Any) -> vi.Scene:
    plain = vi.Scene.from_text(path.read_text(encoding="utf-8"), str(path)).with_sweep({})
    return plain.with_values({key.replace("__", "."): value for key, value in changes.items()})


@pytest.fixture(scope="module")
def chain() -> Followed:
    """Return the branches of the chain of the thesis."""
    return whole(Following(scene(CHAIN), FREQUENCY, 0.3, 2.2, doublings=2, impacts=1, grazes=0)).followed


def run_from(orbit: PeriodicOrbit, frequency: float) -> tuple[str, Any]:
    """Run the chain from a start next to an orbit, at a nearby frequency; return the final class and the speeds."""
    shapes = chain_modes([1.0, 1.0], [1.0, 1.0, 0.0], [0.1, 0.1, 0.0]).shapes
    displacements, velocities = shapes @ orbit.states[0][:2], shapes @ orbit.states[0][2:]
    start = {
        "record": LONG,
        FREQUENCY: frequency,
        "forcing.phase": float(orbit.phases[0]),
        "body.displacement_start": [float(displacements[0]), min(float(displacements[1]), 0.1)],
        "body.velocity_start": [float(velocities[0]), float(velocities[1]) - 1e-7],
    }
    run = vi.run(scene(CHAIN).with_values(start))
    return vi.classify(run)[0].name, run.impact_velocity.values


@pytest.mark.parametrize(
    ("orbit", "kind", "at", "below", "above"),
    [
        ("P(1,1)", "graze between impacts", 0.85643437, "P(3,2)", "P(1,1)"),
        ("P(1,1)", "period doubling", 1.6130454, "P(1,1)", "P(2,2)"),
        ("P(1,1)", "graze", 1.9871673, "P(1,2)", "no impacts"),
        ("P(2,2)", "period doubling", 1.6818211, "P(2,2)", "P(4,4)"),
        ("P(2,2)", "fold", 1.7294421, "P(8,8)", "P(4,4)"),
        ("P(4,4)", "torus", 1.7247392, "P(4,4)", "chaos"),
        ("P(4,4)", "period doubling", 1.7163430, "chaos", "P(4,4)"),
        ("P(4,4)", "fold", 1.7048575, "P(4,4)", "chaos"),
    ],
)
def test_a_long_run_on_either_side_shows_what_the_branch_says(
    chain: Followed, orbit: str, kind: str, at: float, below: str, above: str
) -> None:
    branch, point = next(
        (branch, point)
        for branch in chain.branches
        for point in branch.points
        if (branch.name, point.kind) == (orbit, kind) and abs(point.at.value - at) < 1e-6
    )
    assert point.at.value == pytest.approx(at, abs=6e-8)
    for side, expected in ((-1.0, below), (1.0, above)):
        there = [each for each in branch.orbits if side * (each.value - point.at.value) > 0.0]
        frequency = point.at.value + side * BESIDE
        nearest = min(there, key=lambda each: abs(each.value - frequency), default=point.at)
        name, speeds = run_from(nearest.orbit, frequency)
        assert name == expected
        if name == branch.name and there and nearest.orbit.is_stable:
            assert np.sort(speeds)[-1] == pytest.approx(nearest.orbit.velocities.max(), abs=5e-3)


def test_a_branch_of_two_impacts_is_where_long_runs_end(chain: Followed) -> None:
    branch = next(branch for branch in chain.branches if branch.name == "P(2,2)")
    stable = [each for each in branch.orbits if each.orbit.is_stable and 1.63 < each.value < 1.67]
    for each in stable[:: max(1, len(stable) // 4)]:
        _, speeds = run_from(each.orbit, each.value)
        assert np.sort(speeds[-2:]) == pytest.approx(np.sort(each.orbit.velocities), rel=1e-10)


def test_a_chain_of_one_mass_has_the_points_of_the_oscillator() -> None:
    text = (
        '[scene]\nunits = "nondimensional"\n[body]\nkind = "chain"\nmasses = [1]\nstiffnesses = [1]\ndampings = [0.1]\n'
        "[forcing]\namplitude = [0.5]\nangular_frequency = 1.0\n"
        "[[stop]]\nposition = 1.0\nrestitution = 0.7\n[record]\nrecorded_periods = 2\n"
    )
    study = Following(
        vi.Scene.from_text(text), FREQUENCY, 0.6, 1.6, doublings=0, impacts=1, grazes=0, step=0.05
    )
    followed = whole(study).followed
    found = sorted(point.at.value for branch in followed.branches for point in branch.points)
    expected = [0.7106873690939, 0.9364931207, 1.2185743569476, 1.5166110861]
    assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("frequency", [1.0, 1.1, 1.2])
def test_orbits_on_a_stiff_stop_come_to_the_followed_one_as_the_contact_shortens(frequency: float) -> None:
    # a Kelvin-Voigt stop of the same restitution: the difference is proportional to the time of contact
    of = scene(OSCILLATOR, forcing__angular_frequency=frequency)
    orbit = next(each for each in vi.find_orbits(of, 1, 1) if each.is_stable)
    speed = float(orbit.velocities[0])
    away = []
    for duration in (2e-3, 1e-3, 5e-4):
        law = laws_of_equal_restitution(0.7, 1.0, speed, duration)["Kelvin-Voigt"]
        record = {"transient_periods": 1200, "recorded_periods": 1, "impacts": True}
        run = vi.run(of.with_values({"stop": [{"position": 1.0, **law}], "record": record}))
        away.append((run.impact_velocity.values[-1] - speed, run.impact_phase.values[-1] - orbit.phases[0]))
    ratios = np.array(away[:-1]) / np.array(away[1:])
    assert ratios == pytest.approx(2.0, abs=5e-3)
    # extrapolated to a contact of no duration, the speed is the orbit's
    assert 2.0 * np.array(away[2]) - np.array(away[1]) == pytest.approx(0.0, abs=1e-6)
