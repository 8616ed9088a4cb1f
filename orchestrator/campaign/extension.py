"""A campaign goes on with another sweep: points with equal values are kept, all others are computed.

A row depends only on the values of its point and, along a continuation axis, of the points before it. A new run equals
an old run if both scenes, with the values of that run, are equal bit for bit. Along a branch, this must hold for all
runs before it, too. The rows of equal runs are kept in one file in the folder of parts, `kept-HASH.nc`, on the
coordinates of the new sweep.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import (
    Outcome,
    Part,
    read_part,
)
from vibroimpact.analysis.dataset.assembling import assembled, loaded_variable
from vibroimpact.analysis.dataset.flat_file import FlatFile
from vibroimpact.analysis.dataset.schema import COUPLED_COLUMNS, attributes_of
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.fmus.errors import DatasetError, UsageError, VibroimpactError
from vibroimpact.orchestrator.campaign.manifest import (
    Manifest,
    differences,
    flat_scene,
    scene_hash,
)
from vibroimpact.orchestrator.campaign.parts import Note, StoredPart, own_files
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk
from vibroimpact.orchestrator.run.dataset import (
    coordinate_names,
    empty_dataset,
    stored_samples,
)
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.runner import CARRYING
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import (
    DIRECTIONS,
    Dimension,
    SweepAxis,
    dimensions,
    run_count,
    values_at,
)

Runs = NDArray[np.int64]

SHORTEST_STRETCH = 64
"""Number of neighbouring kept runs that end a chunk, without branches; the worker itself skips shorter stretches."""


_OF_STATES = ("run_index", "outcome", "final_state", "final_displacement", "final_velocity")
"""Variables that tell the state which a run hands on."""


def kept_path(folder: AnyPath, scene_hash: str) -> AnyPath:
    """Return the path of the kept rows of an extended campaign; only extended campaigns have the file."""
    return folder / f"kept-{scene_hash[:16]}.nc"


# ---- equal runs ----


def other_differences(old: Scene, new: Scene) -> list[str]:
    """Return the differences of two scenes, besides their swept values, in words."""
    axes = {axis.key: axis for axis in (*old.sweep, *new.sweep)}
    shared = {axis.key for axis in old.sweep} & {axis.key for axis in new.sweep}
    try:
        values = {
            key: axis.values[0] if key in shared else _alone(old, new, key) for key, axis in axes.items()
        }
    except UsageError:
        # One scene has no value for a key that the other scene sweeps.
        return differences(flat_scene(old), flat_scene(new))
    one, other = (_without_sweep(scene, values) for scene in (old, new))
    return differences(one, other)


def _alone(old: Scene, new: Scene, key: str) -> float:
    """Return the value of a key in the scene that does not sweep it."""
    return (new if any(axis.key == key for axis in old.sweep) else old).value(key)


def _without_sweep(scene: Scene, values: Mapping[str, float]) -> dict[str, Any]:
    """Return a scene at one point of its sweep, flat, without the sweep and the units of swept keys."""
    point = scene.at({axis.key: values[axis.key] for axis in scene.sweep})
    units = tuple(f"general.units.{key}" for key in values)
    return {
        key: value
        for key, value in flat_scene(point).items()
        if not key.startswith("sweep.") and key not in units
    }


def same_runs(old: Scene, new: Scene) -> Runs:
    """Return the equal run of the old scene for each run of the new scene, shape (run,); -1 where there is none.

    The scenes differ only in their sweeps: see `other_differences`.
    """
    was, now = _Layout(old.sweep), _Layout(new.sweep)
    adaptive = any(axis.adaptive is not None for axis in (*old.sweep, *new.sweep))
    if was.carried_key != now.carried_key or adaptive:
        return np.full(now.size, -1, dtype=np.int64)
    found = np.zeros(now.shape, dtype=np.int64)
    missing = np.zeros(now.shape, dtype=np.bool_)
    for members, stride in was.spanning():
        place = now.place_of(members)
        index = _places(
            _values_in(new, members) if place is None else _values(now, place, members), _rows(members)
        )
        column = index if place is None else index.reshape(now.along(place))
        found += stride * column
        missing |= column < 0
    for members, _ in now.spanning():
        if was.place_of(members) is None:
            index = _places(_rows(members), _values_in(old, members))
            missing |= index.reshape(now.along(now.place_of(members))) < 0
    if now.carried is not None and was.carried is not None:
        index = _along_branches(was.carried, now.carried)
        found += index
        missing |= index < 0
    return np.where(missing, -1, found).reshape(-1)


def _rows(members: Dimension) -> list[tuple[float, ...]]:
    """Return the values of the axes of a dimension, point by point."""
    return list(zip(*(axis.values for axis in members), strict=True))


def _values(layout: _Layout, place: int, members: Dimension) -> list[tuple[float, ...]]:
    """Return the values of a dimension of a layout, in the order of the axes `members`."""
    own = {axis.key: axis for axis in layout.dimensions[place]}
    return _rows(tuple(own[axis.key] for axis in members))


def _values_in(scene: Scene, members: Dimension) -> list[tuple[float, ...]]:
    """Return the values of keys that a scene does not sweep; empty where it sweeps one of them in another dimension."""
    if {axis.key for axis in members} & {axis.key for axis in scene.sweep}:
        return []
    return [tuple(scene.value(axis.key) for axis in members)]


class _Layout:
    """The order of the runs of a sweep: spanning axes in their order, then direction and place along a branch."""

    def __init__(self, sweep: Sequence[SweepAxis]) -> None:
        self.carried = next((axis for axis in sweep if axis.continuation), None)
        self.dimensions = dimensions([axis for axis in sweep if axis is not self.carried])
        lengths = [len(members[0].values) for members in self.dimensions]
        branches = (
            () if self.carried is None else (len(DIRECTIONS[self.carried.path]), len(self.carried.values))
        )
        self.shape = (*lengths, *branches)
        self.size = run_count(sweep)

    @property
    def carried_key(self) -> str | None:
        return None if self.carried is None else self.carried.key

    def spanning(self) -> Iterator[tuple[Dimension, int]]:
        """Yield the spanning dimensions, each with the distance in runs between two neighbours along it."""
        for place, members in enumerate(self.dimensions):
            yield members, math.prod(self.shape[place + 1 :])

    def place_of(self, members: Dimension) -> int | None:
        """Return the place of the dimension with exactly the keys of `members`; None where there is none."""
        keys = {axis.key for axis in members}
        own = (place for place, axes in enumerate(self.dimensions) if {axis.key for axis in axes} == keys)
        return next(own, None)

    def along(self, place: int | None) -> tuple[int, ...]:
        """Return the shape of an array along one dimension that is broadcast along all others."""
        return tuple(length if other == place else 1 for other, length in enumerate(self.shape))


def _places(values: Sequence[tuple[float, ...]], among: Sequence[tuple[float, ...]]) -> Runs:
    """Return the place of each point among others, compared bit for bit; -1: not among them."""
    if not values:
        return np.array([-1], dtype=np.int64)
    known = {tuple(map(float.hex, point)): place for place, point in enumerate(among)}
    return np.array([known.get(tuple(map(float.hex, point)), -1) for point in values], dtype=np.int64)


def _along_branches(was: SweepAxis, now: SweepAxis) -> Runs:
    """Return the old place of each new place along branches of both directions; -1 from the first difference on."""
    old_directions = DIRECTIONS[was.path]
    rows = []
    for direction in DIRECTIONS[now.path]:
        index = np.full(len(now.values), -1, dtype=np.int64)
        if direction in old_directions:
            step = -1 if direction == "down" else 1
            pairs = zip(now.values[::step], was.values[::step], strict=False)
            equal = [one.hex() == other.hex() for one, other in pairs]
            length = equal.index(False) if False in equal else len(equal)
            index[:length] = np.arange(length) + old_directions.index(direction) * len(was.values)
        rows.append(index)
    return np.array(rows)


# ---- rows of equal runs ----


def kept_runs(old: Scene, new: Scene, known: Runs) -> tuple[Runs, Runs]:
    """Return the runs that the new campaign keeps, ascending, and the equal run of the old campaign for each.

    `known` are the computed runs of the old campaign, ascending.
    """
    sources = same_runs(old, new)
    place = np.searchsorted(known, sources).clip(max=known.size - 1)
    there = (sources >= 0) & (known[place] == sources)
    if any(axis.continuation for axis in new.sweep):
        branches = there.reshape(-1, _Layout(new.sweep).shape[-1])
        there = np.logical_and.accumulate(branches, axis=1).reshape(-1)
    runs = np.flatnonzero(there)
    return runs, sources[runs]


def on_new_coordinates(rows: xr.Dataset, old: Scene, new: Scene, runs: Runs) -> xr.Dataset:
    """Return rows with the names, the attributes and the coordinates of the new scene's runs."""
    like = empty_dataset(new)
    values: dict[str, NDArray[Any]] = {"run_index": runs.astype(np.int32), **_coordinates(new, runs)}
    sampled = dict(zip(stored_samples(new), stored_samples(old), strict=True))
    variables: dict[str, Any] = {}
    for name, variable in like.variables.items():
        source = sampled.get(str(name), str(name))
        if name not in values and source in rows.variables:
            values[str(name)] = rows.variables[source].values
        if str(name) in values:
            variables[str(name)] = (variable.dims, values[str(name)], variable.attrs)
    for name in COUPLED_COLUMNS:
        if name in rows.variables:
            variables[name] = (("run",), rows.variables[name].values, attributes_of(name, new.units))
    coords = {str(name): variables.pop(str(name)) for name in like.coords}
    return without_empty_periods(assembled(variables, coords, like.attrs))


