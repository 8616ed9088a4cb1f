"""Index sums of random oscillators: all fixed points of the strobe map over one period add up to 1."""

from __future__ import annotations

import random
from typing import Any

from vibroimpact.analysis.orbits.index_sum import index_sum, why_without_sum
from vibroimpact.orchestrator.orbits.self_check.strobe_map import StrobeMap
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE = 500, 2
SECONDS = 60.0
FREQUENCY = "forcing.angular_frequency"


def check(seed: int) -> str | None:
    """Return the fault of the index sum of the oscillator of this seed; None without one."""
    tables = oscillator(random.Random(seed))
    value = tables["forcing"]["angular_frequency"]
    with StrobeMap(Scene.from_dict(tables), FREQUENCY) as strobe:
        body = strobe.body(value)
        if reason := why_without_sum(body):
            return f"{tables}: {reason}"
        found, rests = list(strobe.orbits(value, 1)), strobe.rests(value, 1)
        resting = [len(each) for each in rests]
        total = index_sum(body, found, 1, resting)
        if not total.is_complete:
            located = strobe.located(value, 1, found, rests)
            total = index_sum(body, [*found, *located.orbits], 1, resting, located.terms)
    return None if total.is_complete else f"{tables}: the indices are {total}"


def oscillator(draw: random.Random) -> dict[str, Any]:
    """Return a damped oscillator with one stop or two, also under a constant load or pressed on its stop."""
    position = draw.choice((-0.3, 0.0, 0.1, 0.5, 1.0))
    stops = [{"position": position, "restitution": draw.choice((0.0, draw.uniform(0.2, 0.95)))}]
    if draw.random() < 0.5:
        lower = position - draw.uniform(0.1, 2.0)
        stops.append({"position": lower, "side": "lower", "restitution": draw.uniform(0.2, 0.95)})
    start = min(position, 0.0) if len(stops) == 1 else 0.5 * (position + stops[1]["position"])
    forcing = {"amplitude": draw.uniform(0.1, 2.0), "angular_frequency": draw.uniform(0.3, 4.0)}
    return {
        "scene": {"units": "nondimensional"},
        "body": {
            "mass": 1.0,
            "stiffness": 1.0,
            "damping_ratio": draw.choice((0.01, 0.05, 0.3, 1.0, 1.5)),
            "displacement_start": start,
        },
        "forcing": forcing | {"phase": draw.uniform(0.0, 6.0)},
        "stop": stops,
        "record": {"recorded_periods": 8},
    }
