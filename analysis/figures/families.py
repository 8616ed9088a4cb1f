"""Families of data that are drawn. A module of drawings registers its family: words, drawings, and the usual one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from matplotlib.figure import Figure

from vibroimpact.analysis.figures.window import View

ROOMS = ("motion", "sweep", "measured", "study", "orbits")
"""Rooms whose modules register families, in the order in which kinds of figures are listed."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A kind of figure of one family of data.

    Attributes
    ----------
    draw : callable
        Draws data, or raises a DatasetError where they do not hold what the figure shows.
    fits : callable
        Whether data hold what the figure shows.
    takes : tuple of str
        Options: `run`, `recording`, `window`, `over`, `segment`, `variable`.
    """

    draw: Callable[[Any, View], Figure]
    fits: Callable[[Any], bool] = lambda data: True
    takes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Family:
    """Data that are drawn alike.

    Attributes
    ----------
    name : str
        Of results: their attribute `results_kind`.
    words : str
        What messages call such data.
    drawings : mapping of str to Drawing
        By the kind of figure; the first is the usual one.
    usual : callable, optional
        The usual kind of figure of data in a view, where it depends on them.
    type : type, optional
        Objects that are of this family, where it is none of results.
    """

    name: str
    words: str
    drawings: Mapping[str, Drawing]
    usual: Callable[[Any, View], str] | None = None
    type: type | None = None
    is_of_results: bool = field(default=True, kw_only=True)

    def usual_kind(self, data: Any, view: View) -> str:
        """Return the kind of figure that says most of data."""
        return next(iter(self.drawings)) if self.usual is None else self.usual(data, view)

    def fitting(self, data: Any) -> list[str]:
        """Return the kinds of figures that fit data of this family."""
        return [name for name, drawing in self.drawings.items() if drawing.fits(data)]


FAMILIES: dict[str, Family] = {}
"""By their names."""


def register(family: Family) -> None:
    """Take a family up; a second one of its name is a mistake.

    Raises
    ------
    ValueError
        There is a family of this name.
    """
    if family.name in FAMILIES:
        raise ValueError(f"figure: {family.name}: expected a family of another name, got one twice.")
    FAMILIES[family.name] = family


def load_families() -> None:
    """Import every module that draws: each registers its families."""
    package = __name__.rpartition(".")[0]
    for room in ROOMS:
        folder = importlib.import_module(f"{package}.{room}")
        for module in pkgutil.iter_modules(folder.__path__):
            importlib.import_module(f"{package}.{room}.{module.name}")
