"""Runs of scenes with a measuring chain: samples and their times are right, and nothing else changes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.tolerance import PARTITION

from vibroimpact.analysis.dataset import Outcome, RunRecord, open_dataset
from vibroimpact.analysis.recording import Quality, open_signals
from vibroimpact.analysis.spikes import Mechanics, spike_report
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.run import PointRunner, Session
from vibroimpact.orchestrator.run.measuring.session import MeasuredSession
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene

BODY = """\
[body]
mass = 1.0
stiffness = 1000.0
damping = 0.5
[forcing]
amplitude = 3.0
frequency = 5.0
[[stop]]
position = 0.01
restitution = 0.7
[record]
transient_periods = 3
recorded_periods = 8
"""
SENSOR = "[sensor]\ngain = 300.0\noffset = 0.1\n"
CELL = "[load_cell]\nsensitivity = 0.004\nnatural_frequency = 900\ndamping_ratio = 0.05\ncontact_duration = 2e-3\n"
EXCITER = "[exciter]\ngain = 1.5\noffset = 0.3\n"
DAQ = "[daq]\nrate = 2000\nbits = 12\nrange = 5.0\n"
NOISE = "[noise]\nseed = 3\nsensor = 2e-3\nload_cell = 5e-3\n"
CHANNELS = ("sensor.displacement", "load_cell", "drive", "displacement")


def scene(*tables: str, variables: tuple[str, ...] = (), rate: float | None = None) -> Scene:
    text = "".join((BODY, *tables))
    if variables:
        names = ", ".join(f'"{name}"' for name in variables)
        own = "" if rate is None else f"rate = {rate}, "
        text = text.replace("[record]\n", f"[record]\ntime_series = {{ {own}variables = [{names}] }}\n")
    return parse_scene(text, "chain.toml")


def run_of(given: Scene, values: dict[str, float] | None = None) -> RunRecord:
    runner = PointRunner(given)
    try:
        return runner.run(values or {})
    finally:
        runner.close()


def column(record: RunRecord, name: str, names: tuple[str, ...] = CHANNELS) -> np.ndarray:
    assert record.samples is not None
    return record.samples[:, 1 + names.index(name)]


# ---- samples ----


def test_without_a_distance_the_motion_is_that_of_the_force() -> None:
    # reference: the closed form under a force in N, without any chain
    volts = scene("[exciter]\ngain = 1.5\n", SENSOR, CELL, DAQ, variables=CHANNELS)
    newtons = parse_scene(BODY.replace("amplitude = 3.0", "amplitude = 4.5"), "newtons.toml")
    found, expected = run_of(volts), run_of(newtons)
    assert found.impacts is not None
    assert expected.impacts is not None
    assert len(found.impacts) == len(expected.impacts) > 5
    np.testing.assert_allclose(found.impacts[:, :4], expected.impacts[:, :4], atol=PARTITION)
    np.testing.assert_allclose(found.periods, expected.periods, atol=PARTITION)


def test_a_constant_force_shifts_the_motion_and_nothing_else() -> None:
    # 0.3 N on 1000 N/m shift the equilibrium by 0.3 mm: with stop and start 0.3 mm lower, the motion is the same
    shifted = BODY.replace("position = 0.01", "position = 0.0097").replace(
        "damping = 0.5", "damping = 0.5\ndisplacement_start = -0.0003"
    )
    found = run_of(scene("[exciter]\ngain = 1.0\noffset = 0.3\n"))
    expected = run_of(parse_scene(shifted, "shifted.toml"))
    assert found.impacts is not None
    assert expected.impacts is not None
    np.testing.assert_allclose(found.impacts[:, 0], expected.impacts[:, 0], atol=PARTITION)
    np.testing.assert_allclose(found.final_displacement, expected.final_displacement + 3e-4, atol=PARTITION)


def test_channels_are_the_chain_of_the_motion_that_is_sampled_beside_them() -> None:
    record = run_of(scene(SENSOR, EXCITER, CELL, DAQ, variables=CHANNELS))
    assert record.samples is not None
    time = record.samples[:, 0]
    np.testing.assert_allclose(np.diff(time), 1.0 / 2000.0, rtol=1e-9)
    np.testing.assert_array_equal(
        column(record, "sensor.displacement"), 300.0 * column(record, "displacement") + 0.1
    )
    np.testing.assert_allclose(column(record, "drive"), 3.0 * np.cos(2.0 * np.pi * 5.0 * time), atol=1e-9)
    assert column(record, "load_cell").max() > 1.0


def test_clock_error_and_skew_move_the_instants_and_not_the_times() -> None:
    wrong = DAQ + "clock_error = 500\nskew = 1e-4\n"
    names = ("drive", "sensor.displacement", "displacement")
    record = run_of(scene(SENSOR, EXCITER, wrong, variables=names))
    assert record.samples is not None
    number = np.arange(len(record.samples))
    begin, rate = record.samples[0, 0], 2000.0 * (1.0 + 500e-6)
    np.testing.assert_allclose(record.samples[:, 0], begin + number / 2000.0, rtol=1e-12)
    true = begin + number / rate
    np.testing.assert_allclose(column(record, "drive", names), 3.0 * np.cos(10.0 * np.pi * true), atol=1e-9)
    # the second channel is sampled 0.1 ms later
    with Session(scene(EXCITER), ["displacement"]) as session:
        session.begin()
        rows = [session.advance(t - session.time, {"force": (0.3, 0.0)}) for t in true[:300] + 1e-4]
    expected = 300.0 * np.array([row["displacement"] for row in rows]) + 0.1
    np.testing.assert_allclose(column(record, "sensor.displacement", names)[:300], expected, atol=1e-6)


def test_a_recording_after_a_transient_is_the_end_of_one_from_the_start() -> None:
    later = scene(SENSOR, EXCITER, CELL, DAQ, variables=CHANNELS)
    whole = later.with_values({"record.transient_periods": 0, "record.recorded_periods": 11})
    late, early = run_of(later), run_of(whole)
    count = len(late.samples)
    np.testing.assert_allclose(early.samples[-count:], late.samples, atol=1e-7)
    assert early.impacts is not None
    assert late.impacts is not None
    np.testing.assert_allclose(early.impacts[-len(late.impacts) :, 0], late.impacts[:, 0], atol=PARTITION)


def test_a_force_that_falls_is_that_of_a_session_driven_sample_by_sample() -> None:
    falling = scene(SENSOR, EXCITER + "distance = 0.06\n", CELL, DAQ, variables=CHANNELS)
    record = run_of(falling.with_values({"record.transient_periods": 0}))
    times = record.samples[:, 0]
    with MeasuredSession(falling, CHANNELS[:3]) as session:
        session.begin()
        found = session.advance(times, 3.0 * np.cos(10.0 * np.pi * times[:-1]))
    for name in CHANNELS[:3]:
        np.testing.assert_allclose(column(record, name)[1:], found[name], atol=1e-8)
    free = run_of(scene(SENSOR, EXCITER, CELL, DAQ, variables=CHANNELS))
    assert abs(free.final_displacement - record.final_displacement) > 1e-5


def test_a_falling_force_is_held_where_nothing_or_something_else_is_sampled() -> None:
    tables = (SENSOR, EXCITER + "distance = 0.06\n", DAQ)
    sampled, bare = run_of(scene(*tables, variables=("sensor.velocity",))), run_of(scene(*tables))
    own = run_of(scene(*tables, variables=("displacement",), rate=330.0))
    for record in (bare, own):
        np.testing.assert_allclose(record.final_displacement, sampled.final_displacement, atol=PARTITION)
        np.testing.assert_allclose(record.impacts[:, 0], sampled.impacts[:, 0], atol=PARTITION)
    np.testing.assert_allclose(own.samples[:, 0], 0.6 + np.arange(529) / 330.0, atol=1e-12)


def test_the_accelerometer_of_a_moving_base_reads_absolute_accelerations() -> None:
    moved = BODY.replace("amplitude = 3.0", 'kind = "base_acceleration"\namplitude = 3.0') + "[sensor]\n"
    runs = []
    for name in ("sensor.acceleration", "acceleration"):
        series = f'[record]\ntime_series = {{ rate = 900, variables = ["{name}"] }}\n'
        runs.append(run_of(parse_scene(moved.replace("[record]\n", series), "moved.toml")).samples)
    np.testing.assert_allclose(*runs, atol=1e-9)


def test_a_beam_with_a_stop_that_yields_is_measured() -> None:
    text = """\
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
amplitude = 1.5
frequency = 25.0
[[stop]]
position = 0.001
law = "kelvin_voigt"
stiffness = 2e4
damping = 1.0
[sensor]
location = 0.5
gain = 1000
[load_cell]
sensitivity = 0.01
[exciter]
gain = 0.5
[record]
transient_periods = 4
recorded_periods = 6
time_series = { rate = 20e3, variables = ["contact_force", "load_cell"] }
"""
    record = run_of(parse_scene(text, "beam.toml"))
    assert record.outcome is Outcome.ok
    assert record.samples[:, 1].max() > 0.1
    np.testing.assert_allclose(record.samples[:, 2], 0.01 * record.samples[:, 1], atol=1e-12)


def test_a_run_that_meets_its_limit_keeps_its_samples() -> None:
    given = scene(SENSOR, EXCITER, CELL, DAQ, variables=CHANNELS)
    whole = run_of(given)
    cut = run_of(given.with_values({"execution.impact_limit": 9}))
    assert cut.outcome is Outcome.impact_limit
    assert 0 < len(cut.samples) < len(whole.samples)
    np.testing.assert_array_equal(cut.samples, whole.samples[: len(cut.samples)])


# ---- noise and conversion ----


def dataset_of(given: Scene, path: Path) -> xr.Dataset:
    run_scene(given, path)
    return open_dataset(path)


def test_noise_and_conversion_are_those_of_their_tables(tmp_path: Path) -> None:
    analog = run_of(scene(SENSOR, EXCITER, CELL, DAQ, variables=CHANNELS))
    found = dataset_of(scene(SENSOR, EXCITER, CELL, DAQ, NOISE, variables=CHANNELS), tmp_path / "run.nc")
    step = 10.0 / 4096
    for name, rms in (("sensor_displacement", 2e-3), ("load_cell", 5e-3), ("drive", 0.0)):
        values, true = found[name].values, column(analog, name.replace("sensor_", "sensor."))
        np.testing.assert_allclose(values / step, np.round(values / step), atol=1e-9)
        inside = np.abs(true) < 4.9
        error = (values - true)[inside]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(np.hypot(rms, step / np.sqrt(12.0)), rel=0.05)
        assert abs(np.mean(error)) < 5.0 * np.std(error) / np.sqrt(len(error))
    np.testing.assert_array_equal(found.displacement.values, column(analog, "displacement"))
    assert found.load_cell.attrs["units"] == "V"
    assert (found.load_cell.attrs["bits"], found.load_cell.attrs["range"]) == (12, 5.0)
    assert found.load_cell.attrs["noise_seed"] == 3


def test_a_seed_gives_the_same_noise_on_every_worker_and_each_run_its_own(
    tmp_path: Path, cluster: str
) -> None:
    tables = (SENSOR, EXCITER, CELL, DAQ, NOISE)
    swept = '[sweep]\n"forcing.amplitude" = { start = 2.9, stop = 3.0, points = 3, path = "up-down" }\n'
    given = scene(*tables, swept, variables=CHANNELS)
    run_scene(given, tmp_path / "run.nc")
    run_campaign(given, tmp_path / "two", scheduler=cluster)
    two, alone = open_dataset(tmp_path / "two"), open_dataset(tmp_path / "run.nc")
    for name in ("sensor_displacement", "load_cell", "drive"):
        np.testing.assert_array_equal(two[name].values, alone[name].values)
    calm = open_dataset(_quiet(given, tmp_path / "quiet.nc"))
    noise = (alone.sensor_displacement - calm.sensor_displacement).values
    runs = [noise[alone.sample_run.values == run] for run in range(6)]
    for first in range(6):
        for second in range(first):
            assert abs(np.corrcoef(runs[first], runs[second])[0, 1]) < 0.1


def _quiet(given: Scene, path: Path) -> Path:
    run_scene(given.with_values({"noise.sensor": 0.0, "noise.load_cell": 0.0}), path)
    return path


def test_other_seeds_draw_other_noise(tmp_path: Path) -> None:
    given = scene(SENSOR, EXCITER, CELL, DAQ, NOISE, variables=CHANNELS)
    one = dataset_of(given, tmp_path / "one.nc")
    other = dataset_of(given.with_values({"noise.seed": 4}), tmp_path / "other.nc")
    assert (one.load_cell.values != other.load_cell.values).mean() > 0.5


def test_signals_are_read_as_those_of_a_recording(tmp_path: Path) -> None:
    given = scene(SENSOR + "range = 2\n", EXCITER, CELL, DAQ + "skew = 1e-5\n", NOISE, variables=CHANNELS)
    strong = given.with_values({"load_cell.sensitivity": 0.02})
    run_scene(strong, tmp_path / "run.nc")
    signals = open_signals(tmp_path / "run.nc")
    cell, sensor = signals.channels["load_cell"], signals.channels["sensor_displacement"]
    assert (cell.unit, cell.attrs["bits"]) == ("V", 12)
    ends = (cell.values >= 5.0 - 10.0 / 4096) | (cell.values <= -5.0)
    assert ends.any()
    np.testing.assert_array_equal(cell.quality == Quality.clipped, ends)
    assert (sensor.quality == Quality.clipped).sum() > 10
    np.testing.assert_allclose(cell.axis.time - sensor.axis.time, 1e-5, rtol=1e-6)
    assert not signals.channels["displacement"].quality.any()


def test_spikes_of_a_simulated_cell_are_forces_by_the_sensitivity_of_its_scene(tmp_path: Path) -> None:
    swept = '[sweep]\n"load_cell.sensitivity" = { values = [0.004, 0.008] }\n'
    run_scene(scene(SENSOR, CELL, DAQ, swept, variables=("load_cell",)), tmp_path / "run.nc")
    for run, sensitivity in enumerate((0.004, 0.008)):
        cell = open_signals(tmp_path / "run.nc", run).channels["load_cell"]
        found, given = spike_report(cell), spike_report(cell, mechanics=Mechanics(sensitivity=sensitivity))
        assert found.dataset.spike_peak.attrs["units"] == "N"
        assert found.dataset.sizes["spike"] > 0
        assert found.dataset.identical(given.dataset)


def test_swept_ranges_flag_each_run_by_its_own(tmp_path: Path) -> None:
    swept = '[sweep]\n"daq.range" = { values = [1.0, 5.0] }\n'
    run_scene(scene(SENSOR, EXCITER, DAQ, swept, variables=("drive",)), tmp_path / "run.nc")
    narrow, wide = (open_signals(tmp_path / "run.nc", run).channels["drive"] for run in (0, 1))
    assert (narrow.attrs["range"], wide.attrs["range"]) == (1.0, 5.0)
    assert narrow.quality.any()
    assert not wide.quality.any()


# ---- absent parts ----


def test_an_absent_table_loads_nothing_and_changes_no_bit() -> None:
    plain, chained = scene(), scene(SENSOR, CELL, DAQ, NOISE, "[exciter]\ngain = 1\n")
    runners = [PointRunner(plain), PointRunner(chained)]
    try:
        assert [list(runner.fmu_hashes) for runner in runners] == [["body"], ["body"]]
        assert runners[0].fmu_hashes == runners[1].fmu_hashes
        one, other = (runner.run({}) for runner in runners)
    finally:
        for runner in runners:
            runner.close()
    np.testing.assert_array_equal(one.impacts, other.impacts)
    np.testing.assert_array_equal(one.periods, other.periods)
    assert one.final_displacement == other.final_displacement


def test_a_time_series_without_channels_is_sampled_as_ever() -> None:
    names = ("displacement", "contact_force")
    plain = scene(variables=names, rate=700.0)
    chained = scene(SENSOR, CELL, DAQ, NOISE, variables=names, rate=700.0)
    one, other = run_of(plain), run_of(chained)
    np.testing.assert_array_equal(one.samples, other.samples)
    np.testing.assert_array_equal(one.impacts, other.impacts)


def test_a_scene_without_a_chain_loads_none_of_it() -> None:
    program = (
        "import sys\n"
        "from vibroimpact.orchestrator.run import PointRunner\n"
        "from vibroimpact.orchestrator.scene import parse_scene\n"
        f"runner = PointRunner(parse_scene({scene().text!r}, 'plain.toml'))\n"
        "runner.run({})\n"
        "chain = ('core.measuring', '.measuring_chain', '.measured_run')\n"
        "print([name for name in sys.modules if name.endswith(chain)])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_deadline_is_heard_within_a_block_of_slow_samples() -> None:
    # a beam pressed on an elastic stop: each sample takes milliseconds, and no step ends early
    text = """\
[body]
kind = "beam"
length = 0.25
width = 0.02
thickness = 0.002
youngs_modulus = 70e9
density = 2700
modes = 4
damping_ratio = 0.02
[[stop]]
position = 0.002
restitution = 1.0
[[stop]]
position = -0.003
side = "lower"
restitution = 0.3
[sensor]
[exciter]
gain = 2.6
offset = 1.0
[record]
recorded_time = 0.3
transient_time = 0.1
time_series = { rate = 1000, variables = ["sensor.displacement"] }
[execution]
deadline = 0.2
"""
    record = run_of(parse_scene(text, "pressed.toml"))
    assert record.outcome is Outcome.timeout
    assert len(record.samples) < 301
