"""Branches of random oscillators, chains and beams: stability changes for a cause, and one mode has the sums 1."""

from __future__ import annotations

import random
from typing import Any

from soak import index_sums
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.following import STABILITY_CHANGE
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE = 500, 1
SECONDS = 120.0
WIDTH = 0.06
"""Width of the followed range over the frequency."""
YIELDING = 0.3
"""Share of the scenes whose restitution falls with speed."""


def check(seed: int) -> str | None:
    """Return a change of stability without a cause, or orbits that are missing, of the scene of this seed."""
    draw = random.Random(seed)
    tables = draw.choice((index_sums.oscillator, _chain, _beam))(draw)
    if draw.random() < YIELDING:
        for stop in tables["stop"]:
            stop["yield_velocity"] = draw.uniform(0.05, 0.8)
    frequency = tables["forcing"]["angular_frequency"]
    ends = (1.0 - 0.5 * WIDTH) * frequency, (1.0 + 0.5 * WIDTH) * frequency
    study = Following(
        Scene.from_dict(tables), index_sums.FREQUENCY, *ends, step=0.05, doublings=0, grazes=0, starts=16
    )
    try:
        followed = whole(study).followed
    except OrbitError:
        return None  # no orbit with impacts there, which the error says
    for branch in followed.branches:
        for point in branch.points:
            if point.kind == STABILITY_CHANGE:
                return f"{tables}: {branch.full_name} changes its stability at {point.at.value:.12g}"
    if tables["body"].get("modes", 1) > 1 or tables["body"].get("kind") == "chain" or followed.check is None:
        return None
    missing = [" and ".join(map(str, each.sums)) for each in followed.check.incomplete]
    return f"{tables}: {'; '.join(missing)}" if missing else None


def _chain(draw: random.Random) -> dict[str, Any]:
    """Return a chain with a stop, or two equal ones, at its last mass."""
    masses = draw.choice((2, 3))
    position, restitution = draw.uniform(0.05, 0.6), draw.uniform(0.3, 0.95)
    stops: list[dict[str, Any]] = [{"position": position, "restitution": restitution, "mass": masses}]
    if draw.random() < 0.4:
        stops.append({**stops[0], "side": "lower", "position": -position})
    return {
        "scene": {"units": "nondimensional"},
        "body": {
            "kind": "chain",
            "masses": [draw.uniform(0.5, 2.0) for _ in range(masses)],
            "stiffnesses": [draw.uniform(0.5, 2.0) for _ in range(masses)],
            "dampings": draw.uniform(0.03, 0.3),
        },
        "forcing": {
            "amplitude": [draw.uniform(0.2, 1.0), *[0.0] * (masses - 1)],
            "angular_frequency": draw.uniform(0.4, 2.0),
        },
        "stop": stops,
        "record": {"recorded_periods": 8},
    }


def _beam(draw: random.Random) -> dict[str, Any]:
    """Return a clamped beam with a stop at its end."""
    stop = {"position": -draw.uniform(0.02, 0.3), "side": "lower", "location": 1.0}
    return {
        "body": {
            "kind": "beam",
            "length": 0.3,
            "flexural_rigidity": 0.05,
            "mass_per_length": 0.105,
            "modes": draw.choice((1, 2, 4)),
            "damping_ratio": draw.uniform(0.02, 0.15),
        },
        "forcing": {
            "amplitude": draw.uniform(0.1, 0.6),
            "angular_frequency": draw.uniform(18.0, 50.0),
            "location": 1.0,
        },
        "stop": [{**stop, "restitution": draw.uniform(0.3, 0.95)}],
        "record": {"recorded_periods": 8},
    }
