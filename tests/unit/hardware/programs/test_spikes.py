"""Pulses of a load cell, recorded piece by piece, reproduce the impacts of the plant."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process

from vibroimpact.analysis.dataset.reading import open_measured
from vibroimpact.analysis.recording import Recording, open_recording, write_recording
from vibroimpact.analysis.spikes import Mechanics, SpikeSettings, spike_report
from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.programs.record import record
from vibroimpact.hardware.programs.recover import recover
from vibroimpact.hardware.programs.spikes import record_spikes
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig
from vibroimpact.simulation import run

RATE, FREQUENCY, VOLTS = 20_000.0, 8.0, 8.0
MASS, RESTITUTION = 0.092, 0.7
SCENE = f"""
[scene]
units = "SI"
[body]
kind = "oscillator"
mass = {MASS}
damping = 0.6
stiffness = 100.0
[[stop]]
law = "restitution"
position = 0.002
side = "upper"
restitution = {RESTITUTION}
[exciter]
gain = 0.1
[sensor]
gain = 500.0
[load_cell]
sensitivity = 0.0218
offset = 0.01
contact_duration = 1.5e-3
[noise]
seed = 3
load_cell = 1e-3
"""
FORCING = f"""
[forcing]
amplitude = {VOLTS}
frequency = {FREQUENCY}
[record]
transient_periods = 100
recorded_periods = 4
"""
RIG = """
[rig]
scene = "scene.toml"
device = "xseries"
[wiring]
ao0 = "exciter"
ai0 = "sensor.displacement"
ai1 = "load_cell"
"""
CELL = """
[cell]
unit = "N"
sensitivity = 0.0218
offset = 0.01
how = "dead weights"
when = "2026-03-01"
"""


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """An oscillator that hits its stop once per period, in its steady motion, in lockstep."""
    folder = tmp_path_factory.mktemp("rig")
    (folder / "scene.toml").write_text(SCENE + "[record]\nrecorded_time = 1.0\n")
    (folder / "rig.toml").write_text(RIG)
    with served(read_rig(folder / "rig.toml")) as server, daqmx.open_channel(server.address) as channel:
        control = RigControl(channel)
        control.pace(lockstep=True)
        rig = Rig("grpc://test", channel)
        with daqmx.nidaqmx.Task(grpc_options=rig.options()) as drive:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-10, max_val=10)
            endless = daqmx.constants.AcquisitionType.CONTINUOUS
            drive.timing.cfg_samp_clk_timing(10_000.0, sample_mode=endless)
            count = round(10_000 / FREQUENCY)
            drive.write(VOLTS * np.sin(2.0 * np.pi * np.arange(count) / count))
            drive.start()
            control.advance(100.0 / FREQUENCY)
            yield rig


@pytest.fixture(scope="module")
def velocities(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Return the velocities before impact of the same scene, simulated; one per period."""
    scene = tmp_path_factory.mktemp("scene") / "scene.toml"
    scene.write_text(SCENE + FORCING)
    return np.asarray(run(scene).vibroimpact.impacts().impact_velocity.values)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(CELL)
    return path


