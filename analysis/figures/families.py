"""Families of data that are drawn. A module of drawings registers its family: words, drawings, and the usual one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from vibroimpact.analysis.figures.window import View

FIRST = ("runs", "recordings")
"""Modules whose families are listed first: those of what is no result of an analysis."""
ROOMS = ("motion", "sweep", "measured", "study", "orbits")
"""Rooms of modules that draw, in the order in which kinds of figures are listed."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A kind of figure of one family of data."""

    draw: Callable[[Any, View], Figure]
    """Draws data, or raises a DatasetError where they do not hold what the figure shows."""
    fits: Callable[[Any], bool] = lambda data: True
    """Whether data hold what the figure shows."""
    takes: tuple[str, ...] = ()
    """Options: `run`, `recording`, `window`, `over`, `segment`, `variable`."""


@dataclass(frozen=True, slots=True)
class Family:
    """Data that are drawn alike."""

    name: str
    """Name; of results it is their attribute `results_kind`."""
    words: str
    """What messages call such data."""
    drawings: Mapping[str, Drawing]
    """By the kind of figure."""
    usual: str | Callable[[Any, View], str] = ""
    """The kind of figure that says most, or returns it of data in a view; by default the first."""
    type: type | None = None
    """Objects that are of this family, where it is none of results."""
    is_of_results: bool = True
    """Whether the attribute `results_kind` of a dataset names this family."""

    def usual_kind(self, data: Any, view: View) -> str:
        """Return the kind of figure that says most of data."""
        usual = self.usual or next(iter(self.drawings))
        return usual if isinstance(usual, str) else usual(data, view)

    def fitting(self, data: Any) -> list[str]:
        """Return the kinds of figures that fit data of this family."""
        return [name for name, drawing in self.drawings.items() if drawing.fits(data)]


FAMILIES: dict[str, Family] = {}
"""By their names."""


def register(family: Family) -> None:
    """Take a family up; a second one of its name raises ValueError."""
    if family.name in FAMILIES:
        raise ValueError(f"figure: {family.name}: expected a family of another name, got one twice.")
    FAMILIES[family.name] = family


def register_results(name: str, words: str, draw: Callable[[Any], Figure], kind: str = "") -> None:
    """Take up results with one kind of figure, which has their name unless it is said, and no options."""
    register(Family(name, words, {kind or name: Drawing(whole(draw))}))


def whole(draw: Callable[[Any], Figure]) -> Callable[[Any, View], Figure]:
    """Return what draws data whatever the view is."""
    return lambda data, view: draw(data)


def load_families() -> None:
    """Import every module that draws: each registers its families."""
    package = __name__.rpartition(".")[0]
    for name in FIRST:
        importlib.import_module(f"{package}.{name}")
    for room in ROOMS:
        folder = importlib.import_module(f"{package}.{room}")
        for module in pkgutil.iter_modules(folder.__path__):
            importlib.import_module(f"{package}.{room}.{module.name}")
