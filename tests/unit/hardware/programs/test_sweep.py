"""A whole sweep on the virtual rig: it equals the simulated one, keeps all samples, and never drives unobserved."""

from __future__ import annotations

import shutil
import signal
import time
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from harness import warm
from support.command_line import ENTRY, in_this_process
from support.places import ROOT
from support.rig_bench import Bench, opened_bench

from vibroimpact.analysis import figures, open_dataset
from vibroimpact.analysis.dataset import MeasurementFlag, read_flat, write_dataset
from vibroimpact.fmus.errors import DatasetError, RigError, UsageError
from vibroimpact.hardware.programs.sweep.program import SweepReport, measure
from vibroimpact.hardware.programs.sweep.settings import parse_sweep
from vibroimpact.hardware.rig.acquisition import Acquisition
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.simulation import run

OSCILLATOR = ROOT / "examples" / "rig" / "oscillator.toml"
VOLTS, GAIN = 1.5, 0.1
TEXT = """
[output]
terminal = "Dev1/ao0"
amplitude = 1.5
rate = 2500.0
highest = 2.0
slew = 200.0
ramp_periods = 5
[sweep]
frequency = { start = 6.0, stop = 7.75, step = 0.25 }
transient_periods = 40
recorded_periods = 6
[[input]]
name = "tip"
terminal = "Dev1/ai0"
range = 10.0
role = "displacement"
[[input]]
name = "drive"
terminal = "Dev1/ai2"
range = 5.0
role = "drive"
[calibration.tip]
unit = "mm"
sensitivity = 1.0
how = "gain of the virtual sensor"
when = "2026-03-01"
"""


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """Serve the oscillator in lockstep."""
    with opened_bench(OSCILLATOR) as bench:
        yield bench


