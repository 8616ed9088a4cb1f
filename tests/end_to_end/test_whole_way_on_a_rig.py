"""From a rig to numbers by commands alone: the estimates agree with the parameters of a virtual rig's plant.

References: the tables of examples/rig/oscillator_with_load_cell_scene.toml, and their simulated motion without a
measuring chain: 3.125 Hz and 4 V, three impacts in each period. The rig runs in lockstep.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import ROOT
from support.rig_bench import Bench, opened_bench

from vibroimpact.analysis.recording import open_recording
from vibroimpact.hardware.daqmx import constants
from vibroimpact.simulation import run

RIG = ROOT / "examples" / "rig" / "oscillator_with_load_cell.toml"
CALIBRATION = RIG.with_name("oscillator_calibration.toml")
PLANT = tomllib.loads(RIG.with_name("oscillator_with_load_cell_scene.toml").read_text(encoding="utf-8"))
FREQUENCY, VOLTS, PERIODS = 3.125, 4.0, 8
RATE = 20_000.0
CONTACT = PLANT["load_cell"]["contact_duration"]
MASS, RESTITUTION = PLANT["body"]["mass"], PLANT["stop"][0]["restitution"]


def vibroimpact(*arguments: str | Path | float) -> str:
    """Run a command that has to succeed; return its output."""
    done = in_this_process(*arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def driven(bench: Bench, volts: np.ndarray, rate: float, mode: constants.AcquisitionType) -> Iterator[None]:
    """Drive the output with voltages."""
    with bench.outputs("Dev1/ao0", rate, sample_mode=mode, samps_per_chan=len(volts)) as task:
        task.write(volts)
        task.start()
        yield


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with recordings: `rest.nc` begins at rest, the others are of periodic motion."""
    folder = tmp_path_factory.mktemp("rig")
    with opened_bench(RIG) as bench:
        inputs = ("--channel", "tip=Dev1/ai0,10", "--channel", "cell=Dev1/ai1,2")
        where = ("--rig", f"grpc://{bench.server.address}", "--calibration", CALIBRATION, *inputs)
        record = ("rig", "record", *where, "--loopback", "drive=Dev1/ai2,10")
        time = np.arange(17_500) / 5000.0 - 0.3
        ramped = VOLTS * np.sin(2.0 * np.pi * FREQUENCY * time) * np.clip(time / 0.5, 0.0, 1.0)
        with driven(bench, ramped, 5000.0, constants.AcquisitionType.FINITE):
            vibroimpact(*record, "--rate", 5000, "--duration", 3.5, "-o", folder / "rest.nc")
        bench.clear()
        sine = VOLTS * np.sin(2.0 * np.pi * np.arange(3200) / 3200)
        with driven(bench, sine, 10_000.0, constants.AcquisitionType.CONTINUOUS):
            bench.control.advance(40.0 / FREQUENCY)
            seconds = PERIODS / FREQUENCY
            vibroimpact(*record, "--rate", RATE, "--duration", seconds, "-o", folder / "steady.nc")
            vibroimpact(*record, "--rate", 5000, "--duration", seconds, "-o", folder / "slow.nc")
            pulses = ("--on", "cell", "--threshold", 1.0, "--dead-time", 3e-3, "--pulses", 12)
            vibroimpact("rig", "spikes", *where, "--rate", RATE, *pulses, "-o", folder / "hits.nc")
    return folder


@pytest.fixture(scope="module")
def truth() -> xr.Dataset:
    """Return the periodic motion of the plant."""
    force = {"amplitude": VOLTS * PLANT["exciter"]["gain"], "frequency": FREQUENCY}
    record = {"transient_periods": 100, "recorded_periods": 1}
    tables = {name: PLANT[name] for name in ("scene", "body", "stop")}
    return run(tables | {"forcing": force, "record": record}, progress=False)


@pytest.fixture(scope="module")
def spikes(recordings: Path) -> xr.Dataset:
    output = recordings / "spikes.nc"
    knowing = ("--mass", MASS, "--restitution", RESTITUTION)
    vibroimpact("spikes", recordings / "steady.nc", "--channel", "cell", *knowing, "-o", output)
    with xr.open_dataset(output) as found:
        return found.load()


