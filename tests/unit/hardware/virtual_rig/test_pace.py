"""A rig faster than real time waits for its programs, but not for ever for a dead one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, Bench, opened_bench, refused

from vibroimpact.hardware.daqmx import constants
from vibroimpact.hardware.virtual_rig import pace
from vibroimpact.hardware.virtual_rig.pace import PATIENCE, Pace
from vibroimpact.hardware.virtual_rig.profiles import PROFILES
from vibroimpact.hardware.virtual_rig.tasks import INPUT, Channel, Clock, Task

SECOND = 10**9


class Wall:
    """A wall clock that a test sets."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    clock = Wall()
    monkeypatch.setattr(pace, "time", clock)
    return clock


def endless_input(name: str = "a", buffer: int = 10) -> Task:
    """Return a running input at 10 Hz whose program has read nothing."""
    task = Task(name, "Dev1", PROFILES["xseries"])
    task.add(INPUT, [Channel("Dev1/ai0", 0, -1.0, 1.0, 1.0)])
    task.set_clock(Clock(10.0, CONTINUOUS.value, 2))
    task.set_buffer(buffer)
    task.begin()
    task.start, task.rate = 0, 10.0
    return task


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_time_as_in_life_or_slower_waits_for_nobody(wall: Wall, speed: float) -> None:
    time = Pace(speed)
    wall.now = 100.0
    assert time.due(0, [endless_input()]) == 100 * speed * SECOND


def test_faster_time_waits_where_a_buffer_is_full_and_goes_on_from_there(wall: Wall) -> None:
    time, task = Pace(20.0), endless_input()
    wall.now = 3.0
    assert time.due(0, [task]) == SECOND - 1  # the eleventh sample would be lost
    assert time.waits_for == "a"
    wall.now = 4.0
    task.position = 5
    assert time.due(SECOND - 1, [task]) == 1.5 * SECOND - 1
    wall.now = 4.01
    task.position = 100
    # the wait is not made up
    assert time.due(int(1.5 * SECOND) - 1, [task]) == pytest.approx(1.7 * SECOND, abs=2)
    assert time.waits_for == ""


def test_a_program_that_is_dead_holds_time_for_some_seconds_only(wall: Wall) -> None:
    time, dead = Pace(20.0), endless_input()
    alive = endless_input("b", buffer=1000)
    wall.now = 1.0
    now = time.due(0, [dead, alive])
    time.due(now, [dead, alive])
    wall.now += PATIENCE - 0.1
    assert time.due(now, [dead, alive]) == now
    wall.now += 0.2
    assert time.due(now, [dead, alive]) > now


def test_a_program_that_reads_a_little_is_not_dead(wall: Wall) -> None:
    time, task = Pace(20.0), endless_input()
    wall.now, now = 1.0, SECOND - 1
    for _ in range(10):
        now = time.due(now, [task])
        assert now == task.limit
        task.position += 1
        wall.now += 0.9 * PATIENCE


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml", lockstep=False) as opened:
        opened.control.pace(speed=1000.0)
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    yield rig
    rig.clear()
    rig.server.board.pace.patience = PATIENCE


def test_a_streaming_program_on_a_rig_a_thousand_times_as_fast_loses_nothing(bench: Bench) -> None:
    wave = np.sin(np.arange(20_000) ** 2 * 1e-6)
    with (
        bench.outputs(rate=10_000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 10_000.0, source="/Dev1/ao/SampleClock", sample_mode=CONTINUOUS) as task,
    ):
        drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        task.in_stream.input_buf_size = drive.out_stream.output_buf_size = 1000
        drive.write(wave[:1000])
        task.start()
        drive.start()
        seen = []
        for begin in range(1000, 20_000, 500):
            seen += task.read(500)
            assert drive.write(wave[begin : begin + 500]) == 500
    np.testing.assert_allclose(seen[1:], wave[: len(seen) - 1], atol=BITS_16)


def test_a_dead_program_loses_its_samples_and_others_go_on(bench: Bench) -> None:
    bench.server.board.pace.patience = 0.05
    with bench.inputs(rate=10_000.0, sample_mode=CONTINUOUS) as dead, bench.outputs(rate=1000.0) as other:
        dead.in_stream.input_buf_size = 1000
        dead.start()
        other.write(np.zeros(1000), auto_start=True)
        other.wait_until_done(10.0)
        with refused(-200279):
            dead.read(10)


def test_an_output_of_a_dead_program_runs_empty_and_holds_its_value(bench: Bench) -> None:
    bench.server.board.pace.patience = 0.05
    drive = bench.outputs(rate=1000.0, sample_mode=CONTINUOUS)
    drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
    drive.write(np.ones(100))
    drive.start()
    with refused(-200290):
        drive.wait_until_done(10.0)
    with refused(-200290):
        drive.stop()
    drive.close()
    assert bench.control.truth()["outputs"][0] == pytest.approx(1.0, abs=BITS_16)
