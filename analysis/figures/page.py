"""The page of all figures: one journal column wide, its style, its labels, and the writing of figures."""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vibroimpact.analysis.dataset.outputs import FIGURE_ENDINGS
from vibroimpact.analysis.figures.style import page_style as page_style
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.units import written_unit

Floats = npt.NDArray[np.float64]

_MM = 1 / 25.4
COLUMN_WIDTH = 85 * _MM
_DPI, _SCREEN_DPI = 300, 150
_SMALLEST, _LARGEST = 20, 1000
"""Limits of the side of a figure, mm."""
LINE = "#20567D"
MARK = "#D55E00"
STOP = "0.45"
# Distinguishable with every kind of colour vision (Okabe and Ito).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_OF_POINTS = re.compile(r"(displacement|velocity|acceleration|force) (of|on|between) ")
"""First words of the long names of motions and forces at points of several bodies."""
STOP_LINE: dict[str, Any] = {"color": STOP, "linestyle": "--", "linewidth": 0.6, "zorder": 0}


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure, whole or not at all; the ending of the name chooses the format (png, pdf, svg).

    Raises
    ------
    UsageError
        If the ending is another one.
    OSError
        If the file cannot be written.
    """
    ending = Path(path).suffix.lower()
    if ending not in FIGURE_ENDINGS:
        raise UsageError(
            f"{os.fspath(path)}: expected a name ending in {', '.join(FIGURE_ENDINGS)}, got {ending or 'none'!r}."
        )
    content = io.BytesIO()
    with page_style():
        figure.savefig(content, format=ending[1:], dpi=_DPI)
    write_atomically(path, content.getvalue())


def laid_out(figure: Figure, title: str | None, width: float | None, height: float | None) -> Figure:
    """Return a figure with a title and a size (mm); None keeps the present one.

    UsageError: panels have no room, or the title has a formula that cannot be set.
    """
    if title is not None:
        figure.suptitle(title, fontsize=8, wrap=True)
    for given in (width, height):
        if given is not None and not isinstance(given, int | float):
            raise UsageError(f"figure: size: expected numbers, mm, got {given!r}.")
    if width is not None or height is not None:
        size = [
            old if given is None else given * _MM
            for given, old in zip((width, height), figure.get_size_inches(), strict=True)
        ]
        in_mm = " x ".join(f"{inches / _MM:.4g}" for inches in size)
        if not all(_SMALLEST <= inches / _MM <= _LARGEST for inches in size):
            raise UsageError(f"figure: size: expected {_SMALLEST} to {_LARGEST} mm, got {in_mm} mm.")
        figure.set_size_inches(size[0], size[1])
    if title or width is not None or height is not None:
        _refuse_undrawable(figure, title)
    return figure


def _refuse_undrawable(figure: Figure, title: str | None) -> None:
    """Raise UsageError if panels lack room or the title's formula cannot be set; both show only in drawing."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about letters that the font lacks
        warnings.filterwarnings("error", message="constrained_layout not applied")
        try:
            figure.draw_without_rendering()
        except UserWarning:
            size = " x ".join(f"{inches / _MM:.4g}" for inches in figure.get_size_inches())
            raise UsageError(
                f"figure: size: expected room for {len(figure.axes)} panels, got {size} mm. Give more width or height."
            ) from None
        except ValueError as problem:
            if not title:
                raise
            raise UsageError(
                f"figure: title: expected text, formulas of matplotlib between dollar signs, got {title[:60]!r}. "
                "Write a dollar sign as \\$."
            ) from problem


def label(variable: xr.DataArray) -> str:
    """Return the axis label of a variable: its name, in words if it is the schema's, and its unit.

    >>> label(xr.DataArray(0.0, name="angular_frequency", attrs={"units": "rad s-1"}))
    'angular frequency (rad/s)'
    """
    return f"{title(variable)} ({unit_symbol(variable)})"