def in_turn(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the true value of each impact: the values of a period, rotated to the first impact of the record."""
    turns = [np.resize(np.roll(true, -k), len(found)) for k in range(len(true))]
    return min(turns, key=lambda each: float(np.abs(found - each).sum()))


def test_the_recorded_range_is_that_of_the_motion_within_a_thousandth(
    recordings: Path, truth: xr.Dataset
) -> None:
    tip = open_recording(recordings / "steady.nc").channel("tip")
    assert tip.good.all()
    period = tip.si().reshape(PERIODS, -1).mean(axis=0)  # 4 um of noise, 1.4 um in the mean
    assert np.ptp(period) == pytest.approx(float(truth.displacement_range.squeeze()), rel=1e-3)


def test_no_impact_is_missed_and_impulses_and_velocities_are_true_within_their_errors(
    spikes: xr.Dataset, truth: xr.Dataset
) -> None:
    assert truth.sizes["impact"] == 3
    assert spikes.sizes["spike"] == 3 * PERIODS
    for name in ("impulse", "velocity"):
        found, error = spikes[f"spike_{name}"].values, spikes[f"spike_{name}_error"].values
        true = in_turn(found, truth[f"impact_{name}"].values)
        assert (np.abs(found - true) < 3.0 * error).all()
        assert (error < 0.01 * true).all()


def test_the_contact_time_measure_is_that_of_the_half_sines(spikes: xr.Dataset, truth: xr.Dataset) -> None:
    # equations.md 8.4: a half sine of peak A is above H for the share 1 - (2/pi) arcsin(H/A)
    impulses = in_turn(spikes.spike_impulse.values, truth.impact_impulse.values)
    peaks = 0.5 * np.pi * impulses / CONTACT
    above = CONTACT * (1.0 - 2.0 / np.pi * np.arcsin(float(spikes.threshold) / peaks))
    times = spikes.spike_time.values
    true = above[:-1].sum() / (times[-1] - times[0])
    assert abs(float(spikes.contact_time_measure) - true) < 3.0 * float(spikes.contact_time_measure_error)
    assert float(spikes.contact_time_measure) == pytest.approx(true, rel=5e-3)


def test_pulses_that_alone_were_kept_have_the_impulses_of_the_whole_record(
    recordings: Path, truth: xr.Dataset
) -> None:
    output = recordings / "pulses.nc"
    vibroimpact("spikes", recordings / "hits.nc", "--channel", "cell", "-o", output)
    with xr.open_dataset(output) as found:
        assert found.sizes["spike"] == 12
        impulses, errors = found.spike_impulse.values, found.spike_impulse_error.values
    assert (np.abs(impulses - in_turn(impulses, truth.impact_impulse.values)) < 3.0 * errors).all()


def test_estimates_of_a_recording_hold_the_numbers_of_the_plant(recordings: Path, truth: xr.Dataset) -> None:
    output = recordings / "estimates.nc"
    command = ("estimate", "impacts", recordings / "slow.nc", "--channel", "tip")
    said = vibroimpact(*command, "--forcing-frequency", FREQUENCY, "-o", output)
    assert said.startswith("sure of")
    natural = np.sqrt(PLANT["body"]["stiffness"] / MASS)
    static = VOLTS * PLANT["exciter"]["gain"] / PLANT["body"]["stiffness"]
    true = {
        "restitution": RESTITUTION,
        "natural_frequency": natural,
        "damping_ratio": PLANT["body"]["damping"] / (2.0 * MASS * natural),
        "static_deflection": 1e3 * static,  # mm, the unit of the channel
        "stop_position": 1e3 * PLANT["stop"][0]["position"],
    }
    with xr.open_dataset(output) as found:
        for estimator in ("weak_form", "trajectory"):
            for quantity, value in true.items():
                row = found.sel(estimator=estimator, quantity=quantity)
                low, high = float(row.interval_low), float(row.interval_high)
                slack = 0.5 * (high - low)  # four standard errors, with those of the interval
                assert low - slack < value < high + slack, (estimator, quantity)
                assert slack < 1e-3 * value


def test_a_replay_of_a_recording_finds_damping_exciter_and_restitution(recordings: Path) -> None:
    output = recordings / "replay.nc"
    scene = RIG.with_name("oscillator_replay.toml")
    fit = ("--fit", "body.damping,exciter.gain,stop[1].restitution")
    vibroimpact("replay", scene, recordings / "rest.nc", "-o", output, *fit)
    true = [PLANT["body"]["damping"], PLANT["exciter"]["gain"], RESTITUTION]
    with xr.open_dataset(output) as found:
        error = found.standard_error.values
        assert (np.abs(found.fitted_value.values - true) < 4.0 * error).all()
        assert (error < 1e-3 * np.array(true)).all()
        assert float(found.variance_accounted_for.squeeze()) > 99.99
