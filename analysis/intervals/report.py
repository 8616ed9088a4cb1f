"""The report on a train of events: all its statistics in one dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from vibroimpact.analysis.dataset.results import Row, described
from vibroimpact.analysis.intervals.cycles import Cycle, cycle_of_lattice, read_cycle
from vibroimpact.analysis.intervals.density import interval_density
from vibroimpact.analysis.intervals.dimension import EMBEDDING, SCALES, THEILER, interval_dimension
from vibroimpact.analysis.intervals.gaps import find_gaps
from vibroimpact.analysis.intervals.lattice import Lattice, interval_lattice
from vibroimpact.analysis.intervals.report_parts import (
    density_part,
    gap_part,
    interval_part,
    lattice_part,
    variability_part,
)
from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain, Span, interval_train
from vibroimpact.fmus.core import MOST_EMBEDDING
from vibroimpact.fmus.errors import UsageError


def interval_report(
    times: Floats,
    *,
    window: Span | None = None,
    masked: Sequence[Span] = (),
    forcing_period: float | None = None,
    resolution: float = 0.0,
    count_bin: float | None = None,
    embedding: int = EMBEDDING,
    theiler: int = THEILER,
    seed: int = 0,
) -> xr.Dataset:
    """Return the statistics of the intervals of a train of events.

    Parameters
    ----------
    times : ndarray of float, shape (event,)
        s, ascending; two may coincide.
    window : tuple of float, optional
        Start and end of the observation, s; by default the first and the last event.
    masked : sequence of (float, float)
        Spans (start, end) of no observation, s; see `seams`.
    forcing_period : float, optional
        s; needed to read q of a P(p,q) motion.
    resolution : float
        Grid on which the instants were written, s; 0 where none shows.
    count_bin : float, optional
        Bin of the Fano factor, s; by default the mean interval, rounded to one digit.
    embedding, theiler : int
        Parameters of the correlation sums. The embedding is the largest number of intervals in a delay vector, 2 to
        16. Pairs of vectors at most `theiler` places apart do not count.
    seed : int
        Seed of the shuffled surrogates.

    Returns
    -------
    xarray.Dataset
        Intervals, rate, coefficient of variation, Fano factors; densities; gaps; lattice rates. Also correlation sums
        of raw intervals and of their logarithms, with surrogates. The attributes `cycle`, `lattice`, `gaps`,
        `dimension_raw` and `dimension_log` have the verdicts in words, or the reasons for a refusal. Limits of the
        last two are in `dimension_raw_warnings` and `dimension_log_warnings`.

    Raises
    ------
    EstimationError
        There are fewer than three events, all are at one instant, or every interval is masked.
    UsageError
        An argument is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> report = interval_report(np.arange(0.0, 50.0, 0.5), forcing_period=0.5)
    >>> float(report["rate"]), report.attrs["cycle"][:6]
    (2.0, 'P(1,1)')
    """
    for name, value in (("forcing_period", forcing_period), ("count_bin", count_bin)):
        if value is not None and not 0.0 < value < float("inf"):
            raise UsageError(f"intervals: {name}: expected more than 0 s, got {value}.")
    if not 2 <= embedding <= MOST_EMBEDDING or theiler < 0:
        raise UsageError(
            f"intervals: expected an embedding from 2 to {MOST_EMBEDDING} and a Theiler window of 0 or more, "
            f"got {embedding} and {theiler}."
        )
    train = interval_train(times, window=window, masked=masked, resolution=resolution)
    density = interval_density(train.intervals, resolution=resolution)
    cycle, lattice = read_motion(train, forcing_period)
    gaps, gap_words = gap_part(train, find_gaps(train))
    on_lattice, lattice_words = lattice_part(train, lattice)
    rows: dict[str, Row] = {
        **interval_part(train),
        **variability_part(train, count_bin),
        **density_part(density, cycle),
        **gaps,
        **on_lattice,
    }
    attributes: dict[str, Any] = {"cycle": cycle.words, "gaps": gap_words, "lattice": lattice_words}
    for scale in SCALES:
        slopes, verdicts = interval_dimension(train, scale, embedding=embedding, theiler=theiler, seed=seed)
        rows |= slopes
        attributes |= verdicts
    attributes |= {
        "events": len(train.times),
        "window": [float(edge) for edge in train.window],
        "window_from": "given" if train.stated else "first and last event",
        "masked_spans": len(train.masked),
        "resolution": resolution,
        "forcing_period": forcing_period or 0.0,
        "seed": seed,
    }
    return xr.Dataset(described(rows), attrs={"results_kind": "spikes", **attributes})


def read_motion(train: IntervalTrain, forcing_period: float | None) -> tuple[Cycle, Lattice]:
    """Return the motion behind the intervals, and the lattice if it has one spike per cycle.

    Intervals that repeat after two or more form no single lattice. With missed spikes a lattice often never repeats,
    and the motion is read from the lattice.
    """
    cycle = read_cycle(train, forcing_period)
    if cycle.impacts > 1:
        return cycle, Lattice(reason=f"no single lattice: the intervals repeat after {cycle.impacts}")
    lattice = interval_lattice(train)
    if not cycle.impacts and not lattice.reason:
        return cycle_of_lattice(lattice, forcing_period), lattice
    return cycle, lattice
