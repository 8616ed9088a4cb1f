"""The output samples: a waveform until it ends or is stopped, then down to 0 from the next sample."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.limits import Fall, Floats, Limits
from vibroimpact.hardware.rig.waveforms import Waveform, envelope

FADE = 0.2
"""Fade time of a stopped waveform, s, if the slew allows it."""


class Course:
    """The samples of an output from the first until it is at rest, at a rate in Hz.

    A stopped waveform fades. A waveform that does not end at 0 V, or that passes the limits, is left at its last
    voltage, which falls to 0. All later samples are 0. `next` is the number of the next sample, `last` the sample
    before it, V. `rest` is the number from which all samples are 0 (None: not known yet). `failure` is the reason for
    leaving the waveform.
    """

    def __init__(self, waveform: Waveform, limits: Limits, rate: float) -> None:
        self._waveform, self._limits, self._rate = waveform, limits, rate
        self.next, self.last = 0, 0.0
        self.rest: int | None = None
        self.failure: Exception | None = None
        self._fade_from: int | None = None
        self._fall: tuple[int, Fall] | None = None

    def stop(self) -> None:
        """Fade the waveform from the next sample on."""
        if self._fade_from is None and self._fall is None and self.rest is None:
            self._fade_from = self.next

    def block(self, count: int) -> Floats:
        """Return the next samples, V, shape (count,)."""
        parts: list[Floats] = []
        end = self.next + count
        while self.next < end:
            part = self._part(end - self.next)
            if part.size:
                parts.append(part)
                self.next += part.size
                self.last = float(part[-1])
        return np.concatenate(parts) if parts else np.empty(0)

    def _part(self, count: int) -> Floats:
        if self.rest is not None:
            return np.zeros(count)
        if self._fall is not None:
            return self._falling(count, *self._fall)
        left = count if self._waveform.samples is None else self._waveform.samples - self.next
        if self._fade_from is not None:
            left = min(left, self._fade_from + self._fade_samples - self.next)
        if left <= 0:
            self._begin_to_fall()
            return np.empty(0)
        try:
            return self._of_waveform(min(count, left))
        except Exception as error:  # a waveform may be foreign code: its error is raised at rest
            self.failure = error
            self._begin_to_fall()
            return np.empty(0)

    @property
    def _fade_samples(self) -> int:
        return math.ceil(FADE * self._rate)

    def _of_waveform(self, count: int) -> Floats:
        volts = np.asarray(self._waveform.volts(self.next, count), dtype=np.float64)
        if volts.shape != (count,):
            raise UsageError(f"output: expected a waveform of {count} samples, got shape {volts.shape}.")
        if self._fade_from is not None:
            elapsed = np.arange(self.next + 1, self.next + count + 1, dtype=np.float64) - self._fade_from
            volts = volts * (1.0 - envelope(elapsed, self._fade_samples))
            volts = _followed(volts, self.last, self._limits.slew / self._rate)
        self._limits.check(volts, self.last, self._rate, self.next)
        return volts

    def _begin_to_fall(self) -> None:
        if self.last:
            self._fall = self.next, self._limits.fall(self.last, self._rate)
        else:
            self.rest = self.next

    def _falling(self, count: int, begin: int, fall: Fall) -> Floats:
        left = begin + fall.samples - self.next
        if left <= 0:
            self.rest = self.next
            return np.empty(0)
        return fall.volts(self.next - begin, min(count, left))


def _followed(targets: Floats, last: float, step: float) -> Floats:
    """Return samples that follow targets with steps no larger than `step`."""
    if (np.abs(np.diff(targets, prepend=last)) <= step).all():
        return targets
    followed = np.empty(targets.shape)
    for place, target in enumerate(targets):
        last += min(max(target - last, -step), step)
        followed[place] = last
    return followed
