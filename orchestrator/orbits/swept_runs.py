"""Runs of a scene over one or two of its numbers, each with its class; over one number the runs go both ways."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.orbits.classify import ClassesOfDataset, with_classes
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.errors import DatasetError, SceneError, UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.file import parse_scene_toml
from vibroimpact.orchestrator.scene.sweep import SweepAxis, log_axis

VALUES, VALUES_OF_TWO = 401, (121, 81)
"""Default numbers of values: of one parameter, and of each of two."""
MOST_RUNS = 1_000_000
EVEN = 1e-9
"""Difference of the steps of an axis, over its range, up to which its values are evenly spaced."""
CLASSIFIED_PERIODS, EXPONENT_PERIODS = 40, 400
"""Fewest recorded periods: chaos is told from 40, and 200 of its impacts, which exponents need, take some 400."""


class Axis(NamedTuple):
    """A varied number of a scene: its key, the ends of its range, and the number of values.

    `listed` has the values, ascending, where they are not evenly spaced.
    """

    key: str
    low: float
    high: float
    values: int
    listed: tuple[float, ...] = ()

    @classmethod
    def of(cls, key: str, start: float, stop: float, values: int) -> Axis:
        """Return the axis of a range given in either direction; UsageError unless it is one of several values."""
        if not (math.isfinite(start) and math.isfinite(stop) and start != stop):
            raise UsageError(
                f"diagram: {key}: expected a range of two different numbers, got {start:g} and {stop:g}."
            )
        if not 2 <= values <= MOST_RUNS:
            raise UsageError(f"diagram: {key}: expected 2 to {MOST_RUNS} values, got {values}.")
        return cls(key, min(start, stop), max(start, stop), values)

    @property
    def middle(self) -> float:
        """Middle of the range."""
        return 0.5 * (self.low + self.high)


Range = tuple[str | None, float | None, float | None, int | None]
"""Key, ends and number of values as they were given; None where they were not."""


def axes_of(scene: Scene, first: Range, second: Range) -> list[Axis]:
    """Return the axes of given ranges, or without any those of the scene's own sweep.

    UsageError: a range is incomplete or has one value, a second range has no first, or the scene has no such sweep.
    """
    given = [_is_given(each, name) for each, name in ((first, ""), (second, "second-"))]
    if not any(given):
        return _axes_of_sweep(scene, first[3], second[3])
    if not given[0]:
        raise UsageError("--second: expected --parameter as well, got --second alone.")
    counts = VALUES_OF_TWO if given[1] else (VALUES,)
    axes = [
        Axis.of(str(key), float(start or 0.0), float(stop or 0.0), usual if values is None else values)
        for (key, start, stop, values), usual in zip((first, second), counts, strict=False)
    ]
    return _refused_if_many(axes)


def _is_given(given: Range, name: str) -> bool:
    """Return whether a range is given; UsageError where it is given in part."""
    parts = [each is not None for each in given[:3]]
    if any(parts) and not all(parts):
        key = "second" if name else "parameter"
        raise UsageError(
            f"--{key}: expected --{key}, --{name}from and --{name}to together, got some of them."
        )
    return all(parts)


def _axes_of_sweep(scene: Scene, values: int | None, second_values: int | None) -> list[Axis]:
    """Return the axes of the scene's own sweep, with other numbers of values where these are given."""
    sweep = scene.sweep
    if len(sweep) not in (1, 2) or any(axis.together for axis in sweep):
        raise UsageError(
            f"{scene.source}: diagram: expected a sweep of one or two keys, or a range, got neither. "
            "Give --parameter KEY --from FIRST --to LAST."
        )
    counts = [
        len(axis.values) if count is None else count
        for axis, count in zip(sweep, (values, second_values), strict=False)
    ]
    return _refused_if_many(
        [
            Axis.of(axis.key, axis.lowest, axis.highest, count)._replace(listed=_uneven(axis, count))
            for axis, count in zip(sweep, counts, strict=True)
        ]
    )


