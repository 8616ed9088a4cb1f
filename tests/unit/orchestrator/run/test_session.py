"""A session steps a scene: its outputs are the exact motion under its inputs."""

from __future__ import annotations

import numpy as np
import pytest
from support.tolerance import PARTITION

from vibroimpact.fmus.core import Oscillator, flow
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.run.session import Floats
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


YIELDING = "[[stop]]\nposition = 0.01\nlaw = 'kelvin_voigt'\nstiffness = 1e5\ndamping = 20\n"


def square_wave(samples: int) -> Floats:
    return np.where(np.arange(samples) // 150 % 2, -6.0, 6.0)


@pytest.mark.parametrize("scene", [STOPPED, FREE + YIELDING], ids=["rigid", "yielding"])
def test_a_block_of_samples_is_bit_for_bit_what_single_steps_give(scene: str) -> None:
    # steps of a power of 2 add up without rounding
    step, forces = 2.0**-10, square_wave(3000)
    times = step * np.arange(len(forces) + 1)
    names = ["displacement", "velocity", "contact_force[1]"]
    with Session(parse_scene(scene, "stop.toml"), names) as session:
        session.begin()
        rows = np.concatenate(
            [session.hold(times[i : i + 1001], forces[i : i + 1000]) for i in range(0, 3000, 1000)]
        )
        assert len(session.impacts()) == 0  # impacts would fill the memory during the service of a rig
        session.begin()
        single = [list(session.advance(step, {"force": (force, 0.0)}).values()) for force in forces]
        assert len(session.impacts()) > 5
    np.testing.assert_array_equal(rows, single)


FORCED = STOPPED.replace("[record]", "[forcing]\namplitude = 2\nfrequency = 3\n[record]").replace(
    "recorded_time = 1", "recorded_periods = 1"
)


@pytest.mark.parametrize("name", ["force", "base_acceleration"])
@pytest.mark.parametrize("scene", [STOPPED, FREE + YIELDING, FORCED], ids=["rigid", "yielding", "forced"])
def test_a_linear_input_is_bit_for_bit_what_single_steps_give(scene: str, name: str) -> None:
    values = 4.0 * np.sin(0.02 * np.arange(3001)) + 2.0
    times = np.concatenate([[0.0], np.cumsum(np.random.default_rng(1).uniform(1e-4, 2e-3, 3000))])
    outputs = ["displacement", "velocity", "acceleration", "contact_force"]
    with Session(parse_scene(scene, "stop.toml"), outputs) as session:
        session.begin()
        rows = session.follow(times, name, values)
        impacts, state = session.impacts(), session.observed()
        session.begin()
        single = []
        for k, time in enumerate(times):
            session._driver.advance(float(time))
            slope = (values[k + 1] - values[k]) / (times[k + 1] - time) if k + 1 < len(times) else 0.0
            session._set_input(name, values[k], slope)
            single.append(session.sample())
        np.testing.assert_array_equal(session.impacts(), impacts)
        assert len(impacts) > 5
        assert session.observed() == state
    np.testing.assert_array_equal(rows, single)


def test_instants_without_an_input_are_bit_for_bit_single_steps() -> None:
    times = np.linspace(0.0, 1.0, 200)
    with Session(parse_scene(FORCED, "stop.toml"), ["acceleration", "displacement"]) as session:
        session.begin()
        rows = session.follow(times)
        session.begin()
        single = [session.sample()]
        for time in times[1:]:
            session._driver.advance(float(time))
            single.append(session.sample())
    np.testing.assert_array_equal(rows, single)


def test_a_block_that_cannot_be_is_one_clear_error() -> None:
    two = np.array([0.0, 0.1])
    with Session(parse_scene(FREE, "free.toml")) as session:
        session.begin()
        for times, forces in ((two[::-1], [1.0]), (two, [1.0, 2.0]), (two + 1.0, [1.0])):
            with pytest.raises(UsageError, match="expected ascending instants from 0 s on"):
                session.hold(times, np.array(forces))
        with pytest.raises(UsageError, match="expected finite forces"):
            session.hold(two, np.array([np.nan]))
    forced = FREE.replace("[record]", "[forcing]\namplitude = 1\nfrequency = 1\n[record]").replace(
        "recorded_time = 1", "recorded_periods = 1"
    )
    with Session(parse_scene(forced, "forced.toml"), ["acceleration"]) as session:
        session.begin()
        with pytest.raises(UsageError, match="expected outputs that the FMU has as they are"):
            session.hold(two, np.array([1.0]))


@pytest.mark.parametrize("execution", ["fused", "coupled"])
def test_a_session_that_begins_again_has_lost_the_force_of_the_run_before(execution: str) -> None:
    with Session(parse_scene(FREE, "free.toml"), ["velocity"], execution=execution) as session:
        session.begin()
        assert session.advance(0.02, {"force": (3.0, 0.0)})["velocity"] > 0.0
        session.begin()
        assert session.advance(0.02)["velocity"] == 0.0
