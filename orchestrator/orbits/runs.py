"""The runs of a dataset of impacting bodies: the scene, and the body and impacts of each run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import dataset_place, open_dataset
from vibroimpact.analysis.dataset.outputs import DATASET_ENDING
from vibroimpact.analysis.dataset.schema import Outcome, UnitSystem
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.files.stores import Place, is_store
from vibroimpact.analysis.orbits.recorded import Impacts
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.run.dataset import coordinate_names
from vibroimpact.orchestrator.run.progress import shown_progress
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.preparing import with_modes

Row = TypeVar("Row")


class OfRuns(Protocol):
    """Arguments that select runs."""

    @property
    def file(self) -> Path:
        """Scene or dataset."""

    @property
    def changes(self) -> Sequence[str] | None:
        """Changes of the scene, each KEY=VALUE."""


@dataclass(eq=False)
class RunsStudy(Study[Row]):
    """A study of the runs of a dataset, or of a scene, which runs first."""

    all_kinds: ClassVar[bool] = False
    """Whether stops may yield, scenes be without a force, and bodies without a tie to the ground."""

    runs: xr.Dataset
    """As `open_dataset` or `run` gives it."""

    @classmethod
    def reads(cls, options: OfRuns) -> Sequence[Place]:
        """Return scene or dataset, and the file of a folder."""
        return [options.file, dataset_place(options.file)]

    @classmethod
    def prepare(cls, options: OfRuns, stack: ExitStack) -> Self:
        """Open the runs."""
        return cls(stack.enter_context(runs_of(options.file, options.changes or (), all_kinds=cls.all_kinds)))

    @property
    def left_out(self) -> str:
        """Reason for runs without a result because of an early end."""
        return f"not looked at: {self.incomplete}"


@contextmanager
def runs_of(path: Path, changes: Sequence[str], *, all_kinds: bool = False) -> Iterator[xr.Dataset]:
    """Open the runs of a dataset, or run a scene and open its runs.

    UsageError: the scene's orbits cannot be followed, or changes are given for a dataset.
    """
    place = dataset_place(path)
    if is_store(place) or path.is_dir() or path.suffix.lower() == DATASET_ENDING:
        if changes:
            raise UsageError(
                f"{path}: --set: expected a scene, which can be changed, got a dataset. Leave it out."
            )
        with open_dataset(place) as dataset:
            yield dataset
        return
    scene = with_modes(opened_scene(path, changes))
    impacting_body(scene, all_kinds=all_kinds)  # refused before it runs
    with ScratchFolder("energies") as folder:
        file = Path(folder.name, "run.nc")
        with shown_progress() as progress:
            run_scene(scene, file, progress=progress)
        with open_dataset(file) as dataset:
            yield dataset


def results_of(
    kind: type[RunsStudy[Any]], dataset: xr.Dataset | str | PathLike[str], *more: Any
) -> xr.Dataset:
    """Return the results of a study of runs, given as a dataset or as its file or folder."""
    with nullcontext(dataset) if isinstance(dataset, xr.Dataset) else open_dataset(dataset) as runs:
        return whole(kind(runs, *more)).dataset


def scene_of(dataset: xr.Dataset, who: str) -> Scene:
    """Return the scene of a dataset of runs whose impacts were recorded."""
    missing = [name for name in ("impact_time", "impact_phase", "impact_velocity") if name not in dataset]
    if missing:
        raise DatasetError(
            f"{who}: expected recorded impacts, got no {', '.join(missing)}. "
            "Set impacts = true in [record] of a scene with a forcing and run it again."
        )
    if "scene" not in dataset.attrs:
        raise DatasetError(f"{who}: expected the scene text in the attribute scene, got none.")
    return parse_scene(str(dataset.attrs["scene"]), "scene of the dataset")


def place_of(runs: xr.Dataset, run: int, who: str) -> int:
    """Return the row of a run_index in a table of runs."""
    there = np.flatnonzero(runs["run_index"].values == run)
    if not there.size:
        known = runs["run_index"].values
        raise DatasetError(
            f"{who}: run: expected one of run_index {known.min()} to {known.max()}, got {run}."
        )
    return int(there[0])


def why_without_orbit(runs: xr.Dataset, place: int) -> str:
    """Return the reason that a run has no orbit of finitely many impacts; empty if it may have one."""
    outcome = Outcome(int(runs["outcome"].values[place]))
    if outcome is not Outcome.ok:
        return f"outcome {outcome.name}"
    if "stick_count" in runs and runs["stick_count"].values[place] > 0:
        return "sticking: impacts without number"
    if "impacts_per_period" in runs and np.isinf(runs["impacts_per_period"].values[place]).any():
        return "chatter: impacts without number"
    return ""


def units_of(dataset: xr.Dataset) -> UnitSystem:
    """Return the system of units of a dataset."""
    return "nondimensional" if dataset.attrs.get("units_system") == "nondimensional" else "SI"


class OnSweep:
    """Places values of runs on the dimensions of their dataset.

    `dims` are dimensions of the runs, `coords` their coordinates, each with a unit and a name in words.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        run_id = dataset["run_id"].values
        order = dataset.vibroimpact.runs["run_id"].values.tolist()
        place = dict(zip(order, range(len(order)), strict=True))
        self._index = np.array([place.get(int(number), -1) for number in run_id.ravel()]).reshape(
            run_id.shape
        )
        self.dims = tuple(map(str, dataset["run_id"].dims))
        self.coords = {
            str(name): one.variable
            for name, one in dataset.coords.items()
            if one.dims and set(one.dims) <= set(self.dims)
        }
        for one in self.coords.values():
            one.attrs.setdefault("units", "1")
            one.attrs.setdefault("long_name", "swept")

    def placed(self, values: Floats) -> Floats:
        """Return numbers of runs, shape (run, ...), on the dimensions; NaN where there is no run."""
        nothing = np.full((1, *values.shape[1:]), np.nan)
        return np.asarray(np.concatenate([values, nothing])[self._index])

    def texts(self, values: Sequence[str]) -> Any:
        """Return texts of runs on the dimensions, a single text as it is; `no run` without a run."""
        return np.array([*values, "no run"], dtype=object)[self._index]


