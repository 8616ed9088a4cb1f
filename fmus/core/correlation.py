"""Interface of the C function that counts near pairs of delay vectors: exact, all embeddings in one pass."""

from __future__ import annotations

import ctypes
import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]

RADII_PER_OCTAVE = 8
MOST_RADII = 126
MOST_EMBEDDING = 16
# Number of pairs below which a second thread costs more than it saves.
_WORTH_A_THREAD = 2_000_000


def radius_ladder(lowest: float, highest: float) -> Array:
    """Return the radii 2^e (1 + k/8) from the last one <= `lowest` to the first one >= `highest`.

    There are eight radii an octave, exact in floating point: the leading bits of a distance give its place among them.

    Raises
    ------
    UsageError
        The ladder would have more than 126 radii (15 octaves), or not 0 < lowest < highest.

    Examples
    --------
    >>> radius_ladder(0.5, 1.0).tolist()
    [0.5, 0.5625, 0.625, 0.6875, 0.75, 0.8125, 0.875, 0.9375, 1.0]
    """
    if not (1e-300 <= lowest < highest <= 1e150):
        raise UsageError(
            f"radii: expected 1e-300 <= lowest < highest <= 1e150, got {lowest:g} and {highest:g}."
        )
    first, last = _step(lowest, up=False), _step(highest, up=True)
    if last - first + 1 > MOST_RADII:
        raise UsageError(
            f"radii: expected at most {MOST_RADII} ({MOST_RADII // RADII_PER_OCTAVE} octaves), "
            f"got {last - first + 1}."
        )
    octave, place = np.divmod(np.arange(first, last + 1), RADII_PER_OCTAVE)
    return np.ldexp(1.0 + place / RADII_PER_OCTAVE, octave)


def near_pairs(
    values: Array, radii: Array, embedding: int, *, window: int = 0, threads: int | None = None
) -> NDArray[np.int64]:
    """Return the number of pairs of delay vectors nearer than each radius, in every embedding.

    Counted are the pairs i < j with j - i > `window` and max_{a < m} |x_{i+a} - x_{j+a}| < radius: thesis 5.4.2, with
    the max norm. No vector is paired with itself, and no pair counts twice.

    Parameters
    ----------
    values : ndarray of float, shape (n,)
        x; NaN marks a gap that no vector may cross.
    radii : ndarray of float, shape (radius,)
        From `radius_ladder`.
    embedding : int
        Largest m, 1 to 16.
    window : int
        Theiler's window: pairs at most this far apart in order do not count; 0: all pairs count.
    threads : int, optional
        Number of threads; by default the number of processors, at most 8.

    Returns
    -------
    ndarray of int, shape (embedding, radius)

    Raises
    ------
    UsageError
        An argument is out of its range.

    Examples
    --------
    >>> near_pairs(np.array([0.0, 0.5, 1.0, 0.25]), radius_ladder(0.25, 1.0), 1)[0, [0, 1, -1]].tolist()
    [0, 2, 5]
    """
    _check(radii, embedding, window)
    number = len(values)
    workers = threads or min(os.cpu_count() or 1, 8)
    if number * number < 2 * _WORTH_A_THREAD:
        workers = 1
    with ThreadPoolExecutor(workers) as pool:
        tasks = [
            pool.submit(_tables, values, radii, embedding, window + 1 + k, workers) for k in range(workers)
        ]
        tables = sum(task.result() for task in tasks)
    return _marginals(np.asarray(tables), embedding)


def _tables(values: Array, radii: Array, embedding: int, first: int, step: int) -> NDArray[np.uint64]:
    """Return numbers of pairs by the classes of their distances in two successive embeddings, every `step`-th lag."""
    library = core_library()
    library.vi_door_correlation_padding.restype = ctypes.c_size_t
    library.vi_door_correlation_tables.restype = ctypes.c_size_t
    padded = np.full(len(values) + library.vi_door_correlation_padding(), np.nan)
    padded[: len(values)] = np.where(np.isfinite(values), values, np.nan)
    stride = len(radii) + 1
    shape = (library.vi_door_correlation_tables(), (embedding + 1) // 2, stride, stride)
    joint = np.zeros(shape, dtype=np.uint64)
    size = ctypes.c_size_t
    status = library.vi_door_correlation_add(
        padded.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), size(len(values)), size(first),
        size(len(values)), size(step), ctypes.c_int(embedding), ctypes.c_double(float(radii[0])),
        ctypes.c_int(len(radii)), joint.ctypes.data_as(ctypes.POINTER(ctypes.c_uint64)),
    )  # fmt: skip
    if status != 0:
        raise UsageError("near_pairs: expected the radii of a ladder, got others.")
    return np.asarray(joint.sum(axis=0))


def _marginals(tables: NDArray[np.uint64], embedding: int) -> NDArray[np.int64]:
    # class k: at least k radii are <= the distance; so k <= j means nearer than radius j
    odd, even = tables.sum(axis=1), tables.sum(axis=2)
    by_embedding = np.stack([odd, even], axis=1).reshape(-1, tables.shape[1])[:embedding]
    return np.cumsum(by_embedding, axis=1)[:, :-1].astype(np.int64)


def _step(radius: float, *, up: bool) -> int:
    """Return the number of the last ladder radius <= a given one, or of the first one >= it; 0 is radius 1."""
    fraction, exponent = math.frexp(radius)
    place = (2.0 * fraction - 1.0) * RADII_PER_OCTAVE
    return (exponent - 1) * RADII_PER_OCTAVE + (math.ceil(place) if up else math.floor(place))


def _check(radii: Array, embedding: int, window: int) -> None:
    if not 1 <= embedding <= MOST_EMBEDDING:
        raise UsageError(f"near_pairs: embedding: expected 1 to {MOST_EMBEDDING}, got {embedding}.")
    if window < 0:
        raise UsageError(f"near_pairs: window: expected 0 or more, got {window}.")
    if len(radii) < 2 or not np.array_equal(radii, radius_ladder(radii[0], radii[-1])):
        raise UsageError("near_pairs: radii: expected those of radius_ladder, got others.")