def _uneven(axis: SweepAxis, count: int) -> tuple[float, ...]:
    """Return the values of an axis that are not evenly spaced; with another number of them where ratios are equal."""
    values = np.sort(axis.values)
    if count < 3 or values.size < 3 or np.ptp(np.diff(values)) <= EVEN * np.ptp(values):
        return ()
    if count == values.size:
        return tuple(values.tolist())
    if values[0] * values[-1] > 0.0 and np.ptp(np.diff(np.log(np.abs(values)))) <= EVEN:
        return tuple(log_axis(axis.key, float(values[0]), float(values[-1]), count, "independent").values)
    return ()


def _refused_if_many(axes: list[Axis]) -> list[Axis]:
    if len({axis.key for axis in axes}) < len(axes):
        raise UsageError(f"--second: expected another number of the scene than {axes[0].key}, got the same.")
    many = math.prod(axis.values for axis in axes)
    if many > MOST_RUNS:
        raise UsageError(f"diagram: values: expected {MOST_RUNS} runs at most, got {many}.")
    return axes


class _StatusProgress(Progress):
    """Shows the progress of a campaign as the status of a study."""

    def __init__(self, show: Callable[[str], None]) -> None:
        super().__init__()
        self._show = show

    def advance(self, points: int) -> None:
        """Count more points as done, and show their number."""
        super().advance(points)
        self._show(f"{self._done} of {self._total} runs")


@dataclass(eq=False)
class SweptRuns(Study[xr.Dataset]):
    """Runs of a scene over one axis, up and down where states are carried, or over two. The only row has all runs."""

    name = "sweep"
    nothing = "a run"

    scene: Scene
    axes: Sequence[Axis]
    recorded_periods: int = CLASSIFIED_PERIODS

    def __post_init__(self) -> None:
        self.scene = _swept(_recording(self.scene, self.recorded_periods), self.axes)

    @classmethod
    def prepare(cls, options: Any, stack: Any) -> None:
        """Return None: the runs are a part of another study."""

    def rows(self) -> Generator[xr.Dataset, None, None]:
        """Run all points as a campaign, and classify the runs."""
        with ScratchFolder("diagram") as folder:
            report = run_campaign(
                self.scene, Path(folder.name, "sweep"), progress=_StatusProgress(self.status), format="netcdf"
            )
            flat = read_flat(Path(str(report.dataset)))
        opened = opened_in_memory(flat)
        self.unclassified, self.classes = "", ClassesOfDataset(opened)
        try:
            whole(self.classes)
        except DatasetError as problem:
            self.unclassified = str(problem)
        else:
            flat = with_classes(flat, self.classes.classes, self.scene.units)
        yield flat

    def made(self) -> xr.Dataset:
        """Return the runs one after the other."""
        return self.found[0]

    def print_results(self) -> None:
        """Print the number of runs of each class."""
        if self.unclassified:
            say(f"No classes of the runs: {self.unclassified}")
        else:
            self.classes.print_results()


def _swept(scene: Scene, axes: Sequence[Axis]) -> Scene:
    """Return a scene that sweeps one axis both ways, if it can carry states along it, or one or two from its start."""
    sweep: dict[str, dict[str, Any]] = {
        axis.key: {"values": list(axis.listed)}
        if axis.listed
        else {"start": axis.low, "stop": axis.high, "points": axis.values}
        for axis in axes
    }
    if len(axes) == 1:
        with suppress(SceneError):  # components, and numbers that change the modes of a structure
            return scene.with_sweep({key: axis | {"path": "up-down"} for key, axis in sweep.items()})
    return scene.with_sweep(sweep)


def _recording(scene: Scene, periods: int) -> Scene:
    """Return a scene that records what classes and exponents need in enough periods, and no time series."""
    if not scene.is_one_body or scene.period is None:
        return scene
    record = dict(parse_scene_toml(scene.text, scene.source)["record"])
    record.pop("time_series", None)
    needed = dict.fromkeys(("impacts", "extrema", "strobe", "each_period"), True)
    enough = max(periods, scene.record.recorded_periods)
    return scene.with_values({"record": {**record, **needed, "recorded_periods": enough}})
