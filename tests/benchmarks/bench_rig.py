"""The virtual rig by NI's unmodified client: its speed, its cost in real time, its lateness.

Server and client are separate processes on this machine.

- Throughput: a stream reader of doubles empties a finished acquisition of 3 channels, in blocks of 600, 6,000 and
  60,000 samples per channel. The result is relative to the need of 3 channels at 60 kS/s (180,000 samples a second).
- Cost: `examples/rig/oscillator.toml` runs in real time for some seconds, with its output driven and 3 inputs at
  60 kS/s. Every 6,000 samples bring an event and a read. The results are the processor times of client and server, as
  shares of one core.
- Lateness: the program learns of N samples, and has read them, later than their due time by the sample clock. Both
  delays are measured by the monotonic clock. A client does not see the clock start: the earliest of all events counts
  as on time. So lateness is relative to the best case.

Goals: 50 times, 25 % of a core. Run with `python tests/benchmarks/bench_rig.py [--runs 3] [--seconds 10]`.
"""

from __future__ import annotations

import argparse
import os
import queue
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from vibroimpact.hardware.daqmx import constants, nidaqmx, open_channel, stream_readers
from vibroimpact.hardware.virtual_rig.control import RigControl

RIG = Path(__file__).parents[2] / "examples" / "rig" / "oscillator.toml"
ENTRY = "from vibroimpact.orchestrator.commands.cli import main; main()"
CHANNELS, RATE = 3, 60_000
NEEDED = CHANNELS * RATE
"""Samples a second that a program reads in real time."""
TIMES, SHARE = 50.0, 0.25
"""Goals: least throughput over `NEEDED`; most processor time of client and server over that of a core."""
BLOCKS = (600, 6_000, 60_000)
EVERY = 6_000


@contextmanager
def served_rig() -> Iterator[tuple[str, psutil.Process]]:
    """Serve the rig in a process of its own; yield its address and the process."""
    command = [sys.executable, "-u", "-c", ENTRY, "rig", "serve", str(RIG), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            assert process.stdout is not None
            said = (re.search(r"grpc://([\d.]+:\d+)", line) for line in process.stdout)
            address = next(found[1] for found in said if found)
            yield address, psutil.Process(process.pid)
        finally:
            process.terminate()


def processor_time(process: psutil.Process) -> float:
    """Return the processor time of a process, s."""
    times = process.cpu_times()
    return float(times.user + times.system)


def inputs(channel: object, mode: constants.AcquisitionType, samples: int) -> nidaqmx.Task:
    """Return a task of three inputs at 60 kS/s."""
    task = nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, ""))
    task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", min_val=-10, max_val=10)
    task.timing.cfg_samp_clk_timing(RATE, sample_mode=mode, samps_per_chan=samples)
    return task