def _coordinates(scene: Scene, runs: Runs) -> dict[str, NDArray[np.float64]]:
    """Return the swept values of runs, by the name of their coordinate."""
    layout, names = _Layout(scene.sweep), coordinate_names(scene)
    places = np.unravel_index(runs, layout.shape) if layout.shape else ()
    found = {
        names[axis.key]: values_at(axis.values, place)
        for members, place in zip(layout.dimensions, places, strict=False)
        for axis in members
    }
    if layout.carried is not None:
        values, ways = np.array(layout.carried.values), DIRECTIONS[layout.carried.path]
        travelled = np.array([values[::-1] if way == "down" else values for way in ways])
        found[names[layout.carried.key]] = travelled[places[-2], places[-1]]
    return found


def without_empty_periods(rows: xr.Dataset) -> xr.Dataset:
    """Return rows without the last periods that no row has, as rows with more periods may have been left out."""
    tables = [v.values for v in rows.variables.values() if v.dims == ("run", "period")]
    if not tables:
        return rows
    filled = np.any([np.isfinite(table).any(axis=0) for table in tables], axis=0)
    return rows.isel(period=slice(0, int(np.flatnonzero(filled).max(initial=-1)) + 1))


# ---- going on from kept rows ----


@dataclass(frozen=True, slots=True)
class Kept:
    """Rows of a campaign that come from an earlier sweep."""

    path: AnyPath
    runs: Runs
    """Numbers of the kept runs, ascending, shape (run,)."""
    stretches: list[StoredPart]
    """Neighbouring runs that chunks leave out, with the start state of the run after them."""


