"""Families of data with figures. A module of drawings registers its family: words, drawings, and the default one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from vibroimpact.analysis.figures.window import View

FIRST = ("runs", "recordings")
"""Modules whose families are listed first: families that are no results of an analysis."""
ROOMS = ("motion", "sweep", "measured", "study", "orbits")
"""Packages of modules that draw, in the order in which kinds of figures are listed."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A kind of figure of one family of data."""

    draw: Callable[[Any, View], Figure]
    """Draws data; raises DatasetError where they lack variables of the figure."""
    fits: Callable[[Any], bool] = lambda data: True
    """Whether data have the variables of the figure."""
    takes: tuple[str, ...] = ()
    """Options: `run`, `recording`, `window`, `over`, `segment`, `variable`."""


@dataclass(frozen=True, slots=True)
class Family:
    """Data with the same kinds of figures."""

    name: str
    """Name; for results it is their attribute `results_kind`."""
    words: str
    """Name of such data in messages."""
    drawings: Mapping[str, Drawing]
    """Drawings by the kind of figure."""
    usual: str | Callable[[Any, View], str] = ""
    """Default kind of figure, or a function that returns it for data in a view; by default the first kind."""
    type: type | None = None
    """Type of the objects of this family, where they are no datasets."""
    is_of_results: bool = True
    """Whether the attribute `results_kind` of a dataset names this family."""

    def usual_kind(self, data: Any, view: View) -> str:
        """Return the default kind of figure for data."""
        usual = self.usual or next(iter(self.drawings))
        return usual if isinstance(usual, str) else usual(data, view)

    def fitting(self, data: Any) -> list[str]:
        """Return the kinds of figures that fit data of this family."""
        return [name for name, drawing in self.drawings.items() if drawing.fits(data)]


FAMILIES: dict[str, Family] = {}
"""All families by their names."""


def register(family: Family) -> None:
    """Add a family; a second family of the same name raises ValueError."""
    if family.name in FAMILIES:
        raise ValueError(f"figure: {family.name}: expected a family of another name, got one twice.")
    FAMILIES[family.name] = family


def register_results(name: str, words: str, draw: Callable[[Any], Figure], kind: str = "") -> None:
    """Add results with one kind of figure (named like the results, unless given) and no options."""
    register(Family(name, words, {kind or name: Drawing(whole(draw))}))


def whole(draw: Callable[[Any], Figure]) -> Callable[[Any, View], Figure]:
    """Return a drawing that ignores the view."""
    return lambda data, view: draw(data)


def load_families() -> None:
    """Import every module that draws; each module registers its families."""
    package = __name__.rpartition(".")[0]
    for name in FIRST:
        importlib.import_module(f"{package}.{name}")
    for room in ROOMS:
        folder = importlib.import_module(f"{package}.{room}")
        for module in pkgutil.iter_modules(folder.__path__):
            importlib.import_module(f"{package}.{room}.{module.name}")