def throughput(channel: object, block: int) -> float:
    """Return the rate at which a stream reader reads an acquired block, samples per second."""
    count = max(600_000 // block, 1) * block
    with inputs(channel, constants.AcquisitionType.FINITE, count) as task:
        task.start()
        RigControl(channel).advance(count / RATE + 1.0)
        reader = stream_readers.AnalogMultiChannelReader(task.in_stream)
        reader.verify_array_shape = False
        data = np.zeros((CHANNELS, block))
        began = time.perf_counter()
        for _ in range(count // block):
            reader.read_many_sample(data, block)
        return CHANNELS * count / (time.perf_counter() - began)


@dataclass(frozen=True, slots=True)
class RealTime:
    """A run in real time: shares of a core, and lateness of events and of reads, s."""

    client: float
    server: float
    events: list[float]
    reads: list[float]


def in_real_time(address: str, server: psutil.Process, seconds: float) -> RealTime:
    """Drive the rig and read it for some seconds; return costs and lateness."""
    me = psutil.Process(os.getpid())
    with open_channel(address) as channel:
        RigControl(channel).pace(lockstep=False, speed=1.0)
        options = nidaqmx.GrpcSessionOptions(channel, "")
        with (
            nidaqmx.Task(grpc_options=options) as drive,
            inputs(channel, constants.AcquisitionType.CONTINUOUS, 10 * EVERY) as task,
        ):
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
            drive.timing.cfg_samp_clk_timing(RATE, sample_mode=constants.AcquisitionType.CONTINUOUS)
            drive.write(3.0 * np.sin(2.0 * np.pi * np.arange(10_000) / 10_000))
            received: queue.SimpleQueue[float] = queue.SimpleQueue()

            def receive(*_: object) -> int:
                received.put(time.monotonic())
                return 0

            task.register_every_n_samples_acquired_into_buffer_event(EVERY, receive)
            reader = stream_readers.AnalogMultiChannelReader(task.in_stream)
            reader.verify_array_shape = False
            data = np.zeros((CHANNELS, EVERY))
            drive.start()
            task.start()
            received.get(timeout=10.0)  # the first calls make the connection
            reader.read_many_sample(data, EVERY)
            events, reads = [], []
            before = processor_time(me), processor_time(server)
            began = time.monotonic()
            for _ in range(round(seconds * RATE / EVERY)):
                events.append(received.get(timeout=10.0))
                reader.read_many_sample(data, EVERY)
                reads.append(time.monotonic())
            passed = time.monotonic() - began
            after = processor_time(me), processor_time(server)
            task.stop()
            drive.stop()
            task.register_every_n_samples_acquired_into_buffer_event(EVERY, None)
    # the clock of the rig is a whole fraction of 100 MHz
    due = np.arange(len(events)) * EVERY * (round(100e6 / RATE) / 100e6)
    start = float(np.min(np.array(events) - due))
    return RealTime(
        (after[0] - before[0]) / passed,
        (after[1] - before[1]) / passed,
        [float(each) for each in np.array(events) - due - start],
        [float(each) for each in np.array(reads) - due - start],
    )


def main() -> int:
    """Measure and print; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=10.0)
    given = parser.parse_args()
    busy = psutil.cpu_percent(1.0)
    print(
        f"{os.cpu_count()} cores, {busy:.0f} % busy before; nidaqmx {nidaqmx.__version__}, {given.runs} runs"
    )
    least = np.inf
    with served_rig() as (address, server):
        with open_channel(address) as channel:
            RigControl(channel).pace(lockstep=True)
            print("Stream reader of doubles, 3 channels, over what 60 kS/s need")
            for block in BLOCKS:
                found = [throughput(channel, block) / NEEDED for _ in range(given.runs + 1)][1:]
                middle = statistics.median(found)
                least = min(least, middle) if block > BLOCKS[0] else least
                print(f"  blocks of {block:6d} {middle:8.1f} times  ({min(found):.1f} to {max(found):.1f})")
        print(
            f"In real time, 3 x 60 kS/s, {given.seconds:g} s, share of a core; lateness over the best event, ms"
        )
        shares = []
        for _ in range(given.runs):
            run = in_real_time(address, server, given.seconds)
            shares.append(run.client + run.server)
            events, reads = np.array(run.events) * 1e3, np.array(run.reads) * 1e3
            print(
                f"  client {100 * run.client:.1f} %, server {100 * run.server:.1f} %; "
                f"events {np.median(events):.2f} median, {events.max():.2f} at most; "
                f"reads {np.median(reads):.2f}, {reads.max():.2f}"
            )
    share = statistics.median(shares)
    held = least >= TIMES, share < SHARE
    fast, cheap = ("met" if each else "missed" for each in held)
    print(
        f"In blocks of 6,000 and more a stream reader takes {least:.0f} times what 3 channels at 60 kS/s need (goal "
        f"{TIMES:g}: {fast}); in real time client and server take {100 * share:.0f} % of a core (goal "
        f"{100 * SHARE:g} %: {cheap})."
    )
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
