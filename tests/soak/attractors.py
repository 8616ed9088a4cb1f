"""Basins and branches of random oscillators against brute-force runs: mirrored stops, light damping, two attractors.

`basins`: each start is run by itself for thousands of periods, and ends on the attractor of its cell. `follow`: each
change of stability along a branch has a named cause, or the result says that no cause was found. Runs that start close
to an orbit stay or leave as its multipliers predict.
"""

from __future__ import annotations

import random
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.attractors.basins import Basins
from vibroimpact.analysis.orbits.branch import Branch, BranchOrbit
from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY
from vibroimpact.analysis.orbits.following import STABILITY_CHANGE
from vibroimpact.analysis.study import whole
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.orbits.basins import BasinsOfScene
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.planes import Plane
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE = 200, 1
SECONDS = 300.0

POINTS = 12
"""Starts of a plane along each axis."""
RUNS = 40
"""Starts that are run one by one."""
SHIFTS = np.array([[0.0, 0.0], [-1e-9, 0.0], [-1e-10, 1e-9], [-1e-9, -1e-9]])
"""Shifts of a start, over the size of the motion; a run that ends elsewhere after a shift is decided by rounding."""
FAR = 4.0
"""Standard deviations of a count above which a share is wrong."""
PERIODS = 4000
"""Forcing periods of each such run before its end is judged."""
NEAR = 1e-3
"""Distance from an attractor at phase 0, over the size of the motion, below which a run is on it."""
MISSED = 2
"""Most starts out of RUNS that may end elsewhere: all shifts agree by chance, or a sample was labelled chaos."""
FREQUENCY = "forcing.angular_frequency"
WEAK = 0.02
"""Distance of the largest multiplier from 1 below which a run of this length shows neither decay nor growth."""
NUDGE = 1e-7
"""Change of velocity of a run that starts close to an orbit, m/s."""

Tables = dict[str, Any]
Floats = NDArray[np.float64]


def check(seed: int) -> str | None:
    """Return the fault of the basins or branches of the oscillator of this seed; None without one."""
    draw = random.Random(seed)
    tables = oscillator(draw)
    problem = _basins(draw, tables) if draw.random() < 0.5 else _branches(draw, tables)
    return None if problem is None else f"{tables}: {problem}"


def oscillator(draw: random.Random) -> Tables:
    """Return a lightly damped oscillator of unit mass, mostly between two stops that mirror each other."""
    restitution, position = draw.uniform(0.5, 0.95), draw.choice((0.1, 0.5, 1.0))
    stops = [{"position": position, "restitution": restitution}]
    if draw.random() < 0.8:
        stops.append({"position": -position, "side": "lower", "restitution": restitution})
    return {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": draw.choice((0.005, 0.02, 0.05))},
        "forcing": {"amplitude": draw.uniform(0.2, 2.0), "angular_frequency": draw.uniform(0.5, 3.5)},
        "stop": stops,
        "record": {"recorded_periods": 8},
    }


# ---- basins ----


def _basins(draw: random.Random, tables: Tables) -> str | None:
    scene = Scene.from_dict(tables)
    position = tables["stop"][0]["position"]
    low = -position if len(tables["stop"]) == 2 else -4.0 * position
    speed = 3.0 * position * max(1.0, tables["forcing"]["angular_frequency"])
    plane = Plane((0.999 * low, 0.999 * position), (-speed, speed), (POINTS, POINTS))
    study = whole(BasinsOfScene(scene, plane))
    alone, found = study.scene, study.known
    if not np.isclose(found.fractions.sum(), found.decided):
        return f"basins: shares add up to {found.fractions.sum()}, {found.decided} are decided"
    runner = PointRunner(
        alone.with_values({"record": {"recorded_periods": 64, "transient_periods": PERIODS}})
    )
    try:
        return _wrong_cells(draw, runner, found)
    finally:
        runner.close()


def _wrong_cells(draw: random.Random, runner: PointRunner, found: Basins) -> str | None:
    """Run some starts one by one; return starts that do not end where their cells say, and wrong shares."""
    wrong, of_chaos = [], 0
    cells, runs = np.zeros(len(found.attractors)), np.zeros(len(found.attractors))
    for place in draw.sample(range(found.labels.size), RUNS):
        label, start = int(found.labels[place]), found.starts[place]
        if label < 0:
            continue
        ends = [_end(runner, found, start + shift * found.scale) for shift in SHIFTS]
        if found.attractors[label].is_chaotic:
            of_chaos += ends[0] is not None
        elif ends[0] is not None:
            cells[label] += 1
            runs[ends[0]] += 1
        # rounding decides a start whose shifted runs end differently: such starts enter only the comparison of shares
        if not found.attractors[label].is_chaotic and ends == [ends[0]] * len(ends) and ends[0] != label:
            wrong.append(f"{start.tolist()}: {found.names[label]}, its runs end on {ends[0]}")
    room = FAR * np.sqrt(0.5 * (cells + runs)) + 1.0
    problems = wrong if len(wrong) > MISSED else []
    if of_chaos > MISSED + RUNS * found.undetected_share_below:
        problems.append(f"{of_chaos} starts of chaos end on an orbit")
    if (np.abs(cells - runs) > room).any():
        problems.append(f"{runs.tolist()} runs on each, {cells.tolist()} cells")
    return f"basins: {found.names}: {'; '.join(problems)}" if problems else None


