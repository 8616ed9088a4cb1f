"""A program that drives an output is interrupted or killed at a random moment: no jump, and the output at 0 V."""

from __future__ import annotations

import random
import signal

from support.driving import STEEPEST, driven
from support.places import ROOT
from support.rig_bench import opened_bench

CASES = 40
"""Half of the cases are Ctrl-C, half SIGKILL."""
SAMPLE = 1
SECONDS = 120.0
SPEED = 0.5
"""Speed of the rig's clock: at half speed, parallel cases starve no output."""
WITHIN = 1.0
"""Largest time of the rig from a kill to the output at 0 V, s."""


def check(seed: int) -> str | None:
    """Drive, interrupt or kill, and check every output sample."""
    chance, killed = random.Random(seed), bool(seed % 2)
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml", lockstep=False) as bench:
        bench.control.pace(speed=SPEED)
        with driven(bench) as running:
            since = running.drive(chance.uniform(0.0, 1.2))
            running.program.send_signal(signal.SIGKILL if killed else signal.SIGINT)
            code, _, err = running.ended()
            problem = running.problem_at_rest()
        seen = running.seen
    if code != (-signal.SIGKILL if killed else 130) or ("has brought the output to 0 V" in err) != killed:
        return f"exit code {code}: {err}"
    if seen.steepest > STEEPEST:
        return f"a jump of {seen.steepest:.0f} V/s, where the drive has {STEEPEST:.0f}"
    if (late := running.at_zero_after(since)) > WITHIN:
        return f"at 0 V {late:.2f} s after the signal"
    return problem