def title(variable: xr.DataArray) -> str:
    """Return the title of a variable: its name in its component, or its own name in words.

    Among several bodies it is the long name, which has their points: "displacement of frame - ball".
    """
    name, words = str(variable.name).replace("_", " "), str(variable.attrs.get("long_name", ""))
    if _OF_POINTS.match(words) and name.removeprefix("contact ").startswith(words.partition(" ")[0]):
        name = words.replace(" relative to ", " - ")
    return str(variable.attrs.get("component_variable") or name)


def unit_symbol(variable: xr.DataArray) -> str:
    """Return the unit of a variable as people write it."""
    return written_unit(str(variable.attrs.get("units", "1")))


def legend_above(axis: Axes, side: str = "left", *, ncols: int = 3, **options: Any) -> None:
    """Name the lines of a panel in rows above it, outside the data: on the left, in the center or on the right."""
    usual: dict[str, Any] = {"loc": f"lower {side}", "columnspacing": 1.0, "handlelength": 1.5}
    axis.legend(
        bbox_to_anchor=({"left": 0.0, "center": 0.5, "right": 1.0}[side], 1.0),
        borderaxespad=0.1,
        ncols=ncols,
        frameon=False,
        **(usual | options),
    )


def legend_outside(figure: Figure, axis: Axes, **options: Any) -> None:
    """Name the lines of a panel above all panels, outside the data: each name once."""
    handles, labels = axis.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    if entries:
        figure.legend(entries.values(), entries.keys(), loc="outside upper center", frameon=False, **options)


_GIVEN: ContextVar[list[Axes] | None] = ContextVar("axes that were given", default=None)
"""Axes in which `canvas` draws, instead of a figure of its own."""


@contextmanager
def drawing_into(axes: list[Axes]) -> Iterator[None]:
    """Direct all drawing inside the context into these axes."""
    token = _GIVEN.set(axes)
    try:
        yield
    finally:
        _GIVEN.reset(token)


class Page(Figure):
    """A figure of this package: a notebook shows it, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        with page_style():
            self.savefig(content, format="png", dpi=_SCREEN_DPI)
        return content.getvalue()


class _GivenAxes(Figure):
    """Replaces the figure of a drawing whose panels are axes of another program's figure."""

    def __init__(self, axes: list[Axes]) -> None:
        super().__init__()
        self._given = axes

    @property
    def given(self) -> list[Axes]:
        """The given axes."""
        return self._given

    def subplots(self, nrows: int = 1, ncols: int = 1, *, squeeze: bool = True, **_others: Any) -> Any:
        """Return the given axes in the requested shape; their shared axes and heights stay."""
        if len(self._given) != nrows * ncols:
            raise UsageError(
                f"figure: axes: expected {nrows * ncols} for the panels of this figure, got {len(self._given)}."
            )
        panels = np.array(self._given, dtype=object).reshape(nrows, ncols)
        return np.squeeze(panels)[()] if squeeze else panels

    def subfigures(self, *_sizes: Any, **_others: Any) -> Any:
        """Raise UsageError: subfigures are not axes."""
        raise UsageError(
            "figure: axes: expected a kind whose panels are axes, got one that is made of parts. Use draw."
        )

    def legend(self, *entries: Any, **options: Any) -> Any:
        """Put the legend above the first panel."""
        options |= {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.1}
        first = self._given[0]
        named = entries or "handles" in options
        return first.legend(*(entries if named else first.get_legend_handles_labels()), **options)

    def suptitle(self, t: str, **options: Any) -> Any:
        """Leave the title to the owner of the figure."""
        return self._given[0].title

    def align_ylabels(self, axs: Any = None) -> None:
        """Leave the labels where they are."""


def axes_of(figure: Figure) -> list[Axes]:
    """Return the axes of a figure, or the given axes that replace it, see `drawing_into`."""
    return figure.given if isinstance(figure, _GivenAxes) else figure.axes


def canvas(height_mm: float, width: float = COLUMN_WIDTH) -> Figure:
    """Return an empty figure that needs no display, or the replacement for given axes, see `drawing_into`."""
    given = _GIVEN.get()
    if given is not None:
        return _GivenAxes(given)
    figure = Page(figsize=(width, height_mm * _MM), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
