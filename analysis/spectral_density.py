"""Power spectral density by Welch's method with a Bartlett window, as the thesis computed it: appendix B.2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]

SEGMENT = 1024
"""Samples of a segment, as in the thesis."""
_FEWEST = 16
_BANDWIDTH = 4.0 / 3.0


@dataclass(frozen=True, slots=True, eq=False)
class SpectralDensity:
    """One-sided power spectral density of a signal.

    Attributes
    ----------
    frequency : array, shape (segment // 2 + 1,)
        Hz, from 0 to half the sampling rate.
    density : array, shape (segment // 2 + 1,)
        Squared unit of the signal over Hz. Its sum times the distance of two frequencies is the mean square.
    segment : int
        Samples of a segment.
    segments : int
        Number of averaged segments; each begins in the middle of the segment before.
    """

    frequency: Floats
    density: Floats
    segment: int
    segments: int

    @property
    def resolution(self) -> float:
        """Noise bandwidth, Hz: 4/3 of the distance of two frequencies. A narrower peak is drawn this wide."""
        return _BANDWIDTH * float(self.frequency[1])

    @property
    def words(self) -> str:
        """The method in words: window, number and length of the segments."""
        many = f"{self.segments} segments, half overlapping, of"
        return (
            f"Welch, Bartlett window: {'1 segment of' if self.segments == 1 else many} {self.segment} samples"
        )


def spectral_density(values: Floats, rate: float, segment: int | None = None) -> SpectralDensity:
    """Return the power spectral density of evenly spaced samples: equations.md 8.8, thesis (B.1), (B.2).

    Segments overlap by half and have the window 1 - |j - M/2| / (M/2). The mean is not removed, as in the thesis:
    it shows in the lowest two frequencies.

    Parameters
    ----------
    values : array, shape (sample,)
        Any unit; without gaps.
    rate : float
        Sampling rate, Hz.
    segment : int, optional
        Samples of a segment, a power of two, 16 at least. Default: 1024, or fewer where the signal has fewer.

    Raises
    ------
    UsageError
        The segment is no power of two or longer than the signal; samples are not finite; or the rate is not > 0.

    Examples
    --------
    The density of a harmonic motion holds its mean square:

    >>> motion = 3.0 * np.sin(2.0 * np.pi * 50.0 * np.arange(8192) / 1000.0)
    >>> found = spectral_density(motion, 1000.0)
    >>> round(float(found.density.sum() * found.frequency[1]), 2), found.segments
    (4.5, 15)
    >>> round(float(found.frequency[found.density.argmax()]), 1), round(found.resolution, 2)
    (49.8, 1.3)
    """
    from scipy.signal import get_window, welch  # some tenths of a second

    signal = np.asarray(values, dtype=np.float64)
    if signal.ndim != 1 or signal.size < _FEWEST or not np.isfinite(signal).all():
        raise UsageError(
            f"spectrum: expected a row of {_FEWEST} finite samples at least, got {_description(signal)}."
        )
    if not (np.isfinite(rate) and rate > 0.0):
        raise UsageError(f"spectrum: rate: expected a sampling rate > 0, Hz, got {rate}.")
    length = min(SEGMENT, 1 << (signal.size.bit_length() - 1)) if segment is None else segment
    if length < _FEWEST or length & (length - 1) or length > signal.size:
        raise UsageError(
            f"spectrum: segment: expected a power of two of {_FEWEST} to {signal.size} samples, which the signal has, "
            f"got {length}."
        )
    window = get_window("bartlett", length, fftbins=True)
    frequency, density = welch(signal, rate, window=window, noverlap=length // 2, detrend=False)
    return SpectralDensity(frequency, density, length, (signal.size - length // 2) // (length // 2))


def _description(signal: Floats) -> str:
    if signal.ndim != 1:
        return f"an array of shape {signal.shape}"
    return (
        f"{signal.size}"
        if signal.size < _FEWEST
        else f"{np.count_nonzero(~np.isfinite(signal))} that are not"
    )
