"""Drive an output with a sine until Ctrl-C or for a time; it comes to rest at 0 V."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import Terminal, say
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.hardware.rig.output import Output
from vibroimpact.hardware.rig.stopping import stopped_by_signals
from vibroimpact.hardware.rig.waveforms import Sine

LINE_SECONDS = 5.0
"""How often a line is written where standard error is not a terminal, s."""
REFRESH_SECONDS = 0.2


def drive_sine(
    choice: str | None, terminal: str, sine: Sine, limits: Limits, *, said: Callable[[str], None] = say
) -> float:
    """Drive an output of a rig with a sine; return the seconds that it drove, when it is at 0 V.

    Parameters
    ----------
    choice : str or None
        The rig, as `--rig` says it.
    terminal : str
        Such as `Dev1/ao0`.
    sine : Sine
    limits : Limits
    said : callable
        Hears when it begins.

    Raises
    ------
    UsageError, RigError
        Nothing was driven; or the rig or this machine failed, and what became of the output.
    KeyboardInterrupt
        It was stopped by a signal, and is at rest.
    """
    sine.refuse_beyond(limits)
    interrupted = []
    with opened_rig(choice) as rig, Output(rig, terminal, sine.rate, sine, limits) as output:

        def stop() -> None:
            interrupted.append(True)
            output.stop()

        with stopped_by_signals(stop):
            output.start()
            said(
                f"{terminal} on {rig.name}: {sine.frequency:g} Hz, {sine.amplitude:g} V. Ctrl-C brings it to rest."
            )
            with _shown() as show:
                while not output.poll(REFRESH_SECONDS):
                    stage = ", coming to rest" if interrupted else ""
                    show(f"{terminal}: {output.generated / sine.rate:.1f} s{stage}")
            output.wait()
        if interrupted:
            said(f"{terminal} is at 0 V.")
            raise KeyboardInterrupt
    return output.generated / sine.rate


def sine_of(frequency: float, amplitude: float, ramp: float, duration: float | None, rate: float) -> Sine:
    """Return the sine that is asked for; `duration` (s) is rounded to samples.

    Raises
    ------
    UsageError
    """
    if duration is not None and not (duration > 0.0 and np.isfinite(duration * rate)):
        raise UsageError(f"--duration: expected a number > 0, s, got {duration!r}.")
    return Sine(frequency, amplitude, rate, ramp, None if duration is None else round(duration * rate))


@contextmanager
def _shown() -> Iterator[Callable[[str], None]]:
    """Show how far it is on standard error: a line that changes in a terminal, else one now and then."""
    if not sys.stderr.isatty():
        last = time.monotonic()

        def write(text: str) -> None:
            nonlocal last
            if time.monotonic() - last >= LINE_SECONDS:
                last = time.monotonic()
                say(text, err=True)

        yield write
        return
    with Terminal(stderr=True).status("") as status:
        yield status.update
