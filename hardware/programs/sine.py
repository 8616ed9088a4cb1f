"""Drive an output with a sine until Ctrl-C or for a time; it comes to rest at 0 V."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import Terminal, say
from vibroimpact.hardware.operations.rig_sine import DriveSine
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.hardware.rig.output import Output
from vibroimpact.hardware.rig.stopping import stopped_by_signals
from vibroimpact.hardware.rig.waveforms import Sine

LINE_SECONDS = 5.0
"""Interval between lines if standard error is no terminal, s."""
REFRESH_SECONDS = 0.2


def drive_sine(
    terminal: str,
    frequency: float,
    amplitude: float,
    *,
    ramp: float = 0.5,
    duration: float | None = None,
    rate: float = 10_000.0,
    most_amplitude: float = 5.0,
    most_slew: float = 2000.0,
    rig: str | None = None,
    progress: bool = True,
) -> float:
    """Drive an output of a rig with a sine; it rises from 0 V and comes to rest at 0 V.

    A guardian, a process of its own, brings it to rest if this process cannot.

    Parameters
    ----------
    terminal : str
        Terminal, such as `Dev1/ao0`.
    frequency : float
        Hz, below half of the rate.
    amplitude : float
        V.
    ramp : float
        Time in which it rises, and falls at the end, s.
    duration : float, optional
        s, ramps included; else until Ctrl-C.
    rate : float
        Samples per second.
    most_amplitude, most_slew : float
        Limits of the output, V and V/s.
    rig : str, optional
        `virtual:RIG.toml`, `grpc://host:port` or `local`; else the board of this machine.
    progress : bool
        Show the progress.

    Returns
    -------
    float
        The driven time, s.

    Raises
    ------
    UsageError
        The sine is invalid or beyond the limits, or the rig lacks the output: nothing was driven.
    RigError
        The rig or this machine failed; the message gives the state of the output.
    KeyboardInterrupt
        It was stopped by Ctrl-C and is at 0 V.

    Examples
    --------
    >>> drive_sine("Dev1/ao0", 5.3, 1.0, duration=10.0, rig="virtual:oscillator.toml")          # doctest: +SKIP
    """
    waveform = sine_of(frequency, amplitude, ramp, duration, rate)
    limits = Limits(most_amplitude, most_slew)
    waveform.refuse_beyond(limits)
    report = say if progress else _unsaid
    interrupted = []
    with opened_rig(rig) as opened, Output(opened, terminal, rate, waveform, limits) as output:

        def stop() -> None:
            interrupted.append(True)
            output.stop()

        with stopped_by_signals(stop):
            output.start()
            if output.has_driven:
                report(
                    f"{terminal} on {opened.name}: {frequency:g} Hz, {amplitude:g} V. Ctrl-C brings it to rest."
                )
            with _shown() if progress else nullcontext(_unsaid) as show:
                while not output.poll(REFRESH_SECONDS):
                    stage = ", coming to rest" if interrupted else ""
                    show(f"{terminal}: {output.generated / rate:.1f} s{stage}")
            output.wait()
        if interrupted:
            report(f"{terminal} is at 0 V." if output.has_driven else "Nothing was driven.")
            raise KeyboardInterrupt
    return output.generated / rate


def drive_output(options: DriveSine) -> None:
    """Drive an output with a sine, and show the progress."""
    drive_sine(
        options.output,
        options.frequency,
        options.amplitude,
        ramp=options.ramp,
        duration=options.duration,
        rate=options.rate,
        most_amplitude=options.most_amplitude,
        most_slew=options.most_slew,
        rig=options.rig,
    )


def sine_of(frequency: float, amplitude: float, ramp: float, duration: float | None, rate: float) -> Sine:
    """Return the requested sine; `duration` (s) is rounded to samples. UsageError: the request is invalid."""
    if duration is not None and not (duration > 0.0 and np.isfinite(duration * rate)):
        raise UsageError(f"--duration: expected a number > 0, s, got {duration!r}.")
    return Sine(frequency, amplitude, rate, ramp, None if duration is None else round(duration * rate))


def _unsaid(text: str) -> None:
    """Print nothing."""


@contextmanager
def _shown() -> Iterator[Callable[[str], None]]:
    """Show the progress on standard error: a changing line in a terminal, else one line now and then."""
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