class ImpactsOf:
    """The impacts of each run, by its run_id."""

    def __init__(self, dataset: xr.Dataset) -> None:
        columns = ("impact_time", "impact_phase", "impact_velocity", "impact_contact")
        owners = dataset["impact_run"].values
        order = np.argsort(owners, kind="stable")
        self._owners = owners[order]
        self._columns = [dataset[name].values[order] for name in columns]
        lasts = "impact_duration" in dataset
        self._durations = dataset["impact_duration"].values[order] if lasts else None

    def __getitem__(self, run_id: int) -> Impacts:
        first, stop = np.searchsorted(self._owners, [run_id, run_id + 1])
        time, phase, velocity, contact = (column[first:stop] for column in self._columns)
        durations = None if self._durations is None else self._durations[first:stop]
        return Impacts(time, phase, velocity, contact.astype(np.int64) - 1, durations)


class Bodies:
    """The body of each run; runs of one point share it."""

    def __init__(self, scene: Scene, runs: xr.Dataset, *, all_kinds: bool = False) -> None:
        self._scene, self._all_kinds = scene, all_kinds
        self._columns = {key: runs[name].values for key, name in coordinate_names(scene).items()}
        self._last: tuple[dict[str, float], ImpactingBody] | None = None
        self.most_modes = 0

    def __getitem__(self, place: int) -> ImpactingBody:
        values = {key: float(column[place]) for key, column in self._columns.items()}
        if self._last is None or self._last[0] != values:
            self._last = values, impacting_body(self._scene.at(values), all_kinds=self._all_kinds)
            self.most_modes = max(self.most_modes, self._last[1].frequencies.size)
        return self._last[1]