@pytest.fixture(scope="module")
def measured(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an uninterrupted sweep."""
    folder = tmp_path_factory.mktemp("unbroken") / "sweep"
    report = sweep(bench, folder)
    assert (report.steps, report.before, report.stopped) == (16, 0, False)
    return folder


@pytest.fixture(scope="module")
def simulated() -> xr.Dataset:
    """Return the same sweep of the rig's scene."""
    plant = tomllib.loads((OSCILLATOR.parent / "oscillator_scene.toml").read_text(encoding="utf-8"))
    tables = {name: plant[name] for name in ("scene", "body", "stop")}
    axis = {"start": 6.0, "stop": 7.75, "points": 8, "path": "up-down"}
    return run(
        tables
        | {
            "forcing": {"amplitude": VOLTS * GAIN, "frequency": 6.0},
            "record": {"transient_periods": 40, "recorded_periods": 6},
            "sweep": {"forcing.frequency": axis},
        },
        progress=False,
    )


def sweep(bench: Bench, folder: Path, text: str = TEXT) -> SweepReport:
    """Measure a sweep on a bench."""
    return measure(parse_sweep(text, "sweep.toml"), folder, f"grpc://{bench.server.address}")


def jump_of(dataset: xr.Dataset, way: str) -> float:
    """Return the frequency (Hz) below the largest change of the range."""
    ranges = dataset.displacement_range.sel(direction=way).values
    return float(dataset.frequency.values[np.argmax(np.abs(np.diff(ranges)))])


def output_of(bench: Bench) -> float:
    """Return the present output voltage, V."""
    return float(bench.control.truth()["outputs"][0])


def test_the_measured_sweep_is_the_simulated_one(measured: Path, simulated: xr.Dataset) -> None:
    with open_dataset(measured) as found:
        np.testing.assert_allclose(found.frequency.values, simulated.frequency.values)
        for direction in ("up", "down"):
            of = found.displacement_range.sel(direction=direction).values
            expected = simulated.displacement_range.sel(direction=direction).values
            np.testing.assert_allclose(of, expected, rtol=2e-3)
        assert [jump_of(found, way) for way in ("up", "down")] == [7.25, 6.25]
        assert [jump_of(simulated, way) for way in ("up", "down")] == [7.25, 6.25]
        assert not found.measurement_flags.any()


def test_a_dataset_says_what_measured_it_and_every_command_reads_it(measured: Path, tmp_path: Path) -> None:
    with open_dataset(measured) as found:
        assert found.attrs["rig"].startswith("grpc://127.0.0.1:")
        assert found.attrs["device"] == "Dev1, X Series (virtual)"
        assert tomllib.loads(found.attrs["sweep"])["output"]["amplitude"] == VOLTS
        assert tomllib.loads(found.attrs["calibration"])["tip"]["unit"] == "mm"
    assert (measured / "live.png").stat().st_size > 5000
    described = in_this_process("describe", measured)
    assert "measurement_flags" in described.stdout
    assert "vibroimpact rig sweep" in described.stdout
    for kind in ("auto", "strobe"):
        drawn = in_this_process("plot", measured, "--kind", kind, "-o", tmp_path / f"{kind}.png")
        assert drawn.returncode == 0, drawn.stderr


def test_the_same_command_has_nothing_to_do_when_all_is_measured(bench: Bench, measured: Path) -> None:
    before = (measured / "dataset.nc").read_bytes()
    assert sweep(bench, measured).before == 16
    assert (measured / "dataset.nc").read_bytes() == before


@pytest.mark.long
def test_a_sweep_that_is_killed_goes_on_and_is_that_of_one_that_nothing_disturbed(
    bench: Bench, measured: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "sweep"
    with started(bench, tmp_path, folder) as process:
        wait_for_steps(folder, 11, process)
        process.kill()
        process.wait()
    with open_dataset(folder) as left:
        steps = left.sizes["run"] if "run" in left.dims else int(np.count_nonzero(left.run_index >= 0))
        assert 11 <= steps < 16
    wait_until_free(bench)
    assert abs(output_of(bench)) < 1e-3
    report = sweep(bench, folder)
    assert (report.before, report.steps) == (steps, 16)
    with open_dataset(folder) as found, open_dataset(measured) as unbroken:
        np.testing.assert_allclose(found.displacement_range, unbroken.displacement_range, rtol=2e-3)
        assert len(found.attrs["measured_at"].splitlines()) == 2


def test_inputs_that_a_killed_program_has_armed_are_free_for_the_next_one(
    bench: Bench, tmp_path: Path
) -> None:
    with opened_rig(f"grpc://{bench.server.address}") as rig:
        tip = Input("tip", "Dev1/ai0", 5.0)
        # it waits for a trigger and reads nothing, as after the death of its program
        left = Acquisition(rig, [tip], 1000.0, trigger="/Dev1/ao/StartTrigger")
        left.__enter__()
        left._task.start()
        few = TEXT.replace("{ start = 6.0, stop = 7.75, step = 0.25 }", "[6.0, 6.5]")
        assert sweep(bench, tmp_path, few).steps == 4


def test_ctrl_c_brings_the_output_to_rest_and_keeps_what_is_measured(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    with started(bench, tmp_path, folder) as process:
        wait_for_steps(folder, 2, process)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "The same command goes on." in said
    assert output_of(bench) == 0.0
    assert 2 <= read_flat(folder / "dataset.nc").sizes["run"] < 16


@pytest.mark.long
def test_ctrl_c_is_heard_before_the_output_has_started(bench: Bench, tmp_path: Path) -> None:
    with started(bench, tmp_path, tmp_path / "sweep") as process:
        while not any(name.startswith("vibroimpact-output") for name in bench.control.state()["tasks"]):
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Stopped; the output is at 0 V." in said
    assert not bench.control.state()["tasks"]
    assert output_of(bench) == 0.0


def test_an_overdriven_sweep_is_flagged_and_no_plateau_is_drawn(bench: Bench, tmp_path: Path) -> None:
    few = TEXT.replace("start = 6.0, stop = 7.75, step = 0.25", "start = 6.0, stop = 7.0, step = 0.5")
    sweep(bench, tmp_path, few.replace("range = 10.0", "range = 2.0"))
    with open_dataset(tmp_path) as found:
        assert (found.measurement_flags == MeasurementFlag.clipped).all()
        assert found.message[0, 0].item() == "clipped: tip at the end of the range"
        panel = figures.draw(found).axes[0]
        drawn = [np.asarray(line.get_ydata()) for line in panel.lines if "sweep" in str(line.get_label())]
        assert not np.concatenate(drawn).size
        assert "clipped, not drawn" in [line.get_label() for line in panel.lines]


@pytest.mark.long
def test_the_clock_error_of_the_inputs_comes_back(bench: Bench, tmp_path: Path) -> None:
    bench.control.set_clock_error(50.0)
    try:
        sweep(bench, tmp_path, TEXT)
    finally:
        bench.control.mend()
    with open_dataset(tmp_path) as found:
        assert found.attrs["clock_error_ppm"] == pytest.approx(50.0, abs=2.0)
        assert found.attrs["clock_error_standard_error_ppm"] < 1.0
        assert not found.measurement_flags.any()


def test_an_output_that_runs_empty_ends_the_sweep_and_leaves_no_step_that_it_spoilt(
    bench: Bench, measured: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "sweep"
    with started(bench, tmp_path, folder) as process:
        wait_for_steps(folder, 3, process)
        assert bench.control.starve() == 1
        _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "ran out of samples" in said
    kept, unbroken = read_flat(folder / "dataset.nc"), read_flat(measured / "dataset.nc")
    assert 3 <= kept.sizes["run"] < unbroken.sizes["run"]
    assert not kept.measurement_flags.values.any()
    same = unbroken.isel(run=slice(kept.sizes["run"]))
    np.testing.assert_array_equal(kept.frequency, same.frequency)
    np.testing.assert_allclose(*(one.displacement_max.max("period") for one in (kept, same)), rtol=2e-3)


def test_a_sweep_does_not_go_on_on_another_branch(bench: Bench, measured: Path, tmp_path: Path) -> None:
    flat = read_flat(measured / "dataset.nc").isel(run=slice(0, 6))
    flat["displacement_max"].values[-1] *= 2.0
    write_dataset(flat, tmp_path / "dataset.nc")
    with pytest.raises(
        RigError, match=r"expected the motion of .* mm at 7.25 Hz up on which this sweep was left"
    ):
        sweep(bench, tmp_path)
    assert read_flat(tmp_path / "dataset.nc").sizes["run"] == 6
    assert output_of(bench) == 0.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("amplitude = 1.5", "amplitude = 1.6", "got that of another one: output.amplitude was 1.5, is 1.6."),
        (
            "stop = 7.75",
            "stop = 7.5",
            "sweep.frequency was 8 values from 6 to 7.75, is 7 values from 6 to 7.5.",
        ),
        ("sensitivity = 1.0", "sensitivity = 1.1", "got that of another one: the calibration."),
    ],
)
def test_the_folder_of_another_sweep_is_refused_in_a_line(
    bench: Bench, measured: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    shutil.copy(measured / "dataset.nc", tmp_path)
    with pytest.raises(UsageError) as refused:
        sweep(bench, tmp_path, TEXT.replace(old, new))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_damaged_dataset_is_said_and_nothing_of_it_is_touched(
    bench: Bench, measured: Path, tmp_path: Path
) -> None:
    content = (measured / "dataset.nc").read_bytes()
    for damaged in (
        content[: len(content) // 2],
        b"hello",
        content.replace(b"begun_with_steps", b"begun_with_stepz"),
    ):
        (tmp_path / "dataset.nc").write_bytes(damaged)
        with pytest.raises(
            UsageError, match="expected the dataset of this sweep, got a damaged one"
        ) as refused:
            sweep(bench, tmp_path)
        assert "\n" not in str(refused.value)
        assert (tmp_path / "dataset.nc").read_bytes() == damaged


def test_the_folder_of_a_campaign_or_of_another_rig_is_refused(
    bench: Bench, measured: Path, tmp_path: Path
) -> None:
    (tmp_path / "campaign.json").write_text("{}")
    with pytest.raises(UsageError, match="got that of a campaign"):
        sweep(bench, tmp_path)
    (tmp_path / "campaign.json").unlink()
    write_dataset(read_flat(measured / "dataset.nc").isel(run=slice(0, 3)), tmp_path / "dataset.nc")
    with pytest.raises(
        UsageError, match=r"expected the rig that began it|expected the rig that began this sweep"
    ):
        measure(parse_sweep(TEXT, "sweep.toml"), tmp_path, f"virtual:{OSCILLATOR}")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Dev1/ai0", "Dev1/ai77", "no such channel: Dev1/ai77"),
        ("Dev1/ao0", "Dev7/ao0", "Dev7"),
        ("range = 10.0", "range = 700.0", "range"),
    ],
)
def test_what_a_rig_does_not_have_is_said_and_nothing_is_driven(
    bench: Bench, tmp_path: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises((UsageError, RigError)) as refused:
        sweep(bench, tmp_path, TEXT.replace(old, new))
    assert "\n" not in str(refused.value)
    assert said.lower() in str(refused.value).lower()
    assert not (tmp_path / "dataset.nc").exists()
    assert output_of(bench) == 0.0


def test_a_sweep_of_one_frequency_is_measured_too(bench: Bench, tmp_path: Path) -> None:
    one = TEXT.replace("{ start = 6.0, stop = 7.75, step = 0.25 }", "[6.0]")
    assert sweep(bench, tmp_path, one.replace("transient_periods = 40", 'path = "down"')).steps == 1
    with open_dataset(tmp_path) as found:
        assert found.displacement_range.size == 1
    file = tmp_path / "one.toml"
    file.write_text(one)
    assert in_this_process("rig", "sweep", file, "-o", tmp_path / "dry", "--dry-run").returncode == 0


def test_a_dry_run_draws_the_output_and_drives_nothing(tmp_path: Path) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(TEXT)
    done = in_this_process("rig", "sweep", file, "-o", tmp_path / "sweep", "--dry-run")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("16 steps of 46 periods, 1.5 V on Dev1/ao0: 1:49 of the rig's time.")
    assert (tmp_path / "sweep" / "plan.png").stat().st_size > 5000


def test_a_sweep_without_a_rig_takes_none_unasked(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected the driver NI-DAQmx on this machine, got none"):
        measure(parse_sweep(TEXT, "sweep.toml"), tmp_path)


class started:  # reads as a sentence
    """A sweep in a separate process, for the duration of the block."""

    def __init__(self, bench: Bench, home: Path, folder: Path) -> None:
        (home / "sweep.toml").write_text(TEXT)
        rig = ("--rig", f"grpc://{bench.server.address}")
        self._words = ("rig", "sweep", home / "sweep.toml", "-o", folder, *rig)

    def __enter__(self) -> warm.Program:
        self._process = warm.start(ENTRY, *self._words, stdout=warm.DEVNULL)
        return self._process

    def __exit__(self, *error: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        assert self._process.stderr is not None
        self._process.stderr.close()


def wait_for_steps(folder: Path, count: int, process: warm.Program) -> None:
    """Wait until `count` steps are stored."""
    end = time.monotonic() + 90.0
    while time.monotonic() < end:
        assert process.poll() is None, process.communicate()
        with suppress(DatasetError):  # it may be rewritten while it is opened
            if read_flat(folder / "dataset.nc").sizes["run"] >= count:
                return
        time.sleep(0.01)
    raise AssertionError("the sweep does not get on")


def wait_until_free(bench: Bench) -> None:
    """Wait until no task drives the rig."""
    end = time.monotonic() + 30.0
    while any(name.startswith("vibroimpact-output") for name in bench.control.state()["tasks"]):
        assert time.monotonic() < end
        time.sleep(0.05)
