"""The parts of a campaign on the disk: listing, checking, and joining them to one dataset.

A campaign resumes by listing its parts. A part is whole or absent, because it is renamed into place, and it ends with
the SHA-256 of its content. A damaged file is therefore found before it is opened, and its points are computed again.
"""

from __future__ import annotations

import re
import shutil
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import (
    check,
    join_files,
    read_flat,
    read_part,
    refuse_unlike,
)
from vibroimpact.analysis.dataset.assembling import wrapped
from vibroimpact.analysis.files.at_once import done_at_once
from vibroimpact.analysis.files.fingerprints import has_recorded_hash
from vibroimpact.analysis.files.object_paths import AnyPath, ObjectPath
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.campaign.workers.chunks import (
    CARRIED,
    CARRIED_STATE,
    MANIFEST,
    Chunk,
    carried_state,
)
from vibroimpact.orchestrator.run.dataset import DatasetForm, empty_dataset
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene import Scene

_PART = r"branch-(\d{6,})_runs-(\d{10,})-(\d{10,})\.nc"
_KEPT = r"kept-[0-9a-f]{16}\.nc"
_NAME = re.compile(_PART)
_OWN = re.compile(rf"{_PART}|{_KEPT}")
# Names of temporary files, from `analysis.files.atomic`.
_TEMPORARY = re.compile(
    rf"\.({_PART}|{_KEPT}|(dataset|earlier-[0-9a-f]{{8}})\.nc|campaign\.json)\.\d+\.[0-9a-f]{{8}}\.tmp"
)
EARLIER_ROWS = ".earlier-rows"
"""Name of the folder in which rows of an earlier sweep become files of the new one."""
NO_RUNS = np.empty(0, dtype=np.int64)

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class StoredPart:
    """A sound part: its chunk, the start state of the next run of its branch, and its number of rows."""

    path: AnyPath
    chunk: Chunk
    carried: State | None
    rows: int = 0


def list_parts(
    folder: AnyPath, scene_hash: str, note: Note, kept: NDArray[np.int64] = NO_RUNS
) -> list[StoredPart]:
    """Return the sound parts in a folder, in run order; damaged and duplicate parts are removed.

    A part of version 0.1 has no hash: it is read and checked as a whole. `note` gets a line for each part that must be
    computed again; the runs `kept`, shape (run,), are in no part (see `extension`).
    """
    sound: list[StoredPart] = []
    for path, chunk in _named_parts(folder):
        # Parts of the same runs have the same rows, so one is enough.
        if sound and sound[-1].chunk.stop > chunk.first:
            path.unlink()
            continue
        try:
            sound.append(_read(path, chunk, scene_hash, kept))
        except DatasetError as error:
            path.unlink()
            note(f"{path.name} was damaged and is removed; its {chunk.count} points come again: {error}")
    return sound


def own_files(folder: AnyPath) -> list[AnyPath]:
    """Return the files of a campaign in its folder of parts; other files there do not belong to it."""
    named = (path for path in folder.iterdir() if _OWN.fullmatch(path.name))
    return [path for path in named if isinstance(path, ObjectPath) or path.is_file()]


def still_there(paths: Sequence[AnyPath], home: AnyPath) -> list[AnyPath]:
    """Return the files that are in the home of a campaign: the parts of a shard go when it is sealed."""

    def exists(path: AnyPath) -> bool:
        return path.exists()

    return [path for path, there in zip(paths, done_at_once(exists, paths, home), strict=True) if there]


def remove_temporary_files(folder: AnyPath) -> None:
    """Remove the temporary files that a killed writer of a campaign left behind, and those of a cut-off extension."""
    for path in folder.iterdir():
        if _TEMPORARY.fullmatch(path.name):
            path.unlink(missing_ok=True)
        elif path.name == EARLIER_ROWS and isinstance(path, Path) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)


def remove_parts(folder: AnyPath) -> None:
    """Remove the parts of a complete campaign, and their folder if it is empty then."""
    if not folder.is_dir():
        return
    remove_temporary_files(folder)
    for path in own_files(folder):
        path.unlink(missing_ok=True)
    # The folder may be a link, or have files of others: both stay.
    with suppress(OSError):
        folder.rmdir()


def remove_parts_within(folder: AnyPath, held: Sequence[StoredPart]) -> None:
    """Remove parts whose runs are in shards of a store: their writer ended before it removed them."""
    firsts = [part.chunk.first for part in held]
    for path, chunk in _named_parts(folder) if held else ():
        place = bisect_right(firsts, chunk.first) - 1
        if place >= 0 and chunk.stop <= held[place].chunk.stop:
            path.unlink()


def _named_parts(folder: AnyPath) -> list[tuple[AnyPath, Chunk]]:
    found = []
    for path in own_files(folder):
        match = _NAME.fullmatch(path.name)
        if match is not None:
            branch, first, stop = map(int, match.groups())
            found.append((path, Chunk(branch, first, stop)))
    return sorted(found, key=lambda item: (item[1].first, -item[1].stop))


def _read(path: AnyPath, chunk: Chunk, scene_hash: str, kept: NDArray[np.int64]) -> StoredPart:
    part = read_part(path)
    runs = np.arange(chunk.first, chunk.stop)
    if not np.array_equal(part.run_index, runs[~np.isin(runs, kept)]):
        raise DatasetError(f"{path}: expected runs {chunk.first} to {chunk.stop - 1}, got others.")
    if part.attrs.get("scene_hash") != scene_hash:
        raise DatasetError(f"{path}: expected a part of this scene, got one of another.")
    if isinstance(path, Path) and not has_recorded_hash(path):
        check(read_flat(path))
    return StoredPart(path, chunk, carried_state(part.attrs), part.run_index.size)


def compact(parts: Sequence[AnyPath], target: Path, form: DatasetForm, attrs: Mapping[str, Any]) -> bool:
    """Write the rows of all parts as one dataset, with the numbers that are not swept.

    It returns whether any row has a message. The file is written as a whole or not at all. DatasetError: a part cannot
    be read or joined with the others; `unfit_parts` finds the part. OSError: the dataset cannot be written.
    """

    def finished(rows: xr.Dataset) -> xr.Dataset:
        described = rows.assign_coords(wrapped(form.constants()))
        described.attrs = without_own_attributes(rows.attrs) | dict(attrs)
        return described

    return join_files(parts, target, finished)


def without_own_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Return attributes without those of one part, which do not hold for all runs."""
    own = (*CARRIED, CARRIED_STATE, MANIFEST, "scene_hash")
    return {name: value for name, value in attrs.items() if name not in own}


def unfit_parts(parts: Iterable[AnyPath], scene: Scene) -> Iterator[tuple[AnyPath, str]]:
    """Yield the parts that cannot be read, or that do not belong to a scene, each with the reason."""
    like = empty_dataset(scene)
    for path in parts:
        try:
            part = read_flat(path)
            check(part)
            refuse_unlike(str(path), part, "this scene", like)
        except DatasetError as error:
            yield path, str(error)
