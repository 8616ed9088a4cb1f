"""Waveform reads and writes, for clients that have them."""

from __future__ import annotations

import datetime
from collections.abc import Iterator

import numpy as np
import pytest
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, Bench, opened_bench, refused

from vibroimpact.hardware.daqmx import nidaqmx

if not hasattr(nidaqmx.Task, "read_waveform"):
    pytest.skip("this version of nidaqmx has no waveforms", allow_module_level=True)


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml") as opened:
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    yield rig
    rig.clear()


def test_waveforms_have_samples_and_names_and_follow_each_other_in_time(bench: Bench) -> None:
    with bench.task() as task, bench.outputs() as drive:
        drive.write(2.0)
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0", "tip", min_val=-10, max_val=10)
        task.ai_channels.add_ai_voltage_chan("Dev1/ai2", "loop", min_val=-10, max_val=10)
        task.timing.cfg_samp_clk_timing(1000.0, sample_mode=CONTINUOUS)
        first, second = task.read_waveform(50), task.read_waveform(20)
    np.testing.assert_allclose(first[1].scaled_data, np.full(50, 2.0), atol=BITS_16)
    assert (second[0].sample_count, second[0].channel_name, second[0].units) == (20, "tip", "Volts")
    assert second[0].timing.sample_interval == datetime.timedelta(milliseconds=1)
    between = second[1].timing.start_time - first[1].timing.start_time
    assert float(between.total_seconds()) == pytest.approx(0.05, abs=1e-8)


def test_a_finite_read_that_starts_by_itself_has_a_time(bench: Bench) -> None:
    now = datetime.datetime.now(datetime.UTC)
    with bench.inputs(rate=1000.0, samps_per_chan=10) as task:
        wave = task.read_waveform()
    assert wave.sample_count == 10
    assert abs((wave.timing.start_time - now).total_seconds()) < 1e6


def test_a_waveform_of_a_task_without_a_clock_has_no_interval(bench: Bench) -> None:
    with bench.inputs() as task:
        assert task.read_waveform(3).sample_count == 3


def test_waveforms_that_are_written_go_out(bench: Bench) -> None:
    from nitypes.waveform import AnalogWaveform

    with bench.outputs(rate=1000.0, samps_per_chan=20) as drive:
        waves = [AnalogWaveform.from_array_1d(np.full(20, volts)) for volts in (1.0, -1.0)]
        with refused(-200524):
            drive.write(waves)
        assert drive.write(waves[0]) == 20
        drive.start()
        drive.wait_until_done()
    assert bench.control.truth()["outputs"][0] == pytest.approx(1.0, abs=BITS_16)


def test_samples_that_are_late_come_with_the_error(bench: Bench) -> None:
    bench.control.pace(lockstep=False)
    with bench.inputs(rate=1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        with refused(-200284):
            task.read_waveform(5000, timeout=0.05)
    bench.control.pace(lockstep=True)
