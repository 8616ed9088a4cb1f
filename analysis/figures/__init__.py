"""Figures for one journal column: sweeps, single runs, recordings, replays, estimates, cost of accuracy.

The only package that imports matplotlib; it draws without a display.
"""

from __future__ import annotations

from vibroimpact.analysis.figures.style import page_style

# isort: split
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.kinds import KINDS, Result, draw_view
from vibroimpact.analysis.figures.measured.planned_drive import draw_planned_drive
from vibroimpact.analysis.figures.page import COLUMN_WIDTH, drawing_into, label, laid_out, save
from vibroimpact.analysis.figures.study.ladder import convergence, work_precision
from vibroimpact.analysis.figures.window import View, Window
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import UsageError

__all__ = [
    "COLUMN_WIDTH",
    "KINDS",
    "Figure",
    "convergence",
    "draw",
    "draw_into",
    "draw_planned_drive",
    "label",
    "save",
    "work_precision",
]


def draw(
    data: xr.Dataset | Recording | Result,
    kind: str = "auto",
    run: int | None = None,
    *,
    recording: str | None = None,
    start: float | None = None,
    stop: float | None = None,
    periods: float | None = None,
    over: xr.Dataset | None = None,
    segment: int | None = None,
    variable: str | None = None,
    title: str | None = None,
    width: float | None = None,
    height: float | None = None,
) -> Figure:
    """Draw the contents of a file of this package; `vibroimpact plot` does the same with options of these names.

    Parameters
    ----------
    data : xarray.Dataset, Recording, or a result with a dataset
        Data in memory: `open_dataset` gives a dataset of runs, `open_measured` results of an analysis or a benchmark,
        `open_recording` a recording, `find_orbits` orbits, `classify` classes. Results of any function of `vi` fit.
    kind : str
        `auto`, or one of `KINDS`. For a dataset of runs, auto draws one run where nothing is swept or a run is named. A
        sweep becomes a bifurcation diagram, two swept parameters become colour maps, a campaign of replays its scores.
        All other data have a figure of their own.
    run : int, optional
        `run_index` of the run to draw.
    recording : str, optional
        Which comparison of a replay: the file of its recording, or its name.
    start, stop : float, optional
        Window of time, s (`--from`, `--to`).
    periods : float, optional
        Length of the window in forcing periods, from `start` on or up to `stop`.
    over : xarray.Dataset, optional
        Another sweep of the same parameter, drawn below this one: a measured sweep over the simulated one.
    segment : int, optional
        Samples of a segment for a density, a power of two.
    variable : str, optional
        Variable of a bifurcation diagram or of branches, over the swept parameter: `displacement_max`,
        `strobe_displacement`, `impact_phase` and others. Default: displacement range and impact velocity.
    title : str, optional
        Text above the figure. Default: none, as journals want it; a ladder has the title of its dataset. "": none.
    width, height : float, optional
        mm. Default: one column (85 mm), and the height that the panels need.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    DatasetError
        If the data lack variables of this figure; the message names the kinds that fit.
    UsageError
        If an option does not apply, the window is empty or the size too small.

    Examples
    --------
    >>> dataset = open_dataset("campaign")                                             # doctest: +SKIP
    >>> save(draw(dataset, "strobe", run=3, width=120.0), "section.pdf")               # doctest: +SKIP
    """
    view = View(run, recording, Window(start, stop, periods), over, segment, variable)
    with page_style():
        return laid_out(draw_view(data, kind, view), title, width, height)


T = TypeVar("T", bound=Axes | Sequence[Axes] | npt.NDArray[Any])


def draw_into(
    axes: T,
    data: xr.Dataset | Recording | Result,
    kind: str = "auto",
    run: int | None = None,
    *,
    recording: str | None = None,
    start: float | None = None,
    stop: float | None = None,
    periods: float | None = None,
    over: xr.Dataset | None = None,
    segment: int | None = None,
    variable: str | None = None,
) -> T:
    """Draw into existing axes, in their own style, and return them.

    Parameters
    ----------
    axes : Axes, or sequence or array of Axes
        As many as the figure has panels, row by row.
    data, kind, run, recording, start, stop, periods, over, segment, variable
        See `draw`.

    Raises
    ------
    DatasetError
        If the data lack variables of this figure; the message names the kinds that fit.
    UsageError
        If an option does not apply, the window is empty, or the number of axes differs from the number of panels.

    Examples
    --------
    >>> figure, (left, right) = plt.subplots(1, 2)                                         # doctest: +SKIP
    >>> draw_into(left, dataset, "portrait", run=3)                                        # doctest: +SKIP
    """
    given = [axes] if isinstance(axes, Axes) else list(np.asarray(axes, dtype=object).ravel())
    if not given or not all(isinstance(one, Axes) for one in given):
        raise UsageError(
            f"figure: axes: expected axes of matplotlib, got {type(axes).__name__}. Make some: plt.subplots()."
        )
    with drawing_into(given):
        draw_view(data, kind, View(run, recording, Window(start, stop, periods), over, segment, variable))
    return axes
