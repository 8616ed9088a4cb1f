"""The study of the shares of basins over a parameter of a scene."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.orbits.attractors.basins import MOST_PERIODS, Basins
from vibroimpact.analysis.orbits.attractors.continued import Continued
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.basins import Basins as Options
from vibroimpact.orchestrator.orbits.basins import HISTORY, BasinsOfScene, attractor_values
from vibroimpact.orchestrator.orbits.further_sines import strobed_body
from vibroimpact.orchestrator.orbits.planes import Plane, Span, plane_of, spans_of
from vibroimpact.orchestrator.run.dataset import cf_unit
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

VALUES, MOST_VALUES = 21, 10_000
"""Default and largest number of values of the parameter."""
TABLE = ResultTable(
    "basin_shares",
    ("parameter", "parameter", "{unit}", "{key}"),
    ("attractor_name", "attractor", "1", "classes that it has over the parameter", "text"),
    (
        "attractor_class",
        "parameter attractor",
        "1",
        "class at this value; empty where it is not there",
        "text",
    ),
    ("basin_fraction", "parameter attractor", "1", "share of the starts that end on it"),
    ("basin_fraction_low", "parameter attractor", "1", "lower end of the 95 % confidence interval"),
    ("basin_fraction_high", "parameter attractor", "1", "upper end of the 95 % confidence interval"),
    ("attractor_impacts", "parameter attractor stop", "1", "mean number of impacts in a forcing period"),
    ("decided", "parameter", "1", "share of the starts with a known end"),
    (
        "missed_share_below",
        "parameter",
        "1",
        "largest share of an attractor that was missed, 95 % confidence",
    ),
)
CONTINUED = ("basin_fraction", "basin_fraction_low", "basin_fraction_high", "attractor_impacts")
"""Variables of each value that the dataset has over all values."""


@dataclass(eq=False)
class BasinShares(Study[Basins]):
    """Shares of the attractors of a scene over one of its numbers. A row has the basins at one value."""

    name = "basins"
    nothing = "a value"
    begins = "Looking for attractors"
    history = HISTORY
    interruption = "Interrupted: the above is what was found."

    scene: Scene
    plane: Plane
    parameter: str
    ends: tuple[float, float]
    values: int = VALUES
    periods: int = MOST_PERIODS

    def __post_init__(self) -> None:
        self.plane.refuse()
        if not (np.isfinite(self.ends).all() and self.ends[0] != self.ends[1]):
            got = f"{self.ends[0]:g} to {self.ends[1]:g}"
            raise UsageError(f"basins: parameter: expected a range of two finite numbers, got {got}.")
        if not 2 <= self.values <= MOST_VALUES:
            raise UsageError(f"basins: values: expected 2 to {MOST_VALUES}, got {self.values}.")
        self.scene = self.scene.unswept([self.parameter])
        self.continued = Continued()
        self.at = np.linspace(*self.ends, self.values)

    @classmethod
    def prepare(cls, options: Options, stack: ExitStack) -> Study[Any]:
        """Open the scene; without a parameter the study is that of one plane."""
        ends = _range_of(options)
        if options.parameter is None or ends is None:
            return BasinsOfScene.prepare(options, stack)
        if options.edges:
            raise UsageError(
                "--edges: expected no --parameter beside it, got both. Follow edges at one value."
            )
        scene = opened_scene(options.scene, options.changes or ())
        return cls(scene, plane_of(options), options.parameter, ends, options.values, options.periods)

    def rows(self) -> Generator[Basins, None, None]:
        """Find the basins of value after value, in one plane of starts."""
        scenes = [self.scene.with_values({self.parameter: float(value)}) for value in self.at]
        plane = _joint(scenes, self.plane)
        for value, scene in zip(self.at, scenes, strict=True):
            self.status(f"{self.parameter} {value:.6g}")
            found = whole(BasinsOfScene(scene, plane, self.periods)).known
            self.continued.add(found)
            yield found

    def made(self) -> xr.Dataset:
        """Return the shares over the values found so far."""
        continued, stops = self.continued, len(self.scene.stops)
        count, attractors = len(continued.basins), len(continued.last)
        tables: dict[str, Any] = {
            name: np.zeros((count, attractors, *([stops] if name == "attractor_impacts" else [])))
            for name in CONTINUED
        }
        classes = np.full((count, attractors), "", object)
        for row, (found, numbers) in enumerate(zip(continued.basins, continued.numbers, strict=True)):
            values = attractor_values(found, None, stops)
            for name in CONTINUED:
                tables[name][row, numbers] = values[name]
            classes[row, numbers] = [each.name for each in found.attractors]
        values = {
            "parameter": self.at[:count],
            "attractor_name": continued.names,
            "attractor_class": classes,
            **tables,
            "decided": np.array([found.decided for found in continued.basins]),
            "missed_share_below": np.array([found.missed_share_below for found in continued.basins]),
        }
        attributes = scene_attributes(self.scene, HISTORY) | {
            "units_system": self.scene.units,
            "most_periods": self.periods,
        }
        unit = cf_unit(self.scene, self.parameter) or "1"
        return TABLE.dataset(values, attributes, units=self.scene.units, unit=unit, key=self.parameter)

    def print_results(self) -> None:
        """Print the shares at each value."""
        data = self.dataset
        names = [str(name) for name in data["attractor_name"].values]
        rows = table(
            f"Shares of basins: {self.scene.title or self.scene.source}",
            f">{self.parameter}",
            *(f">{name}" for name in names),
            ">undecided",
        )
        for place, value in enumerate(data["parameter"].values):
            shares = data["basin_fraction"].values[place]
            left = 1.0 - float(data["decided"].values[place])
            row = [f"{100.0 * share:.2f} %" if share > 0.0 else "" for share in shares]
            rows.add_row(f"{value:.6g}", *row, f"{100.0 * left:.3g} %" if left > 0.0 else "")
        wide_terminal().print(rows)
        missed = float(data["missed_share_below"].max())
        say(
            f"An attractor that was missed has less than {100.0 * missed:.2g} % of the plane at each value "
            "(95 % confidence)."
        )


def _range_of(options: Options) -> tuple[float, float] | None:
    """Return the range of the parameter; None without a parameter. UsageError: it is incomplete."""
    given = (options.parameter is not None, options.start is not None, options.stop is not None)
    if any(given) and not all(given):
        raise UsageError("--parameter: expected --parameter, --from and --to together, got some of them.")
    return None if options.start is None or options.stop is None else (options.start, options.stop)


def _joint(scenes: list[Scene], plane: Plane) -> Plane:
    """Return a plane that holds the planes of all scenes."""
    spans: list[tuple[Span, Span]] = [spans_of(each, strobed_body(each), plane)[0] for each in scenes]
    x, y = ((min(each[axis][0] for each in spans), max(each[axis][1] for each in spans)) for axis in (0, 1))
    return Plane(x, y, plane.points, plane.number)