def read_kept(path: AnyPath, scene: Scene) -> Kept:
    """Return the kept rows of a file; raise DatasetError if it is damaged."""
    with FlatFile(path) as file:
        stored = {str(name): variable for name, variable in file.dataset.variables.items()}
        data = {name: loaded_variable(stored[name]) for name in _OF_STATES if name in stored}
    rows = assembled(data, {}, {})
    runs = rows.run_index.values.astype(np.int64)
    layout = _Layout(scene.sweep)
    chained = layout.carried is not None
    ends = np.flatnonzero(np.diff(runs) != 1) + 1
    stretches = []
    for first, stop in pairwise([0, *ends.tolist(), runs.size]):
        if not chained and stop - first < SHORTEST_STRETCH:
            continue
        last = int(runs[stop - 1])
        branch = last // layout.shape[-1] if chained else 0
        # The branch of the last run begins here, or with the stretch.
        begin = max(first, stop - 1 - last % layout.shape[-1]) if chained else first
        carried = _carried(rows, begin, stop) if chained else None
        stretches.append(StoredPart(path, Chunk(branch, int(runs[first]), last + 1), carried))
    return Kept(path, runs, stretches)


def read_only_kept(folder: AnyPath, path: AnyPath, scene: Scene, note: Note) -> Kept | None:
    """Return the kept rows of a sweep, None without sound ones; other kept rows in the folder of parts are removed."""
    for other in own_files(folder):
        if other.name.startswith("kept-") and other != path:
            other.unlink()
    if not path.exists():
        return None
    try:
        return read_kept(path, scene)
    except DatasetError as error:
        path.unlink()
        note(f"{path.name} was damaged and is removed; its points come again: {error}")
        return None


