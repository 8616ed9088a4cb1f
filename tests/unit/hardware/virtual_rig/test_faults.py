"""Faults set by the control service, as an unmodified program of NI's client meets them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, Bench, opened_bench, refused

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import RpcError, constants
from vibroimpact.hardware.virtual_rig.plant import Floats

RIG = ROOT / "examples" / "rig" / "oscillator.toml"


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(RIG) as opened:
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    yield rig
    rig.clear()
    rig.control.mend()


def test_samples_that_are_lost_are_said_by_the_next_read(bench: Bench) -> None:
    with bench.inputs(rate=1000.0, sample_mode=CONTINUOUS) as task:
        task.read(10)
        assert bench.control.overrun() == 1
        with refused(-200279):
            task.read(10)
        task.stop()
        assert len(task.read(10)) == 10
    assert bench.control.overrun() == 0


def test_an_output_that_ran_empty_is_said_by_the_next_write_and_by_stop(bench: Bench) -> None:
    with bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive:
        drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        drive.write(np.full(1000, 2.0), auto_start=True)
        bench.control.advance(0.1)
        assert bench.control.starve() == 1
        with refused(-200290):
            drive.write(np.zeros(10))
        with refused(-200290):
            drive.stop()
        assert bench.control.truth()["outputs"][0] == pytest.approx(2.0, abs=BITS_16)


def test_an_output_that_regenerates_does_not_run_empty(bench: Bench) -> None:
    with bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive:
        drive.write(np.zeros(100), auto_start=True)
        assert bench.control.starve() == 0


def looped(bench: Bench, wave: Floats, count: int) -> Floats:
    """Return the samples of a looped input for an output that repeats."""
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=count + 1) as task,
    ):
        drive.write(wave)
        task.start()
        drive.start()
        return np.array(task.read(count + 1))[1:]


WAVE = 3.0 * np.sin(2.0 * np.pi * np.arange(100) / 100.0)


def test_an_input_that_clips_ends_below_its_range(bench: Bench) -> None:
    bench.control.clip("Dev1/ai2", 1.5)
    np.testing.assert_allclose(looped(bench, WAVE, 200), np.tile(np.clip(WAVE, -1.5, 1.5), 2), atol=BITS_16)
    bench.control.mend()
    np.testing.assert_allclose(looped(bench, WAVE, 200), np.tile(WAVE, 2), atol=BITS_16)


@pytest.mark.parametrize("volts", [None, -1.25])
def test_an_input_that_is_stuck_keeps_its_value(bench: Bench, volts: float | None) -> None:
    bench.control.stick("Dev1/ai2", volts)
    seen = looped(bench, WAVE, 200)
    assert np.ptp(seen) == 0.0
    if volts is not None:
        assert seen[0] == pytest.approx(volts, abs=BITS_16)
    assert bench.control.state()["faults"]["stuck"].keys() == {"Dev1/ai2"}


def test_a_server_that_is_gone_ends_the_read_that_waits() -> None:
    with opened_bench(RIG, lockstep=False) as bench:
        task = bench.inputs(rate=1000.0, sample_mode=CONTINUOUS)
        task.start()
        threading.Timer(0.1, bench.control.vanish).start()
        with pytest.raises(RpcError):
            task.read(100_000, timeout=10.0)
        with pytest.raises(RpcError, match="Failed to connect to server"):
            bench.outputs()
        with suppress(RpcError):
            task.close()


# ---- the clock of the inputs ----


def drift_of_clock(bench: Bench, rate: float, count: int) -> float:
    """Return the error of the input clock, ppm, from the phase of a looped sine over its sample index; > 0: fast."""
    cycles = 1.0 / 50.0
    wave = 5.0 * np.sin(2.0 * np.pi * cycles * np.arange(50))
    with (
        bench.outputs(rate=rate, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", rate, samps_per_chan=count) as task,
    ):
        drive.write(wave)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/ao/StartTrigger")
        task.start()
        drive.start()
        seen = np.array(task.read(count))
    turned = np.exp(-2j * np.pi * cycles * np.arange(count))
    blocks = (seen * turned).reshape(-1, 1000).mean(axis=1)
    slope = np.polyfit(1000.0 * np.arange(len(blocks)), np.unwrap(np.angle(blocks)), 1)[0]
    return -float(slope) / (2.0 * np.pi * cycles) * 1e6


@pytest.mark.parametrize("ppm", [50.0, -120.0, 0.0])
def test_the_error_of_the_input_clock_comes_back_from_the_phase_of_a_looped_sine(
    bench: Bench, ppm: float
) -> None:
    bench.control.set_clock_error(ppm)
    assert drift_of_clock(bench, 2000.0, 120_000) == pytest.approx(ppm, abs=2.0)


def test_a_clock_that_goes_wrong_while_it_runs_loses_no_sample_and_makes_no_jump(bench: Bench) -> None:
    with bench.inputs(rate=1000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 100_000
        task.start()
        bench.control.advance(10.0)
        bench.control.set_clock_error(5000.0)
        assert task.in_stream.total_samp_per_chan_acquired == 10_000
        bench.control.advance(10.0)
        assert task.in_stream.total_samp_per_chan_acquired == pytest.approx(20_050, abs=1)
        assert task.timing.samp_clk_rate == 1000.0  # its own reported rate


def test_inputs_on_the_clock_of_the_output_have_no_error(bench: Bench) -> None:
    bench.control.set_clock_error(1000.0)
    np.testing.assert_allclose(looped(bench, WAVE, 5000), np.tile(WAVE, 50), atol=BITS_16)


# ---- what is refused ----


@pytest.mark.parametrize(
    ("call", "values", "said"),
    [
        ("stick", ("Dev1/ai8",), "terminal: expected Dev1/ai0 to Dev1/ai7, got 'Dev1/ai8'"),
        ("stick", ("Dev1/ai0", float("nan")), "volts: expected a number > -1000 and <= 1000, got nan"),
        ("clip", ("Dev1/ai0", 0.0), "volts: expected a number > 0 and <= 1000, got 0"),
        ("clip", ("Dev1/ai0", True), "volts: expected a number > 0 and <= 1000, got True"),
        ("set_clock_error", (1e6,), r"ppm: expected a number > -10000 and <= 10000, got 1000000.0"),
        ("advance", (10**400,), "seconds: expected a number > 0 and <= 1e\\+06, got 1000"),
    ],
)
def test_a_fault_that_is_none_is_refused(
    bench: Bench, call: str, values: tuple[object, ...], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        getattr(bench.control, call)(*values)
    assert bench.control.state()["faults"] == {"stuck": {}, "clipped": {}, "clock_error": 0.0}
