"""Spectral density by Welch's method: the sums of the thesis (B.1, B.2), its mean square, and its refusals."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.spectral_density import spectral_density
from vibroimpact.fmus.errors import UsageError

NOISE = np.random.default_rng(3).normal(0.3, 1.2, 16384)


def test_the_density_is_the_mean_over_segments_of_the_thesis() -> None:
    """Compare with the sums of equations.md 8.8, written out."""
    size, rate = 1024, 500.0
    window = 1.0 - np.abs(np.arange(size) - size / 2) / (size / 2)
    segments = [NOISE[first : first + size] for first in range(0, NOISE.size - size + 1, size // 2)]
    squares = np.array([np.abs(np.fft.rfft(window * each)) ** 2 for each in segments])
    expected = 2.0 * squares.mean(axis=0) / (rate * (window**2).sum())
    expected[[0, -1]] *= 0.5
    found = spectral_density(NOISE, rate)
    assert (found.segment, found.segments) == (1024, len(segments)) == (1024, 31)
    np.testing.assert_allclose(found.density, expected, rtol=1e-12)
    np.testing.assert_array_equal(found.frequency, np.arange(513) * rate / 1024)


def test_the_density_holds_the_mean_square() -> None:
    found = spectral_density(NOISE, 500.0)
    assert found.density.sum() * found.frequency[1] == pytest.approx(np.mean(NOISE**2), rel=0.02)


def test_a_peak_is_as_wide_as_is_said() -> None:
    # noise bandwidth: that of a rectangle with the height and the power of a harmonic motion's peak
    motion = np.cos(2.0 * np.pi * 128 * np.arange(8192) / 1024)
    found = spectral_density(motion, 1024.0)
    assert found.density.sum() * found.frequency[1] / found.density.max() == pytest.approx(
        found.resolution, rel=2e-5
    )


def test_a_short_signal_has_a_segment_that_fits() -> None:
    assert spectral_density(NOISE[:1000], 1.0).segment == 512
    one = spectral_density(NOISE[:1000], 1.0, 512)
    assert one.segments == 2
    assert spectral_density(NOISE[:600], 1.0).words == "Welch, Bartlett window: 1 segment of 512 samples"


@pytest.mark.parametrize("segment", [0, -1024, 8, 1000, 32768])
def test_a_segment_that_is_no_power_of_two_or_too_long_is_refused(segment: int) -> None:
    with pytest.raises(
        UsageError, match=f"segment: expected a power of two of 16 to 16384 samples.*got {segment}"
    ):
        spectral_density(NOISE, 1.0, segment)


@pytest.mark.parametrize(
    ("values", "rate", "message"),
    [
        (NOISE[:15], 1.0, "expected a row of 16 finite samples at least, got 15"),
        (NOISE.reshape(2, -1), 1.0, "got an array of shape"),
        (np.append(NOISE, np.nan), 1.0, "got 1 that are not"),
        (NOISE, 0.0, "expected a sampling rate > 0, Hz, got 0.0"),
        (NOISE, np.inf, "expected a sampling rate > 0, Hz, got inf"),
    ],
)
def test_what_has_no_density_is_said(values: np.ndarray, rate: float, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        spectral_density(values, rate)