def without_held(kept: Kept, held: Sequence[StoredPart]) -> Kept:
    """Return the kept rows outside of the runs that are held; `held` is in run order."""
    inside = np.zeros(kept.runs.size, dtype=np.bool_)
    for part in held:
        first, stop = np.searchsorted(kept.runs, (part.chunk.first, part.chunk.stop))
        inside[first:stop] = True
    stretches = []
    for stretch in kept.stretches:
        reached, stop = stretch.chunk.first, stretch.chunk.stop
        for part in held:
            if part.chunk.first < stop and part.chunk.stop > reached:
                if part.chunk.first > reached:
                    chunk = replace(stretch.chunk, first=reached, stop=part.chunk.first)
                    stretches.append(replace(stretch, chunk=chunk, rows=chunk.count))
                reached = part.chunk.stop
        if reached < stop:
            chunk = replace(stretch.chunk, first=reached)
            stretches.append(replace(stretch, chunk=chunk, rows=chunk.count))
    return Kept(kept.path, kept.runs[~inside], stretches)


def _carried(rows: xr.Dataset, begin: int, stop: int) -> State | None:
    """Return the state that runs from the start of a branch hand on, by the rule of `Runner.rows`."""
    states = final_states(rows, slice(begin, stop))
    outcome = rows.outcome.values[begin:stop]
    # A run marked for impossible values has handed on its state; a failed run has no finite state.
    usable = np.isin(outcome, [*CARRYING, Outcome.error]) & np.isfinite(states).all(axis=1)
    return tuple(states[np.flatnonzero(usable)[-1]].tolist()) if usable.any() else None


def final_states(rows: xr.Dataset, part: slice) -> NDArray[np.float64]:
    """Return the final states of some runs, shape (run, 2 N): displacements (m), then velocities (m/s)."""
    if "final_state" in rows.variables:
        states: NDArray[np.float64] = rows.final_state.values[part]
        return states
    return np.stack([rows.final_displacement.values[part], rows.final_velocity.values[part]], axis=1)


def scene_of_manifest(manifest: Manifest, like: Scene) -> Scene | None:
    """Return the scene with which a campaign was started; None where it can no longer be read.

    Paths in the scene are relative to the source of `like`.
    """
    try:
        scene = parse_scene(manifest.scene_text, like.source)
    except VibroimpactError:
        return None
    # A key that is newer than the campaign has its default.
    known = flat_scene(scene) | dict(manifest.scene)
    return None if differences(known, flat_scene(scene)) else scene


def read_finished(path: AnyPath) -> Part:
    """Return attributes and run numbers of a campaign's dataset; raise DatasetError if it is damaged."""
    try:
        return read_part(path)
    except DatasetError as error:
        raise DatasetError(f"{error} Delete {path} to compute the campaign again.") from error


def is_of(attrs: Mapping[str, Any], manifest: Manifest, scene: Scene) -> bool:
    """Return whether a dataset belongs to a campaign; other datasets are of the sweep before its extension."""
    own = (manifest.scene_hash, scene_hash(scene))
    return attrs.get("scene_hash", manifest.scene_hash) in own
