"""The parts of a campaign on the disk: which are there, which are sound, and how they become one dataset.

Resuming a campaign is listing its parts. A part is whole or not there at all, because it is renamed into
place; a file that is damaged all the same is found when it is read, and its points are computed again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset import merge_datasets, read_flat, read_part, write_dataset
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.chunks import CARRIED, CARRIED_STATE, Chunk, State, carried_state

_NAME = re.compile(r"branch-(\d{6,})_runs-(\d{10,})-(\d{10,})\.nc")
_TEMPORARY = re.compile(r"\..*\.tmp")

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class StoredPart:
    """A sound part: its chunk, and the state that the next run of its branch starts from."""

    path: Path
    chunk: Chunk
    carried: State | None


def list_parts(folder: Path, scene_hash: str, note: Note) -> list[StoredPart]:
    """Return the sound parts in a folder, in run order; what is of no use is removed.

    Parameters
    ----------
    folder : Path
    scene_hash : str
        Hash of the scene the parts must come from.
    note : callable
        Told in words of each part that has to be computed again.
    """
    sound: list[StoredPart] = []
    for path, chunk in _named_parts(folder):
        # Two parts of the same runs hold the same rows; one is enough.
        if sound and sound[-1].chunk.stop > chunk.first:
            path.unlink()
            continue
        try:
            sound.append(_read(path, chunk, scene_hash))
        except DatasetError as error:
            path.unlink()
            note(f"{path.name} was damaged and is removed; its {chunk.count} points come again: {error}")
    return sound


def remove_temporary_files(folder: Path) -> None:
    """Remove what a writer that was killed left behind."""
    for path in folder.iterdir():
        if _TEMPORARY.fullmatch(path.name):
            path.unlink(missing_ok=True)


def _named_parts(folder: Path) -> list[tuple[Path, Chunk]]:
    found = []
    for path in folder.iterdir():
        match = _NAME.fullmatch(path.name)
        if match is not None:
            branch, first, stop = map(int, match.groups())
            found.append((path, Chunk(branch, first, stop)))
    return sorted(found, key=lambda item: (item[1].first, -item[1].stop))


def _read(path: Path, chunk: Chunk, scene_hash: str) -> StoredPart:
    part = read_part(path)
    if not np.array_equal(part.run_index, np.arange(chunk.first, chunk.stop)):
        raise DatasetError(f"{path}: expected runs {chunk.first} to {chunk.stop - 1}, got others.")
    if part.attrs.get("scene_hash") != scene_hash:
        raise DatasetError(f"{path}: expected a part of this scene, got one of another.")
    return StoredPart(path, chunk, carried_state(part.attrs))


def compact(parts: Sequence[Path], target: Path, attrs: Mapping[str, Any]) -> None:
    """Write the rows of all parts as one dataset, whole or not at all.

    Raises
    ------
    DatasetError
        When a part cannot be read; `damaged_parts` finds out which.
    OSError
        When the dataset cannot be written.
    """
    dataset = merge_datasets(parts)
    own = (*CARRIED, CARRIED_STATE, "scene_hash")
    kept = {name: value for name, value in dataset.attrs.items() if name not in own}
    write_dataset(dataset.assign_attrs(kept | dict(attrs)), target)


def damaged_parts(parts: Iterable[Path]) -> list[Path]:
    """Return the parts whose contents cannot be read."""
    damaged = []
    for path in parts:
        try:
            read_flat(path)
        except DatasetError:
            damaged.append(path)
    return damaged
