"""An output follows its waveform sample by sample and comes to rest, as measured by an input wired to it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from support.driving import STEP, Observer
from support.places import ROOT
from support.rig_bench import Bench, opened_bench

from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware.daqmx import DaqError, constants
from vibroimpact.hardware.rig.limits import Floats, Limits
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.rig.output import Output
from vibroimpact.hardware.rig.waveforms import Sine, Waveform

RATE = 10_000.0
LIMITS = Limits(3.0, 500.0)


@pytest.fixture(scope="module")
def served_bench() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml") as bench:
        yield bench


@pytest.fixture
def bench(served_bench: Bench) -> Iterator[Bench]:
    served_bench.control.pace(lockstep=True)
    yield served_bench
    served_bench.clear()


def rig_of(bench: Bench) -> Rig:
    return Rig("bench", bench.channel, bench.server.address)


def output_of(bench: Bench, waveform: Waveform, *, terminal: str = "Dev1/ao0", rate: float = RATE) -> Output:
    return Output(rig_of(bench), terminal, rate, waveform, LIMITS, guarded=False)


def outputs(bench: Bench) -> list[float]:
    found: list[float] = bench.control.truth()["outputs"]
    return found


@dataclass
class Interrupted:
    """A sine that calls a function at a sample."""

    at: int
    act: object
    samples: int | None = None

    def volts(self, first: int, count: int) -> Floats:
        if first <= self.at < first + count and callable(self.act):
            self.act()
        return Sine(5.3, 2.0, RATE, 0.1).volts(first, count)


def test_each_sample_of_the_waveform_goes_out_in_its_turn(bench: Bench) -> None:
    sine = Sine(5.3, 2.0, RATE, 0.2, samples=12_000)
    with output_of(bench, sine) as output, Observer(rig_of(bench), RATE, output.trigger) as seen:
        output.start()
        output.wait()
    # an input samples the voltage before its own edge
    np.testing.assert_allclose(seen.volts[1:12_001], sine.volts(0, 12_000), atol=1.1 * STEP)
    assert not seen.volts[12_001:].any()
    assert output.generated >= 12_000
    assert outputs(bench)[0] == 0.0
    assert bench.control.state()["tasks"] == {}


@pytest.mark.parametrize("at", [3100, 5000, 9001])
def test_a_stop_at_any_moment_comes_to_rest_within_the_slew(bench: Bench, at: int) -> None:
    stopping = Interrupted(at, lambda: output.stop())
    with output_of(bench, stopping) as output, Observer(rig_of(bench), RATE, output.trigger) as seen:
        output.start()
        output.wait()
    assert np.abs(seen.volts).max() > 1.0
    assert seen.volts[-1] == 0.0
    assert seen.steepest < 100.0  # a sine of 5.3 Hz that fades in 0.2 s; nothing jumps
    assert outputs(bench)[0] == 0.0


def test_a_waveform_that_fails_comes_to_rest_before_its_error_is_raised(bench: Bench) -> None:
    def fail() -> None:
        raise ZeroDivisionError("of a waveform")

    with (
        output_of(bench, Interrupted(6000, fail)) as output,
        Observer(rig_of(bench), RATE, output.trigger) as seen,
    ):
        output.start()
        with pytest.raises(ZeroDivisionError, match="of a waveform"):
            output.wait()
        assert outputs(bench)[0] == 0.0
    assert seen.steepest <= LIMITS.slew


def test_an_output_that_is_left_by_an_error_comes_to_rest(bench: Bench) -> None:
    def leave() -> None:
        with output_of(bench, Sine(5.3, 2.0, RATE, 0.1)) as output:
            output.start()
            raise KeyError

    with pytest.raises(KeyError):
        leave()
    assert outputs(bench)[0] == 0.0
    assert bench.control.state()["tasks"] == {}


def test_a_starved_output_is_said_and_comes_to_rest(bench: Bench) -> None:
    lagging = threading.Event()
    slow = Interrupted(5000, lambda: lagging.wait(0.6))
    bench.control.pace(lockstep=False, speed=1.0)
    with output_of(bench, slow) as output, Observer(rig_of(bench), RATE, output.trigger) as seen:
        output.start()
        with pytest.raises(RigError, match=r"Dev1/ao0 ran out of samples .* it was brought to 0 V"):
            output.wait()
    assert outputs(bench)[0] == 0.0
    assert seen.steepest <= LIMITS.slew


@pytest.mark.parametrize(
    ("terminal", "rate", "said"),
    [
        ("Dev1/ao9", RATE, "no such channel"),
        ("Dev7/ao0", RATE, "no such device"),
        ("Dev1/ai0", RATE, "no such channel"),
        ("Dev1/ao0", 2e6, "a rate of 2e"),
    ],
)
def test_what_the_rig_does_not_have_drives_nothing(
    bench: Bench, terminal: str, rate: float, said: str
) -> None:
    with (
        pytest.raises(DaqError, match=said),
        output_of(bench, Sine(5.3, 2.0, rate, 0.1), terminal=terminal, rate=rate) as output,
    ):
        output.start()
    assert outputs(bench) == [0.0, 0.0]
    assert bench.control.state()["tasks"] == {}


def test_an_output_that_another_task_has_is_refused(bench: Bench) -> None:
    with bench.outputs(rate=1000.0) as other:
        other.control(constants.TaskMode.TASK_RESERVE)
        with pytest.raises(DaqError, match="-50103"), output_of(bench, Sine(5.3, 2.0, RATE, 0.1)) as output:
            output.start()


@pytest.mark.parametrize("terminal", ["", "ao0", "Dev1/ao0:1", "Dev1/ao0,Dev1/ao1"])
def test_what_is_no_output_is_refused(bench: Bench, terminal: str) -> None:
    with pytest.raises(UsageError, match="--output: expected an output such as Dev1/ao0"):
        output_of(bench, Sine(5.3, 2.0, RATE, 0.1), terminal=terminal)


def test_a_waveform_beyond_the_limits_drives_nothing(bench: Bench) -> None:
    with (
        pytest.raises(UsageError, match="expected numbers from -3 to 3 V"),
        output_of(bench, Sine(5.3, 4.0, RATE, 0.1)) as output,
    ):
        output.start()
    assert outputs(bench)[0] == 0.0
