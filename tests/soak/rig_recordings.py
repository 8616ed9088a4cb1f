"""Recordings of a rig, killed or interrupted at random moments: every sample that reached the journal is recovered."""

from __future__ import annotations

import random
import signal
import time
from pathlib import Path

import numpy as np
from support.command_line import in_this_process
from support.places import ROOT
from support.rig_programs import PATIENCE, program, wait_for_bytes

from vibroimpact.analysis.recording import open_recording
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.journal import read_journal
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig

CASES = 20
SAMPLE = 1
SECONDS = 120.0
RIG = ROOT / "examples" / "rig" / "oscillator.toml"
ROUND, RATE = 8000, 8000.0
"""Samples of a periodic ramp on the output: each sample of the input follows from the sample before."""
RAMP = np.arange(ROUND) * (6.0 / ROUND) - 3.0


def check(seed: int) -> str | None:
    """Record, end the recording at a random moment in a random way, recover, and look for each sample."""
    chance = random.Random(seed)
    with served(read_rig(RIG)) as server, daqmx.open_channel(server.address) as channel:
        options = daqmx.nidaqmx.GrpcSessionOptions(channel, "")
        with daqmx.nidaqmx.Task(grpc_options=options) as drive:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
            drive.timing.cfg_samp_clk_timing(RATE, sample_mode=daqmx.constants.AcquisitionType.CONTINUOUS)
            drive.write(RAMP)
            drive.start()
            return _ended(chance, f"grpc://{server.address}")


def _ended(chance: random.Random, rig: str) -> str | None:
    folder = Path.cwd()
    words = ["--rig", rig, "--channel", "tip=Dev1/ai0,10", "--loopback", "back=Dev1/ai2,5", "-o", "tip.nc"]
    with program("rig", "record", *words, "--rate", f"{RATE:g}", cwd=folder) as process:
        wait_for_bytes(folder / "tip.journal", 20_000, process)
        time.sleep(chance.expovariate(0.7))
        killed = chance.random() < 0.8
        process.send_signal(signal.SIGKILL if killed else signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    if not killed:
        return _problem(folder / "tip.nc", None) if process.returncode == 0 else f"Ctrl-C: {said}"
    there = sum(block.volts.shape[1] for block in read_journal(folder / "tip.journal").blocks)
    done = in_this_process("rig", "recover", folder / "tip.journal")
    return done.stderr if done.returncode else _problem(folder / "tip.nc", there)


def _problem(path: Path, count: int | None) -> str | None:
    """Return the problem of a recording; lost or doubled samples break the ramp."""
    back = open_recording(path).channel("back")
    if count is not None and len(back.values) != count:
        return f"{len(back.values)} samples are recovered of {count}"
    steps = np.diff(back.values)
    # the ramp restarts at its end; the converter rounds
    steps = np.where(steps < -3.0, steps + 6.0, steps)
    off = np.abs(steps - 6.0 / ROUND) > 2.0 * 5.0 / 2**15
    return f"the ramp is broken at {np.flatnonzero(off)[:5]} of {len(steps)}" if off.any() else None
