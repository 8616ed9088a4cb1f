"""A session steps a scene: what goes in comes out as the exact motion."""

from __future__ import annotations

import numpy as np
import pytest
from support.tolerance import PARTITION

from vibroimpact.fmus.core import Oscillator, flow
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.scene import parse_scene

FREE = "[body]\nmass = 2\nstiffness = 800\ndamping = 1.6\n[record]\nrecorded_time = 1\n"
STOPPED = FREE + "[[stop]]\nposition = 0.01\nrestitution = 0.5\n"


@pytest.mark.parametrize("execution", ["fused", "coupled"])
def test_a_session_follows_the_exact_flow_under_a_sloping_force(execution: str) -> None:
    # reference: fmus.core.flow with the same held acceleration and slope
    oscillator, state = Oscillator(2.0, 1.6, 800.0), (0.0, 0.0)
    with Session(
        parse_scene(FREE, "free.toml"), ["displacement", "velocity"], execution=execution
    ) as session:
        session.begin()
        for step, (value, slope) in enumerate([(3.0, 100.0), (5.0, -400.0), (-1.0, 0.0)]):
            found = session.advance(0.02, {"force": (value, slope)})
            state = flow(oscillator, state, 0.02, held=value / 2.0, held_rate=slope / 2.0)
            assert session.time == pytest.approx(0.02 * (step + 1), abs=1e-15)
            assert found["displacement"] == pytest.approx(state[0], abs=PARTITION)
            assert found["velocity"] == pytest.approx(state[1], abs=PARTITION)


def test_following_many_instants_is_stepping_through_them() -> None:
    times = np.linspace(0.0, 0.4, 81)
    values = 30.0 * np.sin(23.0 * times)
    with Session(parse_scene(STOPPED, "stop.toml"), ["displacement"]) as session:
        session.begin()
        rows = session.follow(times, "force", values)[:, 0]
        impacts = session.impacts()
        session.begin()
        slopes = np.diff(values) / np.diff(times)
        stepped = [
            session.advance(times[i + 1] - times[i], {"force": (values[i], slopes[i])})["displacement"]
            for i in range(80)
        ]
    assert len(impacts) > 2
    np.testing.assert_allclose(rows[1:], stepped, atol=PARTITION)


def test_an_input_that_is_left_out_keeps_its_value_without_slope() -> None:
    with Session(parse_scene(FREE, "free.toml"), ["displacement"]) as session:
        session.begin()
        session.advance(0.01, {"force": (4.0, 0.0)})
        kept = session.advance(0.02)
        session.begin()
        again = session.advance(0.03, {"force": (4.0, 0.0)})
    assert kept["displacement"] == pytest.approx(again["displacement"], abs=PARTITION)


def test_an_input_that_the_body_does_not_have_is_one_clear_error() -> None:
    with Session(parse_scene(FREE, "free.toml")) as session:
        session.begin()
        with pytest.raises(
            UsageError, match=r"torque: expected an input of the body \(force, base_acceleration\)"
        ):
            session.advance(0.1, {"torque": (1.0, 0.0)})
