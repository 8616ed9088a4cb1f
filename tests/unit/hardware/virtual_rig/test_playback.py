"""A recording as the plant: its channels are on the inputs again, as in the measurement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.places import ROOT
from support.real_data import recording_folder
from support.rig_bench import opened_bench

from vibroimpact.analysis.recording import Channel, Recording, TimeAxis, write_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.recordings import import_recording
from vibroimpact.hardware.virtual_rig.scene_plant import opened_plant
from vibroimpact.hardware.virtual_rig.settings import read_rig

STEP = 10.0 / 2**15
"""V per code of the widest range."""


@pytest.fixture
def tip(tmp_path: Path) -> Path:
    """Write a recording: volts at 1 kHz from 3 s on, an acceleration at 500 Hz with a sample that is no number."""
    fine, coarse = 3.0 + np.arange(1000) / 1000.0, 3.0 + np.arange(500) / 500.0
    volts = np.sin(2.0 * np.pi * 5.0 * (fine - 3.0))
    pull = 9.0 * np.cos(2.0 * np.pi * 5.0 * (coarse - 3.0))
    pull[100] = np.nan
    flags = np.zeros(1000, np.uint8), np.zeros(500, np.uint8)
    channels = {
        "tip": Channel("tip", volts, "V", TimeAxis.through(fine, "test"), flags[0]),
        "pull": Channel("pull", pull, "m s-2", TimeAxis.through(coarse, "test"), flags[1]),
    }
    write_recording(
        Recording(channels, attrs={"source_file": "a", "source_format": "test"}), tmp_path / "tip.nc"
    )
    return tmp_path


def rig(folder: Path, wiring: str) -> Path:
    """Write the file of a rig that plays the recording."""
    file = folder / "rig.toml"
    file.write_text(
        f'[rig]\nrecording = "tip.nc"\ndevice = "xseries"\n[wiring]\n{wiring}\n', encoding="utf-8"
    )
    return file


def test_inputs_see_the_recording_from_the_start_of_the_task_on_and_its_end_for_ever(tip: Path) -> None:
    wires = 'ai0 = "tip"\nai1 = { signal = "pull", amplification = 0.5 }'
    with opened_bench(rig(tip, wires)) as bench:
        bench.control.pace(lockstep=True)
        for _ in range(2):  # each task restarts the recording
            with bench.task() as task:
                task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1", min_val=-10, max_val=10)
                task.timing.cfg_samp_clk_timing(2000.0, samps_per_chan=3000)
                seen, pulled = np.array(task.read(3000))
            time = np.arange(3000) / 2000.0
            inside = time <= 0.998
            np.testing.assert_allclose(seen[inside], np.sin(10.0 * np.pi * time[inside]), atol=STEP + 2e-4)
            np.testing.assert_allclose(seen[time > 1.0], np.sin(10.0 * np.pi * 0.999), atol=STEP)
            held = (time >= 0.198) & (time < 0.202)
            np.testing.assert_allclose(pulled[held], 4.5 * np.cos(10.0 * np.pi * 0.198), atol=STEP)


@pytest.mark.parametrize(
    ("wiring", "said"),
    [
        ('ai0 = "tap"', "wiring.ai0: expected a channel of tip.nc, got 'tap'.*tip"),
        ('ai0 = "pull"', "wiring.ai0: expected an amplification, V per m"),
        ('ai0 = "tip"\nao0 = "exciter"', "wiring.ao0: expected no wired output beside a recording"),
    ],
)
def test_what_a_recording_does_not_have_is_said(tip: Path, wiring: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        opened_plant(read_rig(rig(tip, wiring)))


def test_a_file_that_is_no_recording_is_said(tip: Path) -> None:
    (tip / "tip.nc").write_bytes(b"nothing")
    with pytest.raises(DatasetError, match=r"tip.nc: expected a readable NetCDF dataset"):
        opened_plant(read_rig(rig(tip, 'ai0 = "tip"')))


def test_the_noise_of_a_rig_is_that_of_its_scene_and_each_input_has_its_own() -> None:
    with opened_bench(ROOT / "examples" / "rig" / "beam.toml") as bench:
        bench.control.pace(lockstep=True)
        with bench.task() as task:
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", min_val=-0.05, max_val=0.05)
            task.timing.cfg_samp_clk_timing(20_000.0, samps_per_chan=20_000)
            sensor, cell, loop = np.array(task.read(20_000))
    assert np.std(sensor) == pytest.approx(2e-3, rel=0.03)
    assert np.std(cell) == pytest.approx(1e-3, rel=0.03)
    assert np.std(loop) == pytest.approx(1e-3, rel=0.03)
    assert np.mean(cell) == pytest.approx(0.01, abs=1e-4)
    assert np.abs(np.corrcoef([sensor, cell, loop])[np.triu_indices(3, 1)]).max() < 0.04


def test_a_shock_that_a_laboratory_measured_is_on_an_input_as_if_it_were_live(tmp_path: Path) -> None:
    file = recording_folder("pcb_repeated_shock") / "dataset2_Test_001.lvm"
    board = import_recording([file], None)
    write_recording(board, tmp_path / "tip.nc")
    channel = board.channels["acceleration_1"]
    volts_per = float(9.0 / np.max(np.abs(channel.values)))
    wires = f'ai3 = {{ signal = "acceleration_1", amplification = {volts_per!r} }}'
    with (
        opened_bench(rig(tmp_path, wires)) as bench,
        bench.inputs("Dev1/ai3", 51_200.0, samps_per_chan=51_200) as task,
    ):
        seen, rate = np.array(task.read(51_200)), task.timing.samp_clk_rate
    assert rate == 1e8 / 1953, "100 MHz over a whole number"
    delay = float(channel.time[0]) - min(float(each.time[0]) for each in board.channels.values())
    at = np.arange(51_200) / rate + float(channel.time[0]) - delay
    played = volts_per * np.interp(at, channel.time, channel.values)
    # instants of a rig are whole nanoseconds: a steep flank is off by as much
    np.testing.assert_allclose(seen, played, atol=0.51 * STEP + 1e-3)
    assert np.max(np.abs(seen)) > 8.0, "the peak of the shock, between two samples now"
