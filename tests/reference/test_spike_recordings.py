"""Spikes in recordings made in laboratories, and in load-cell records made from simulated impacts.

The authors of the recordings found their spikes by other methods or by eye; each test gives its source.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.real_data import recording_folder
from support.spike_signals import channel, pulses, time_above

from vibroimpact.analysis.intervals import interval_report
from vibroimpact.analysis.recording import Channel, EventTrain, open_signals
from vibroimpact.analysis.spikes import Mechanics, SpikeSettings, identify, measure_pulses, spike_report
from vibroimpact.hardware.recordings import ImportSettings, import_recording
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene


@cache
def board(number: str) -> Channel:
    """Return the base acceleration of the board under a dropped mass; its unit, g, is undocumented."""
    file = recording_folder("smd_repeated_5kg") / f"board3.4_{number}.lvm"
    named = ImportSettings(name=("base", "board"), unit=("g", "g"))
    return import_recording([file], named).channels["base"]


@cache
def shaker(impact: str) -> dict[str, Channel]:
    """Return command, base and board of the shaker at 5 Hz, with a shock if `impact` is not 0.0."""
    file = recording_folder("shaker_vibration_plus_shock") / f"amp7_impact{impact}_vib0.5.lvm"
    found = import_recording([file]).channels
    return {
        name: found[full]
        for name, full in (
            ("command", "excitation_composite"),
            ("base", "accelerometer_base"),
            ("board", "accelerometer_board"),
        )
    }


def test_a_board_that_was_hit_shows_one_impact_and_one_that_was_not_shows_none() -> None:
    # the recorders' file names count the impacts of 5 kg; the signal after one rings for 20 ms
    report = spike_report(board("05"))
    assert report.dataset.sizes["spike"] == 1
    assert float(report.dataset["spike_peak_time"][0]) == pytest.approx(8.065e-3, abs=1e-5)
    assert int(report.dataset["spike_excursions"][0]) > 21
    assert spike_report(board("00")).dataset.sizes["spike"] == 0


@pytest.mark.parametrize("part", [0.02, 0.03, 0.05, 0.07, 0.1])
def test_the_impulse_of_the_impact_is_the_same_for_any_threshold(part: float) -> None:
    # 4.728 m/s is the sum of the samples above 5 % of the peak, 4457 g; widths at 5, 10 and 50 % also come from samples
    found = measure_pulses(identify(board("05"), SpikeSettings(threshold_part=part)))
    assert len(found) == 1
    assert found.impulse[0] == pytest.approx(4.73, rel=0.02)
    assert found.length[0] == pytest.approx(0.253e-3, rel=0.01)
    if part == 0.05:
        assert found.impulse_above[0] == pytest.approx(4.728, rel=5e-3)
    if part == 0.1:
        assert found.duration[0] == pytest.approx(0.203e-3, rel=0.01)
        assert found.sampled_peak[0] / 9.80665 == pytest.approx(4457.0, rel=1e-3)


@pytest.mark.parametrize("name", ["command", "base", "board"])
def test_the_shaker_shows_its_shock_and_nothing_else(name: str) -> None:
    # one recording has the commanded shock at 3.96 s, the other has none; at the start the shaker settles
    report = spike_report(shaker("0.3")[name])
    assert report.found.method == "cycle_median"
    assert report.dataset.sizes["spike"] == 1
    assert float(report.dataset["spike_peak_time"][0]) == pytest.approx(3.96, abs=0.03)
    calm = spike_report(shaker("0.0")[name])
    assert calm.found.method == "cycle_median"
    assert calm.dataset.sizes["spike"] == 0
    # the header says .000606 and .000586 s, the column of instants .000605 s: 3.3 % of every frequency
    for each in (report, calm):
        assert 1.0 / float(each.dataset["excitation_period"]) == pytest.approx(5.0, rel=0.033)
        assert "uncertain by 3.3%" in each.dataset.attrs["remarks"]


def test_a_plain_threshold_cannot_see_the_shock_of_the_shaker() -> None:
    assert not identify(shaker("0.3")["base"], SpikeSettings(method="threshold")).groups
    assert len(identify(shaker("0.3")["command"], SpikeSettings(method="cycle_threshold")).groups) == 1


@pytest.mark.parametrize("trial", ["a0", "a1"])
def test_the_base_of_the_clamped_board_is_hit_by_one_pulse(trial: str) -> None:
    # from the samples alone: peaks 479 to 523 g, half width .21 to .23 ms, impulse above 10 % of the peak 1.07 to
    # 1.09 m/s. The two part intervals at the ends, which are counted here, add .010 m/s
    file = recording_folder("pcb_repeated_shock") / f"acc_base_{trial}.txt"
    base = import_recording([file], ImportSettings(name=("base",), unit=("g",))).channels["base"]
    assert len(identify(base).groups) == 1
    found = measure_pulses(identify(base, SpikeSettings(threshold_part=0.1)))
    assert 479.0 < found.peak[0] / 9.80665 < 523.0
    assert 1.07 < found.impulse_above[0] < 1.10
    half = measure_pulses(identify(base, SpikeSettings(threshold_part=0.5)))
    assert 0.21e-3 < half.duration[0] < 0.23e-3


RIG = """
[scene]
title = "A rig with a load cell"
units = "SI"
[body]
kind = "oscillator"
mass = 0.3
stiffness = 323.0
damping_ratio = {damping}
[forcing]
amplitude = 40.0
angular_frequency = {frequency}
[[stop]]
law = "restitution"
position = {gap}
side = "upper"
restitution = 0.6
[record]
transient_periods = 100
recorded_periods = 120
"""
MASS, RESTITUTION = 0.3, 0.6
CONTACT = 2e-3
RATE = 20_000.0
SENSITIVITY = 0.0218


def impacts(folder: Path, **scene: float) -> EventTrain:
    """Return the impacts of the oscillator, simulated exactly."""
    run_scene(parse_scene(RIG.format(**scene), "rig.toml"), folder / "rig.nc")
    return open_signals(folder / "rig.nc").event_train("impacts")


def load_cell(times: np.ndarray, impulses: np.ndarray, rng: np.random.Generator, noise: float) -> Channel:
    """Return volts of a load cell: half-sines of 2 ms at the impacts, noise, and drift as large as the spikes."""
    begin = times[0] - 0.05
    time = np.arange(int((times[-1] - begin + 0.05) * RATE)) / RATE
    peaks = np.pi * impulses / (2.0 * CONTACT)
    force = pulses(time, times - begin, peaks, CONTACT)
    scale = float(np.median(peaks))
    force += noise * scale * rng.standard_normal(len(time)) + 0.5 * scale * np.sin(2.0 * np.pi * time / 6.0)
    return channel(SENSITIVITY * force, 1.0 / RATE, "V", start=begin)


def assert_two_percent(
    cell: Channel, times: np.ndarray, impulses: np.ndarray, velocities: np.ndarray
) -> np.ndarray:
    """Assert that the spikes match the impacts, and return their instants."""
    known = Mechanics(mass=MASS, restitution=RESTITUTION, sensitivity=SENSITIVITY)
    report = spike_report(cell, SpikeSettings(polarity="positive"), known)
    data = report.dataset
    assert report.found.method == "threshold"
    assert data.sizes["spike"] == len(times)
    # a spike starts when it passes the threshold, after the contact has begun
    late = data["spike_time"].values - times
    assert np.all((late > -1e-4) & (late < 0.25 * CONTACT))
    contact = time_above(float(data["threshold"]), np.pi * impulses / (2.0 * CONTACT), CONTACT)
    expected = contact[:-1].sum() / (times[-1] - times[0])
    assert float(data["contact_time_measure"]) == pytest.approx(expected, rel=0.02)
    assert data["spike_impulse"].values.mean() == pytest.approx(impulses.mean(), rel=0.02)
    assert data["spike_velocity"].values.mean() == pytest.approx(velocities.mean(), rel=0.02)
    each = data["spike_impulse"].values - impulses
    assert np.all(np.abs(each) < 5.0 * data["spike_impulse_error"].values)
    return np.asarray(data["spike_time"].values)


@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_a_load_cell_gives_contact_time_impulse_and_velocity_of_a_periodic_motion(
    tmp_path: Path, noise: float
) -> None:
    train = impacts(tmp_path, damping=0.1, frequency=64.32, gap=0.0)
    rng = np.random.default_rng(20)
    values = [train.attrs[f"impact_{name}"] for name in ("impulse", "velocity")]
    assert_two_percent(load_cell(train.times, values[0], rng, noise), train.times, *values)


def test_a_load_cell_gives_contact_time_impulse_and_velocity_of_an_irregular_motion(tmp_path: Path) -> None:
    train = impacts(tmp_path, damping=0.01, frequency=92.0, gap=0.0)
    impulses = train.attrs["impact_impulse"]
    assert np.ptp(impulses) > 0.2 * impulses.mean()
    cell = load_cell(train.times, impulses, np.random.default_rng(21), 0.01)
    assert_two_percent(cell, train.times, impulses, train.attrs["impact_velocity"])


def test_missing_and_spurious_spikes_are_counted_by_the_lattice_within_their_errors(tmp_path: Path) -> None:
    train = impacts(tmp_path, damping=0.1, frequency=64.32, gap=0.0)
    rng = np.random.default_rng(22)
    missed, spurious = 0.1, 0.04
    kept = rng.uniform(size=len(train.times)) >= missed
    kept[[0, -1]] = True
    interval = 2.0 * np.pi / 64.32
    extra = train.times[:-1] + interval * rng.uniform(0.3, 0.7, len(train.times) - 1)
    extra = extra[rng.uniform(size=len(extra)) < spurious]
    times = np.concatenate([train.times[kept], extra])
    order = np.argsort(times)
    count = len(extra)
    impulses, velocities = (
        np.concatenate([train.attrs[f"impact_{name}"][kept], train.attrs[f"impact_{name}"][:count]])[order]
        for name in ("impulse", "velocity")
    )
    cell = load_cell(times[order], impulses, rng, 0.01)
    found = assert_two_percent(cell, times[order], impulses, velocities)
    report = interval_report(found)
    assert float(report["lattice_interval"]) == pytest.approx(interval, rel=1e-3)
    places = len(train.times)
    for name, number in (("missed", np.count_nonzero(~kept)), ("spurious", count)):
        rate, error = float(report[f"{name}_probability"]), float(report[f"{name}_standard_error"])
        assert abs(rate - number / places) < error