@pytest.fixture(scope="module")
def hits(driven: Rig, cell: Path, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return 30 pulses in N, and the path of their journal."""
    journal = tmp_path_factory.mktemp("hits") / "hits.journal"
    words = (["cell=Dev1/ai1,5", "tip=Dev1/ai0,10"], RATE, 2.0)
    return record_spikes(driven, *words, pulses=30, calibration=[cell], journal=journal)


def test_each_impact_is_a_pulse_with_its_impulse(hits: Recording, velocities: np.ndarray) -> None:
    train = hits.event_train("pulses")
    assert len(velocities) == 4
    assert len(train.times) == 30
    np.testing.assert_allclose(np.diff(train.times), 1.0 / FREQUENCY, atol=2e-4)
    momentum = MASS * (1.0 + RESTITUTION) * velocities.mean()
    np.testing.assert_allclose(train.attrs["impulse"], momentum, rtol=0.02)
    assert train.attrs["impulse_unit"] == "N s"
    # a half sine of 1.5 ms
    np.testing.assert_allclose(train.attrs["peak"], momentum * np.pi / 2.0 / 1.5e-3, rtol=0.02)
    assert len(hits.channel("cell").values) < 30 * 400


def test_spikes_of_the_pieces_are_those_of_the_whole_record(driven: Rig, cell: Path, hits: Recording) -> None:
    whole = record(driven, ["cell=Dev1/ai1,5"], RATE, 30 / FREQUENCY, calibration=[cell]).channel("cell")
    known, settings = Mechanics(mass=MASS, restitution=RESTITUTION), SpikeSettings(threshold=2.0)
    pieces, expected = (spike_report(each, settings, known).dataset for each in (hits.channel("cell"), whole))
    assert pieces.sizes["spike"] == 30
    np.testing.assert_allclose(np.diff(pieces.spike_time), 1.0 / FREQUENCY, atol=2e-4)
    for name in ("spike_peak", "spike_impulse", "spike_velocity", "spike_length"):
        assert float(pieces[name].mean()) == pytest.approx(float(expected[name].mean()), rel=5e-3)
    assert float(pieces.contact_time_measure) == pytest.approx(float(expected.contact_time_measure), rel=0.02)
    assert pieces.noise == pytest.approx(float(expected.noise), rel=0.2)


def test_velocities_of_the_impacts_come_back_within_their_errors(
    hits: Recording, velocities: np.ndarray
) -> None:
    known = Mechanics(mass=MASS, restitution=RESTITUTION)
    found = spike_report(hits.channel("cell"), SpikeSettings(), known).dataset
    assert found.sizes["spike"] == 30
    off = np.abs(found.spike_velocity - velocities.mean())
    assert float((off <= 3.0 * found.spike_velocity_error).mean()) == 1.0
    np.testing.assert_allclose(found.spike_velocity, velocities.mean(), rtol=0.02)


def test_a_file_of_pulses_is_read_by_spikes_and_recovered_from_its_journal(
    driven: Rig, hits: Recording, tmp_path: Path
) -> None:
    journal = tmp_path / "some.journal"
    some = record_spikes(driven, ["cell=Dev1/ai1,5"], RATE, 0.05, pulses=5, journal=journal)
    write_recording(some, tmp_path / "some.nc")
    done = in_this_process("spikes", tmp_path / "some.nc", "--threshold", "0.05")
    assert done.returncode == 0, done.stderr
    again = recover(journal)
    read = open_recording(tmp_path / "some.nc")
    for found in (again, read):
        np.testing.assert_array_equal(found.channel("cell").values, some.channel("cell").values)
        np.testing.assert_array_equal(found.event_train().times, some.event_train().times)
        assert found.event_train().window == some.event_train().window
        assert found.remarks == some.remarks
    assert in_this_process("import", tmp_path / "some.nc", "-o", tmp_path / "copy.nc").returncode == 0


def test_a_threshold_that_nothing_passes_is_said(driven: Rig, tmp_path: Path) -> None:
    journal = tmp_path / "none.journal"
    with pytest.raises(RigError, match=r"cell: expected a pulse beyond 9 within 0.5 s, got none, .* at most"):
        record_spikes(driven, ["cell=Dev1/ai1,10"], RATE, 9.0, 0.5, journal=journal)
    assert not journal.exists()


def test_a_level_of_rest_beyond_the_threshold_is_said(driven: Rig) -> None:
    found = record_spikes(driven, ["cell=Dev1/ai1,5"], RATE, 0.005, 3.0)
    assert (
        "a pulse lasts longer than 1 s: the level of rest may lie beyond the lower threshold" in found.remarks
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"threshold": 0.0}, "--threshold: expected a finite number, not 0, got 0.0"),
        ({"threshold": np.nan}, "--threshold: expected"),
        ({"on": "tap"}, "--on: expected one of cell, got tap"),
        ({"hysteresis": 0.0}, "--hysteresis: expected a part > 0 and <= 1"),
        ({"presamples": -1}, "--presamples: expected 0 to 1e"),
        ({"postsamples": 10**9}, "--postsamples: expected 0 to 1e"),
        ({"dead_time": np.nan}, "--dead-time: expected"),
        ({"pulses": 0}, "--pulses: expected 1 or more, got 0"),
    ],
)
def test_what_is_no_pulse_is_refused_before_a_rig_is_opened(given: dict[str, float], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        record_spikes("no rig", ["cell=Dev1/ai1"], RATE, **({"threshold": 1.0} | given))  # type: ignore[arg-type]


def test_restitution_and_number_of_impacts_come_back_from_recorded_channels(
    driven: Rig, tmp_path: Path
) -> None:
    words = ["tip=Dev1/ai0,10", "cell=Dev1/ai1,5"]
    write_recording(record(driven, words, 5000.0, 12.0 / FREQUENCY), tmp_path / "both.nc")
    drive = ["--forcing-frequency", f"{FREQUENCY:g}", "-o", tmp_path / "found.nc"]
    done = in_this_process("estimate", "impacts", tmp_path / "both.nc", "--channel", "tip", *drive)
    assert done.returncode == 0, done.stderr
    found = open_measured(tmp_path / "found.nc")
    estimates = found.sel(quantity="restitution")
    best = estimates.isel(estimator=int(np.nanargmin(estimates.standard_error)))
    assert float(best.interval_low) <= RESTITUTION <= float(best.interval_high)
    assert float(best.estimate) == pytest.approx(RESTITUTION, abs=0.02)
    report = spike_report(open_recording(tmp_path / "both.nc").channel("cell")).dataset
    assert abs(report.sizes["spike"] - 12) <= 1
