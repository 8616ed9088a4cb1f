"""An acquisition on the virtual rig: all samples once, in order; losses are known; a failure is raised last."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support.places import ROOT

from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig import acquisition, sessions
from vibroimpact.hardware.rig.acquisition import Acquisition, Block
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.serving import RigServer, served
from vibroimpact.hardware.virtual_rig.settings import read_rig

TIP = Input("tip", "Dev1/ai0", 5.0)
LOOP = Input("loop", "Dev1/ai2", 10.0)


class Bench:
    """A rig in lockstep, with its control."""

    def __init__(self, server: RigServer, channel: Any) -> None:
        self.server, self.rig, self.control = server, Rig("grpc://test", channel), RigControl(channel)


@pytest.fixture
def bench() -> Iterator[Bench]:
    settings = read_rig(ROOT / "examples" / "rig" / "oscillator.toml")
    with served(settings) as server, daqmx.open_channel(server.address) as channel:
        RigControl(channel).pace(lockstep=True)
        yield Bench(server, channel)


def all_of(acquired: Acquisition) -> list[Block]:
    acquired.start()
    return list(acquired.blocks())


def take(acquired: Acquisition, taken: list[Block], then: Callable[[], None]) -> None:
    """Take all blocks; call `then` after 500 samples."""
    for block in acquired.blocks():
        taken.append(block)
        if block.end > 500:
            then()


def test_all_samples_come_once_and_in_order(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP, LOOP], 5000.0, count=12_345) as acquired:
        blocks = all_of(acquired)
        assert acquired.facts.rate == 5000.0
        assert acquired.facts.product == "X Series (virtual)"
        assert acquired.facts.steps[1] == (-10.0, 10.0, 20.0 / 2**16)
        assert acquired.facts.started_at
    assert [block.first for block in blocks] == [0, *(block.end for block in blocks[:-1])]
    assert blocks[-1].end == 12_345
    assert acquired.gaps == []


def test_an_acquisition_on_the_trigger_of_an_output_counts_as_the_output_does(bench: Bench) -> None:
    wave = np.round(np.linspace(-4.0, 4.0, 4000), 3)
    with (
        daqmx.nidaqmx.Task(grpc_options=bench.rig.options()) as drive,
        Acquisition(bench.rig, [LOOP], 10_000.0, count=4000, trigger="/Dev1/ao/StartTrigger") as acquired,
    ):
        drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
        drive.timing.cfg_samp_clk_timing(10_000.0, samps_per_chan=4000)
        drive.write(wave)
        acquired.start()
        drive.start()
        volts = np.concatenate([block.volts for block in acquired.blocks()], axis=1)[0]
    # an edge of a shared clock samples the output value before that edge
    np.testing.assert_allclose(volts[1:], wave[:-1], atol=4e-4)


def test_a_flag_ends_it_with_all_that_was_read(bench: Bench) -> None:
    seen = []
    with Acquisition(bench.rig, [TIP], 1000.0) as acquired:
        acquired.start()
        for block in acquired.blocks():
            seen.append(block)
            if block.end > 3000:
                acquired.stop()
    assert seen[-1].end > 3000
    assert sum(block.volts.shape[1] for block in seen) == seen[-1].end


def test_a_flag_is_heard_while_a_trigger_does_not_come(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP], 1000.0, trigger="/Dev1/PFI0") as acquired:
        acquired.start()
        acquired.stop()
        assert list(acquired.blocks()) == []


def test_a_program_that_takes_too_slowly_knows_what_it_lost(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(acquisition, "QUEUE_BLOCKS", 2)
    monkeypatch.setattr(acquisition, "LONGEST_BLOCK", 0.05)
    with Acquisition(bench.rig, [TIP], 1000.0, count=20_000) as acquired:
        acquired.start()
        while not acquired.gaps:  # the rig continues, the program does not take blocks
            bench.control.advance(1.0)
        blocks = list(acquired.blocks())
    lost = [
        (before.end, after.first - before.end)
        for before, after in pairwise(blocks)
        if after.first != before.end
    ]
    assert [(gap.first, gap.samples) for gap in acquired.gaps] == lost
    assert all(gap.doubt == 0.0 and "queue is full" in gap.reason for gap in acquired.gaps)
    assert blocks[-1].end == 20_000
    assert sum(block.volts.shape[1] for block in blocks) + sum(n for _, n in lost) == 20_000


class Overrun:
    """A reader with one read that comes too late."""

    def __init__(self, reader: Any, number: int) -> None:
        self._reader, self._left = reader, number

    def read_many_sample(self, *given: Any) -> Any:
        self._left -= 1
        if self._left == 0:
            raise daqmx.DaqError("too late", daqmx.DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE)
        return self._reader.read_many_sample(*given)


def test_an_overrun_starts_the_task_anew_and_leaves_a_gap_of_estimated_length(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP], 1000.0, count=9000) as acquired:
        acquired._reader = Overrun(acquired._reader, 5)
        blocks = all_of(acquired)
    (gap,) = acquired.gaps
    assert gap.doubt > 0.0
    assert "started anew" in gap.reason
    after = next(block for block in blocks if block.first > gap.first)
    assert (after.first, blocks[-1].end) == (gap.first + gap.samples, 9000)


def test_an_overrun_on_a_trigger_is_raised_after_what_was_read(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP], 1000.0, count=9000, trigger="/Dev1/PFI0") as acquired:
        acquired._reader = Overrun(acquired._reader, 4)
        acquired.start()
        while not bench.control.pulse("/Dev1/PFI0"):
            time.sleep(0.001)
        taken = []
        with pytest.raises(daqmx.DaqError, match="too late"):
            taken.extend(acquired.blocks())
    assert acquired.gaps == []


def test_a_device_that_is_gone_is_raised_after_what_was_read(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP], 1000.0) as acquired:
        acquired.start()
        taken: list[Block] = []
        with pytest.raises(daqmx.DaqError, match="-201003"):
            take(acquired, taken, bench.control.lose)
    assert taken[-1].end > 500


def test_a_server_that_is_gone_is_raised(bench: Bench) -> None:
    with Acquisition(bench.rig, [TIP], 1000.0) as acquired:
        acquired.start()
        with pytest.raises((daqmx.DaqError, daqmx.RpcError)):
            take(acquired, [], bench.server.close)


def test_a_rig_that_answers_no_more_is_said(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = threading.Event()

    class Silent:
        def read_many_sample(self, *given: Any) -> None:
            answers.wait(30.0)
            raise daqmx.DaqError("late", -1)

    monkeypatch.setattr(acquisition, "SILENCE", 0.2)
    monkeypatch.setattr(acquisition, "_END_SECONDS", 0.1)
    with Acquisition(bench.rig, [TIP], 1000.0) as acquired:
        acquired._reader = Silent()
        acquired.start()
        with pytest.raises(RigError, match=r"grpc://test: expected an answer within 0.2 s, got none"):
            list(acquired.blocks())
    answers.set()


@pytest.mark.parametrize(
    ("inputs", "rate", "count"), [([], 1.0, 1), ([TIP], 0.0, 1), ([TIP], np.nan, 1), ([TIP], 1.0, 0)]
)
def test_what_is_no_acquisition_is_refused(inputs: list[Input], rate: float, count: int) -> None:
    with pytest.raises(UsageError, match="expected"):
        Acquisition(Rig("none", None), inputs, rate, count=count)


def test_inputs_of_a_program_that_died_are_freed_and_those_of_one_that_lives_are_not(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "LOOK_SECONDS", 0.4)
    dead = Acquisition(bench.rig, [TIP], 1000.0).__enter__()
    dead._task.start()  # and is never read
    bench.control.advance(0.1)
    with Acquisition(bench.rig, [TIP], 1000.0) as living:
        living.start()
        reads = iter(living.blocks())
        next(reads)
        others = threading.Thread(target=lambda: list(reads))
        others.start()
        with (
            pytest.raises(RigError, match="expected inputs that are free, got those of Dev1"),
            Acquisition(bench.rig, [TIP], 1000.0),
        ):
            pass
        living.stop()
        others.join()
