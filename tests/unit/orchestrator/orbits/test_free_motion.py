"""States from which no stop can be met, against runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.free_motion import FreeMotion
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines

CHAIN = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": [1.0, 2.0], "dampings": [0.1, 0.02]}


def scene(body: dict[str, Any], stop: dict[str, Any], force: Any, periods: int = 60) -> vi.Scene:
    record = {"transient_periods": 0, "recorded_periods": periods, "impacts": True}
    tables = {"scene": {"units": "nondimensional"}, "body": body, "forcing": force, "stop": [stop]}
    return vi.Scene.from_dict({**tables, "record": record})


numbers = st.floats(-1.0, 1.0)


@given(numbers, numbers, st.floats(0.0, 2.0), st.floats(0.2, 3.0), st.floats(0.1, 1.2))
@settings(max_examples=25)
def test_an_oscillator_that_can_meet_no_stop_meets_none(
    x: float, v: float, ratio: float, frequency: float, position: float
) -> None:
    body = {
        "mass": 1.0,
        "stiffness": 1.0,
        "damping_ratio": ratio,
        "displacement_start": min(x, position - 0.01),
    }
    given_scene = scene(
        {**body, "velocity_start": v},
        {"position": position, "restitution": 0.7},
        {"amplitude": 0.3, "angular_frequency": frequency},
    )
    free = FreeMotion.of(given_scene, impacting_body(given_scene), FurtherSines.of(given_scene))
    state = np.array([[body["displacement_start"], v]])
    if free is not None and free.stays_free(state)[0]:
        assert int(vi.run(given_scene).impact_count) == 0


def test_the_steady_state_of_a_chain_is_that_of_a_long_run() -> None:
    stop = {"mass": 2, "position": 5.0, "restitution": 0.7}
    force = [
        {"amplitude": [0.2, 0.1], "angular_frequency": 0.9},
        {"signal": "constant", "amplitude": [0.1, 0.0]},
    ]
    given_scene = scene(CHAIN, stop, force)
    free = FreeMotion.of(given_scene, impacting_body(given_scene), FurtherSines.of(given_scene))
    assert free is not None
    flow = BodyFlow(given_scene, workers=1)
    try:
        later = flow.follow(np.zeros((1, 4)), 4000).states[0]
    finally:
        flow.close()
    assert later == pytest.approx(free.state, rel=1e-9)
    assert free.stays_free(free.state[None])[0]
    assert not free.stays_free(free.state[None] + 100.0)[0]


def test_a_steady_motion_that_reaches_the_stop_is_no_free_motion() -> None:
    body = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
    force = {"amplitude": 1.0, "angular_frequency": 1.0}
    hits = scene(body, {"position": 1.0, "restitution": 0.7}, force)
    assert FreeMotion.of(hits, impacting_body(hits), FurtherSines.of(hits)) is None
    undamped = scene(
        {**body, "damping_ratio": 0.0},
        {"position": 9.0, "restitution": 0.7},
        {**force, "angular_frequency": 2.0},
    )
    assert FreeMotion.of(undamped, impacting_body(undamped), FurtherSines.of(undamped)) is None
