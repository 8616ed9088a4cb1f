"""Leakage: the error of a frequency response from spectra by segments, computed from the drive itself.

A segment holds the response to a drive before it, and loses the response after it. Averaged over segments, H1 is the
Fourier transform of `h(t) rho(t)` with the impulse response h. Rho is the cross spectrum of the drive and of the
drive delayed by t, over the spectrum of the drive. For random forces rho is the correlation of the window; for forces
with the period of the segment it is 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.analysis.decay.samples import Complexes, Floats

_DELAYS = 16
"""Number of delays, within one segment, at which rho is computed."""


@dataclass(frozen=True, slots=True, eq=False)
class Leakage:
    """Cosine series of rho: a line shows `sum_j w_j (H(omega + j d) + H(omega - j d)) / 2`.

    Attributes
    ----------
    weights : ndarray of float, shape (term,)
        Weights w, with the sum 1. One term: no leakage.
    spacing : float
        Spacing d, rad/s: half a line.
    """

    weights: Floats = field(default_factory=lambda: np.ones(1))
    spacing: float = 0.0

    def seen(self, response: Callable[[Floats], Complexes], omega: Floats) -> Complexes:
        """Return a response as lines at `omega` (rad/s) show it; the response is a function of angular frequency."""
        if len(self.weights) == 1:
            return response(omega)
        weights = np.concatenate([0.5 * self.weights[:0:-1], self.weights[:1], 0.5 * self.weights[1:]])
        terms = np.arange(1 - len(self.weights), len(self.weights))
        shown: Complexes = response(omega[:, None] + self.spacing * terms) @ weights
        return shown


NO_LEAKAGE = Leakage()


def leakage_of(drive: Floats, window: Floats, interval: float, driven: float) -> Leakage:
    """Return the leakage of spectra by segments that overlap by half.

    The drive is evenly spaced by an interval (s), and without its mean. The rho of a line counts where the power of the
    line, relative to the largest power, is above `driven`.
    """
    from scipy.fft import dct
    from scipy.signal import csd, welch

    segment = len(window)
    options = {"fs": 1.0 / interval, "window": window, "noverlap": segment // 2, "detrend": False}
    frequency, own = welch(drive, **options)
    lines = own > driven * np.max(own)
    exact = np.arange(_DELAYS + 1) * segment / _DELAYS
    delays = np.unique(np.rint(exact).astype(int))
    rho = np.ones(len(delays))
    for place, delay in enumerate(delays[1:], 1):
        delayed = np.concatenate([np.zeros(delay), drive[:-delay]])
        _, cross = csd(drive, delayed, **options)
        turned = cross * np.exp(2j * np.pi * frequency * delay * interval)
        rho[place] = float(np.mean((turned[lines] / own[lines]).real))
    weights = dct(np.interp(exact, delays, rho), type=1) / _DELAYS
    weights[[0, -1]] *= 0.5
    return Leakage(weights, np.pi / (segment * interval))
