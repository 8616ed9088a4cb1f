"""Modes in many digits, independent of the components' method: cosh/sinh shapes of beams, eigenvectors of chains."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import mpmath as mp
import numpy as np

DIGITS = 120


@cache
def beam_root(boundary: str, j: int) -> mp.mpf:
    """Return eigenvalue j of the textbook's frequency equation, to 120 digits."""
    equation, start = {
        "clamped_free": (lambda x: mp.cos(x) + 1 / mp.cosh(x), j - 0.5),
        "clamped_clamped": (lambda x: mp.cos(x) - 1 / mp.cosh(x), j + 0.5),
        "clamped_pinned": (lambda x: mp.sin(x) - mp.cos(x) * mp.tanh(x), j + 0.25),
        "pinned_pinned": (mp.sin, j),
    }[boundary]
    with mp.workdps(DIGITS):
        guess = mp.mpf("1.875") if (boundary, j) == ("clamped_free", 1) else start * mp.pi
        return mp.findroot(equation, guess, tol=mp.mpf(10) ** (-2 * DIGITS + 10))


@cache
def beam_shape(boundary: str, j: int, s: float, derivative: int) -> mp.mpf:
    """Return cosh - cos - sigma (sinh - sin), or sqrt(2) sin, of xi s; its derivative over xi s (not over s)."""
    with mp.workdps(DIGITS):
        xi = beam_root(boundary, j)
        x = xi * mp.mpf(s)
        sine, cosine = mp.sin(x + derivative * mp.pi / 2), mp.cos(x + derivative * mp.pi / 2)
        if boundary == "pinned_pinned":
            return mp.sqrt(2) * sine
        sign = 1 if boundary == "clamped_free" else -1
        sigma = (mp.cosh(xi) + sign * mp.cos(xi)) / (mp.sinh(xi) + sign * mp.sin(xi))
        even, odd = (mp.cosh(x), mp.sinh(x)) if derivative % 2 == 0 else (mp.sinh(x), mp.cosh(x))
        return even - cosine - sigma * (odd - sine)


def chain_modes(masses: Sequence[float], stiffnesses: Sequence[float]) -> tuple[list[mp.mpf], mp.matrix]:
    """Return angular frequencies and M-orthonormal shapes from M^-1/2 K M^-1/2, in 80 digits.

    `stiffnesses` has one more entry than `masses`: the far spring. Sign of a mode: its first mass with more than 1e-8
    of the mode moves to the positive side.
    """
    with mp.workdps(80):
        n = len(masses)
        root = [mp.sqrt(mp.mpf(float(m))) for m in masses]
        matrix = mp.zeros(n)
        for e, k in enumerate(stiffnesses):
            ends = [(i, sign) for i, sign in ((e - 1, -1), (e, 1)) if 0 <= i < n]
            for i, one in ends:
                for j, other in ends:
                    matrix[i, j] += one * other * mp.mpf(float(k)) / (root[i] * root[j])
        squares, vectors = mp.eigsy(matrix)
        for j in range(n):
            sign = next(mp.sign(vectors[i, j]) for i in range(n) if abs(vectors[i, j]) > 1e-8)
            for i in range(n):
                vectors[i, j] *= sign / root[i]
        return [mp.sqrt(abs(x)) for x in squares], vectors


def frequencies_below(
    masses: Sequence[float], stiffnesses: Sequence[float], frequency: float, factor: float
) -> int:
    """Return the number of natural frequencies of a chain below a frequency times a factor.

    These are the negative pivots of K - w^2 M (Sylvester), in 80 digits.
    """
    with mp.workdps(80):
        square = (mp.mpf(frequency) * mp.mpf(factor)) ** 2
        k = [mp.mpf(float(x)) for x in stiffnesses]
        count, pivot = 0, mp.inf
        for i, mass in enumerate(masses):
            pivot = k[i] + k[i + 1] - square * mp.mpf(float(mass)) - k[i] ** 2 / pivot
            count += pivot < 0
        return count


def as_doubles(matrix: mp.matrix) -> np.ndarray:
    """Return a matrix rounded to doubles."""
    return np.array([[float(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)])