def _end(runner: PointRunner, found: Basins, start: Floats) -> int | None:
    """Return the periodic attractor that a run from a start ends on; None where it ends on no such attractor."""
    record = runner.run({}, (float(start[0]), float(start[1])))
    return next((number for number in range(len(found.attractors)) if _is_on(record, found, number)), None)


def _is_on(record: RunRecord, found: Basins, number: int) -> bool:
    """Whether the end of a run is on a periodic attractor."""
    attractor = found.attractors[number]
    if attractor.is_chaotic or record.periods is None:
        return False
    strobes = record.periods[-max(8, len(attractor.states)) :, 2:4]
    apart = np.abs(strobes[:, None] - attractor.states[None]) / found.scale
    return bool((apart.max(axis=2).min(axis=1) <= NEAR).all())


# ---- branches ----


class _NearbyRun(NamedTuple):
    """Impact speeds of a run that starts close to an orbit, and whether the run stays on it."""

    speeds: Floats
    stays: bool


def _branches(draw: random.Random, tables: Tables) -> str | None:
    scene = Scene.from_dict(tables)
    frequency = tables["forcing"]["angular_frequency"]
    ends = 0.85 * frequency, 1.15 * frequency
    try:
        if draw.random() < 0.4:
            study = Following(scene, FREQUENCY, *ends, impacts=1, doublings=0, grazes=0)
        else:
            # the orbit on which the scene's own run ends; it mostly hits both stops
            run = vi.run(scene.with_values({"record": {"transient_periods": 3000, "recorded_periods": 64}}))
            seed = vi.seed_of_run(run)
            study = Following(
                scene, FREQUENCY, *ends, len(seed.impacts), seed.periods, seed.impacts, doublings=0, grazes=0
            )
        branches = whole(study).followed.branches
    except (OrbitError, DatasetError):
        return None  # no orbit there, which the error says
    for branch in branches:
        problem = _unnamed_change(branch) or _unlike_its_runs(draw, scene, branch)
        if problem is not None:
            return f"follow: {branch.full_name}: {problem}"
    return None


def _unnamed_change(branch: Branch) -> str | None:
    """Return the first change of stability without a point that names its cause, or points of unknown kinds."""
    places = {place for point in branch.points for place in _places(branch, point.at)}
    stable = [each.orbit.is_stable for each in branch.orbits]
    for k in range(1, len(stable)):
        if stable[k] != stable[k - 1] and not {k, k - 1} & places:
            between = f"{branch.orbits[k - 1].value:.12g} and {branch.orbits[k].value:.12g}"
            return f"its stability changes between {between}, which no point says"
    kinds = {
        "fold",
        "period doubling",
        "torus",
        "graze",
        "graze between impacts",
        AT_YIELD_VELOCITY,
        BRANCH_POINT,
        STABILITY_CHANGE,
    }
    strange = {point.kind for point in branch.points} - kinds
    return f"points of unknown kinds {strange}" if strange else None


def _places(branch: Branch, at: BranchOrbit) -> list[int]:
    return [k for k, each in enumerate(branch.orbits) if each is at or each.value == at.value]


def _unlike_its_runs(draw: random.Random, scene: Scene, branch: Branch) -> str | None:
    """Return the first orbit of a branch that a nearby run keeps or leaves against its multipliers."""
    for each in draw.sample(branch.orbits, min(3, len(branch.orbits))):
        largest = float(np.abs(each.orbit.multipliers).max())
        # a nearby graze throws runs off stable orbits, too
        slow = each.orbit.velocities.min() < 1e-3
        touches = each.orbit.highest[0] > -1e-3 * each.orbit.body.scale
        if abs(largest - 1.0) < WEAK or slow or touches:
            continue
        nearby = _run_nearby(scene, each)
        if nearby.stays != (largest < 1.0):
            word = "stays" if nearby.stays else "leaves"
            return (
                f"multipliers {each.orbit.multipliers.tolist()} at {each.value:.12g}, and a run beside it {word}: "
                f"{nearby.speeds.tolist()} for {each.orbit.velocities.tolist()}"
            )
    return None


def _run_nearby(scene: Scene, each: BranchOrbit) -> _NearbyRun:
    """Run from just after the first impact of an orbit, a little slower or faster."""
    orbit = each.orbit
    stop = scene.stops[int(orbit.contacts[0])]
    changed = scene.with_values(
        {
            FREQUENCY: each.value,
            "forcing.phase": float(orbit.phases[0]) % (2.0 * np.pi),
            "body.displacement_start": stop.position,
            "body.velocity_start": float(orbit.states[0][1]) + (NUDGE if stop.side == "lower" else -NUDGE),
            "record": {"transient_periods": PERIODS, "recorded_periods": 2 * orbit.periods},
        }
    )
    runner = PointRunner(changed)
    try:
        impacts = runner.run({}).impacts
    finally:
        runner.close()
    assert impacts is not None
    speeds = impacts[:, 2]
    expected = np.sort(np.tile(orbit.velocities, 2))
    stays = len(speeds) == len(expected) and np.allclose(np.sort(speeds), expected, rtol=1e-4, atol=1e-6)
    return _NearbyRun(speeds, bool(stays))
