"""`vibroimpact describe` of each kind of file: its output, and its refusal of other files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.dataset_examples import dataset_of, record, up_down
from support.replay_signals import HIT, clock, ring
from support.replay_signals import channel as replay_channel

from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.estimate_table import estimate_table
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.recording import Channel, Recording, TimeAxis, write_recording
from vibroimpact.analysis.replay import compare, comparison_dataset
from vibroimpact.analysis.spikes import spike_report


def described(file: Path) -> list[str]:
    """Return the lines printed for a file, runs of blanks as one."""
    done = in_this_process("describe", file)
    assert done.returncode == 0, done.stderr
    return [" ".join(line.split()) for line in done.stdout.splitlines()]


def channel(values: np.ndarray) -> Channel:
    time = np.arange(len(values)) * 1e-3
    return Channel("board", values, "9.80665 m s-2", TimeAxis(time, 1e-3), np.zeros(len(time), np.uint8))


def test_a_sweep_is_told_with_its_dimensions_and_the_range_of_each_variable(tmp_path: Path) -> None:
    write_dataset(up_down().assign_attrs(scene_hash="c0ffee"), tmp_path / "dataset.nc")
    lines = described(tmp_path)
    assert lines[0] == f"{tmp_path / 'dataset.nc'}: campaign of 6 runs"
    assert any(line.startswith("dimensions: direction 2, angular_frequency 3") for line in lines)
    assert "outcome outcome of the run direction, angular_frequency - 6 ok" in lines
    assert "direction direction of the sweep direction - up, down" in lines
    assert any(
        line.startswith("impact_velocity velocity of approach just before impact impact") for line in lines
    )


def test_a_run_is_one_run(tmp_path: Path) -> None:
    write_dataset(dataset_of([record(1.0, impacts=2)]), tmp_path / "run.nc")
    assert described(tmp_path / "run.nc")[0].endswith("run.nc: one run")


def test_estimates_are_told_with_their_standard_errors_and_units(tmp_path: Path) -> None:
    cells = {"fit": {"mass": (2.0, 0.01, 1.98, 2.02)}, "guess": {"mass": (2.5, np.nan, np.nan, np.nan)}}
    found = estimate_table(cells, {"mass": "kg"}, 0.95)
    found = found.assign(noise=((), 0.1, {"units": "N", "long_name": "noise"})).assign(
        noise_error=((), 0.02, {"units": "N", "long_name": "its error"})
    )
    found = found.assign_attrs(estimates="impacts", source_file="rig.nc", remarks="the signal is short.")
    write_results(found, tmp_path / "found.nc")
    lines = described(tmp_path / "found.nc")
    assert lines[0].endswith("found.nc: estimates of impacts")
    assert "made by: vibroimpact estimate impacts of rig.nc" in lines
    assert "mass kg 2.000 ± 0.010 2.5" in lines
    assert "noise noise N 0.100 ± 0.020" in lines
    assert not any(line.startswith(("noise_error", "interval_low")) for line in lines)
    assert lines[-1] == "- the signal is short."


def test_a_replay_is_told_with_the_samples_that_were_not_scored(tmp_path: Path) -> None:
    time = clock()
    board = replay_channel(ring(time - HIT), limit=0.9)
    compared = compare(time, ring(time - HIT), board, lag=0.0, polarity=1)
    write_results(comparison_dataset([compared]), tmp_path / "replay.nc", kind="replay")
    (line,) = [line for line in described(tmp_path / "replay.nc") if line.startswith("board_quality")]
    assert line.endswith(f" {compared.counts['clipped']} clipped")


def test_spikes_are_told_with_the_range_of_their_errors(tmp_path: Path) -> None:
    force = np.random.default_rng(0).normal(0.0, 0.01, 4000)
    for start in (300, 900, 2500):
        force[start : start + 50] += np.sin(np.pi * np.arange(50) / 50)
    found = spike_report(channel(force)).dataset
    write_results(found.assign_attrs(source="a.nc"), tmp_path / "spikes.nc", kind="spikes")
    lines = described(tmp_path / "spikes.nc")
    assert "made by: vibroimpact spikes of a.nc" in lines
    peak = next(line for line in lines if line.startswith("spike_peak peak"))
    assert "spike m/s²" in peak
    assert ", each ± 0." in peak


def test_numbers_that_a_replay_found_are_told_with_what_the_search_began_with(tmp_path: Path) -> None:
    numbers = {"fitted_value": [1.17], "start_value": [1.0], "standard_error": [0.02]}
    words = {"units": "1", "long_name": "number"}
    found = xr.Dataset(
        {name: ("parameter", values, words) for name, values in numbers.items()},
        coords={"parameter": ("parameter", ["sensor.gain"], words)},
    )
    write_results(
        found.assign_attrs(source="vibroimpact 1, scene a.toml"), tmp_path / "fit.nc", kind="replay"
    )
    lines = described(tmp_path / "fit.nc")
    assert lines[0].endswith("fit.nc: replay")
    assert "made by: vibroimpact 1, scene a.toml" in lines
    assert "sensor.gain 1.170 ± 0.020 1" in lines


def test_a_recording_is_told_as_its_import_told_it(tmp_path: Path) -> None:
    whole = Recording({"board": channel(np.array([0.0, np.nan, 2.0]))}, attrs={"source_file": "board.txt"})
    write_recording(whole, tmp_path / "a.nc")
    lines = described(tmp_path / "a.nc")
    assert lines[0].endswith("a.nc: recording")
    assert "made by: vibroimpact import of board.txt" in lines
    assert "board 3 1000 g 0 2 0 0 0" in lines


@pytest.mark.parametrize("content", [b"", b"notes", b"\x89HDF\r\n\x1a\n" + bytes(100), "foreign", None])
def test_what_is_no_file_of_ours_is_one_line(content: bytes | str | None, tmp_path: Path) -> None:
    file = tmp_path / "a.nc"
    if content == "foreign":
        xr.Dataset({"rain": ("day", [1.0, 2.0])}).to_netcdf(file)
    elif isinstance(content, bytes):
        file.write_bytes(content)
    done = in_this_process("describe", file)
    assert done.returncode == 2
    assert not done.stdout
    assert len(done.stderr.splitlines()) == 1
    assert str(file) in done.stderr
