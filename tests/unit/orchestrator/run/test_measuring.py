"""A measuring chain gives the voltages of its scene's motion, for any cut of the samples into blocks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.tolerance import PARTITION

from vibroimpact.fmus.core.measuring import LoadCell
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.run.measuring.chain import Floats
from vibroimpact.orchestrator.run.measuring.session import MeasuredSession
from vibroimpact.orchestrator.scene import Scene, parse_scene

BODY = "[body]\nmass = 2\nstiffness = 800\ndamping = 1.6\n[record]\nrecorded_time = 1\n"
BEAM = """\
[body]
kind = "beam"
length = 0.25
width = 0.02
thickness = 0.002
youngs_modulus = 70e9
density = 2700
modes = 3
damping_ratio = 0.02
[forcing]
amplitude = 0
frequency = 20
location = 0.4
[record]
recorded_periods = 5
"""
RIGID = "[[stop]]\nposition = 0.005\nrestitution = 0.6\n"
YIELDING = "[[stop]]\nposition = 0.005\nlaw = 'hertz'\nstiffness = 1e7\n"
SENSOR = "[sensor]\ngain = 1000\noffset = 0.25\n"
EXCITER = "[exciter]\ngain = 2\noffset = 0.5\n"
CELL = "[load_cell]\nsensitivity = 0.01\nnatural_frequency = 900\ndamping_ratio = 0.05\ncontact_duration = 2e-3\n"
FALLING = EXCITER + "distance = 0.08\n[daq]\nrate = 1000\nbits = 12\nrange = 10\n"
CHANNELS = ("sensor.displacement", "load_cell", "drive")
RATE = 1000


def scene(*tables: str) -> Scene:
    return parse_scene("".join((BODY, *tables)), "chain.toml")


def drive(samples: int) -> Floats:
    return 4.0 * np.sin(2.0 * np.pi * 3.0 * np.arange(samples) / RATE)


def measured(
    given: Scene, cuts: list[int], channels: tuple[str, ...] = CHANNELS
) -> tuple[dict[str, Floats], Floats]:
    """Return channels and impacts of a session that advances from cut to cut."""
    volts, times = drive(cuts[-1]), np.arange(cuts[-1] + 1) / RATE
    blocks, impacts = [], []
    with MeasuredSession(given, channels) as session:
        session.begin()
        for first, last in itertools.pairwise(cuts):
            blocks.append(session.advance(times[first : last + 1], volts[first:last]))
            impacts.append(session.impacts_of_block)
    return {name: np.concatenate([b[name] for b in blocks]) for name in channels}, np.concatenate(impacts)


def test_readings_are_those_of_the_motion_that_the_force_of_the_exciter_makes() -> None:
    given = scene(RIGID, SENSOR, EXCITER)
    found, impacts = measured(given, [0, 400, 1000], ("sensor.displacement", "sensor.velocity", "drive"))
    with Session(given, ["displacement", "velocity"]) as session:
        session.begin()
        rows = session.hold(np.arange(1001) / RATE, 2.0 * drive(1000) + 0.5)
    assert len(impacts) > 3
    np.testing.assert_array_equal(found["sensor.displacement"], 1000.0 * rows[:, 0] + 0.25)
    np.testing.assert_array_equal(found["sensor.velocity"], 1000.0 * rows[:, 1] + 0.25)
    np.testing.assert_array_equal(found["drive"], drive(1000))


def test_readings_end_at_the_range_of_the_sensor() -> None:
    free, _ = measured(scene(RIGID, SENSOR, EXCITER), [0, 1000], ("sensor.displacement",))
    ended, _ = measured(scene(RIGID, SENSOR, "range = 3\n", EXCITER), [0, 1000], ("sensor.displacement",))
    assert np.abs(free["sensor.displacement"]).max() > 3.0
    np.testing.assert_array_equal(
        ended["sensor.displacement"], np.clip(free["sensor.displacement"], -3.0, 3.0)
    )


def test_an_impact_is_a_half_sine_that_begins_with_it_and_has_its_impulse() -> None:
    cell = CELL.replace("natural_frequency = 900", "natural_frequency = 0")
    found, impacts = measured(scene(RIGID, EXCITER, cell), [0, 1000], ("load_cell",))
    times, expected = np.arange(1, 1001) / RATE, np.zeros(1000)
    for time, impulse in impacts[:, [0, 3]]:
        phase = np.pi * (times - time) / 2e-3
        expected += np.where(
            (phase > 0.0) & (phase < np.pi), 0.01 * impulse * np.pi / 4e-3 * np.sin(phase), 0.0
        )
    assert len(impacts) > 3
    np.testing.assert_allclose(found["load_cell"], expected, atol=1e-9)


def test_a_body_that_rests_on_its_stop_presses_the_load_cell() -> None:
    pressed = scene("[[stop]]\nposition = 0\nrestitution = 0.5\n", "[exciter]\ngain = 1\noffset = 3\n", CELL)
    with MeasuredSession(pressed, ["load_cell"]) as session:
        session.begin()
        found = session.advance(np.linspace(0.0, 1.0, 101), np.zeros(100))
        assert session.truth["contact_force"] == pytest.approx(3.0)
    assert found["load_cell"][-1] == pytest.approx(0.03)


def test_the_ring_of_a_cell_behind_a_stop_that_yields_is_that_of_finer_samples() -> None:
    # reference: the same cell under a force with 200 times as many samples
    cell = CELL.replace("contact_duration = 2e-3\n", "")
    given = scene(YIELDING, EXCITER, cell)
    found, _ = measured(given, [0, 600], ("load_cell",))
    times = np.arange(0, 600 * 200 + 1) / (RATE * 200)
    with Session(given, ["contact_force"]) as session:
        session.begin()
        forces = session.hold(times, np.repeat(2.0 * drive(600) + 0.5, 200))[:, 0]
    reference = LoadCell(0.01, 900.0, 0.05).follow(times, np.append(0.0, forces))[200::200]
    size = np.abs(reference).max()
    assert size > 0.1
    np.testing.assert_allclose(found["load_cell"], reference, atol=0.02 * size)


@pytest.mark.parametrize("tables", [(RIGID, EXCITER), (RIGID, FALLING)], ids=["exciter", "falling"])
def test_cuts_between_blocks_change_no_bit(tables: tuple[str, ...]) -> None:
    given = scene(*tables, SENSOR, CELL)
    whole, impacts = measured(given, [0, 900])
    for cuts in ([0, 1, 2, 450, 900], list(range(0, 901, 9))):
        found, again = measured(given, cuts)
        np.testing.assert_array_equal(again, impacts)
        for name in CHANNELS:
            np.testing.assert_array_equal(found[name], whole[name])


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_force_falls_with_the_distance_at_the_start_of_each_sample(side: str) -> None:
    given = scene(RIGID, SENSOR, FALLING.replace("[daq]", f'side = "{side}"\n[daq]'))
    found, _ = measured(given, [0, 500], ("sensor.displacement",))
    sign, volts = (1.0 if side == "lower" else -1.0), drive(500)
    with Session(given, ["displacement"]) as session:
        session.begin()
        place, expected = 0.0, []
        for k in range(500):
            force = (2.0 * volts[k] + 0.5) / (1.0 + sign * place / 0.08) ** 2
            place = float(session.hold(np.array([k, k + 1]) / RATE, np.array([force]))[0, 0])
            expected.append(place)
    np.testing.assert_allclose(
        found["sensor.displacement"], 1000.0 * np.array(expected) + 0.25, atol=1e3 * PARTITION
    )


def test_the_distance_of_a_beam_is_where_the_force_acts() -> None:
    given = parse_scene(BEAM + SENSOR + FALLING, "beam.toml")
    with MeasuredSession(given, ["sensor.displacement"]) as session:
        session.begin()
        found = session.advance(np.arange(401) / RATE, drive(400))["sensor.displacement"]
    # reference: a beam observed at the place of its force, with the same force given sample by sample
    with (
        Session(given.with_values({"sensor.location": 0.4}), ["displacement"]) as session,
        Session(given, ["displacement"]) as tip,
    ):
        session.begin()
        tip.begin()
        place, expected = 0.0, []
        for k, volts in enumerate(drive(400)):
            force = np.array([(2.0 * volts + 0.5) / (1.0 + place / 0.08) ** 2])
            place = float(session.hold(np.array([k, k + 1]) / RATE, force)[0, 0])
            expected.append(float(tip.hold(np.array([k, k + 1]) / RATE, force)[0, 0]))
    np.testing.assert_allclose(found, 1000.0 * np.array(expected) + 0.25, rtol=1e-9)


def test_a_body_that_touches_its_exciter_is_one_clear_error() -> None:
    given = scene(FALLING.replace("0.08", "0.001").replace("gain = 2", "gain = -50"))
    with MeasuredSession(given, ["drive"]) as session:
        session.begin()
        with pytest.raises(ComponentError, match=r"exciter.distance: expected a body that stays away"):
            session.advance(np.arange(1001) / RATE, drive(1000))


def test_chatter_in_a_block_is_counted_to_the_last_impact() -> None:
    # restitution 0.999 under a constant force: thousands of impacts in one sample
    chatter = scene(
        "[[stop]]\nposition = 0\nrestitution = 0.999\n", "[exciter]\ngain = 1\noffset = 400\n", CELL
    )
    start = chatter.with_values({"body.displacement_start": -1e-4})
    with MeasuredSession(start, ["load_cell"]) as session:
        session.begin()
        session.advance(np.array([0.0, 2.0]), np.array([0.0]))
        found = session.impacts_of_block
    with Session(start) as session:
        session.begin()
        session.advance(2.0, {"force": (400.0, 0.0)})
        expected = session.impacts()
    assert len(found) > 2000
    np.testing.assert_allclose(found[:, [0, 3]], expected[:, [0, 3]], rtol=1e-12)


def test_a_long_session_keeps_no_rows() -> None:
    with MeasuredSession(scene(RIGID, EXCITER, CELL), ["load_cell"]) as session:
        session.begin()
        for block in range(20):
            session.advance((np.arange(501) + 500 * block) / RATE, drive(500))
        assert session._driver.rows.blocks == []


@pytest.mark.parametrize(
    ("tables", "channels", "message"),
    [
        ((RIGID,), ("drive",), r"expected \[exciter\]"),
        ((EXCITER,), ("load_cell",), r"load_cell: expected \[load_cell\] for this channel"),
        ((EXCITER,), ("tip",), "channels: expected sensor.displacement, .*, got 'tip'"),
    ],
)
def test_what_is_no_plant_is_refused(
    tables: tuple[str, ...], channels: tuple[str, ...], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        MeasuredSession(scene(*tables), channels)


def test_voltages_and_instants_are_checked() -> None:
    with MeasuredSession(scene(EXCITER), ["drive"]) as session:
        session.begin()
        for times, volts in (([0.0, 0.1, 0.1], [0.0, 0.0]), ([0.1, 0.2], [0.0]), ([0.0, 0.1], [np.nan])):
            with pytest.raises(UsageError, match=r"times: expected ascending|volts: expected finite"):
                session.advance(np.array(times), np.array(volts))
        assert session.time == 0.0


def test_half_sines_need_no_fine_steps_and_a_stop_that_yields_does() -> None:
    rigid = 'law = "restitution"\nposition = 0.001\nside = "upper"\nrestitution = 0.7\n'
    yielding = 'law = "kelvin_voigt"\nposition = 0.001\nside = "upper"\nstiffness = 1e5\n'
    cell = "[load_cell]\nsensitivity = 0.02\nnatural_frequency = 4000.0\ndamping_ratio = 0.05\n"
    for stop, more, fineness in ((rigid, "contact_duration = 1e-3\n", 0.0), (yielding, "", 48_000.0)):
        text = f"[body]\nmass = 1\nstiffness = 100\n[[stop]]\n{stop}{cell}{more}[exciter]\ngain = 1\n"
        scene = parse_scene(f"{text}[record]\nrecorded_time = 1", "cell.toml")
        with MeasuredSession(scene, ["load_cell"]) as session:
            assert session.fineness == pytest.approx(fineness)
