"""The rows of an earlier sweep, handed over to a new one in blocks: the memory does not grow with their number.

Each block of old rows becomes a file of the kept rows in it, on the coordinates of the new sweep. All files are joined
to the kept rows of the new sweep. Where axes have changed their order, the rows of all files lie between one another,
and are in memory together.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import join_files, read_part, take_runs, write_dataset
from vibroimpact.analysis.dataset.flat_file import blocks_of
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.fmus.messages import CALL, message
from vibroimpact.orchestrator.campaign.extension import (
    Runs,
    is_of,
    kept_path,
    kept_runs,
    on_new_coordinates,
    read_finished,
    read_kept,
    without_held,
)
from vibroimpact.orchestrator.campaign.manifest import (
    NAME,
    Manifest,
    carried_manifest,
    new_manifest,
    scene_hash,
    write_content,
)
from vibroimpact.orchestrator.campaign.parts import (
    EARLIER_ROWS,
    NO_RUNS,
    Note,
    StoredPart,
    list_parts,
    own_files,
    remove_parts_within,
)
from vibroimpact.orchestrator.campaign.stores.seals import SEALS, STORE, remove_store
from vibroimpact.orchestrator.campaign.workers.chunks import MANIFEST
from vibroimpact.orchestrator.run.dataset import with_constants_of
from vibroimpact.orchestrator.scene import Scene


class SealedStore(Protocol):
    """A store with the rows of a campaign."""

    def held(self) -> list[StoredPart]:
        """Return the runs in the store, in run order."""

    def blocks(self, path: AnyPath) -> Iterator[xr.Dataset]:
        """Yield the rows of one of them, one-dimensional."""


@dataclass(frozen=True, slots=True)
class EarlierSweep:
    """A campaign in the folder `home`, started with another sweep; `note` gets messages on its kept points.

    `store` is the store of that campaign; None where its dataset is a file.
    """

    scene: Scene
    manifest: Manifest
    home: Path
    note: Note
    store: SealedStore | None = None

    @property
    def _folder(self) -> Path:
        return self.home / "parts"

    def hand_over(self, new: Scene, runs: int) -> bool:
        """Hand the folder over to a new sweep; return False where the new sweep keeps no row of the old one.

        The folder belongs to the old sweep until the new manifest is written, and nothing is removed before. Raise
        CampaignError where the system refuses to write.
        """
        try:
            return self._hand_over(new, runs)
        except OSError as error:
            raise CampaignError(
                message(
                    f"{self.home}: the points of the earlier sweep could not be kept: {error.strerror or error}. "
                    "They are where they were. Make room or restore access; then the same ",
                    CALL,
                    " goes on.",
                )
            ) from error

    def _hand_over(self, new: Scene, runs: int) -> bool:
        old, hashed, sources = self.manifest, scene_hash(new), self._sources()
        manifest = new_manifest(new, old.identity, runs, old.continued_with, shard_points=old.shard_points)
        if sources:
            known = np.sort(np.concatenate([source.runs for source in sources]))
            kept, equal = kept_runs(self.scene, new, known)
            if not kept.size:
                return False
            carried = {"scene_hash": hashed, MANIFEST: carried_manifest(manifest, new.source)}
            with _scratch(self.home) as scratch:
                if known.size > kept.size:
                    self._store(sources, scratch, known.size - kept.size)
                blocks = (rows for source in sources for rows in source.blocks())
                files = list(_files_of_kept(blocks, self.scene, new, kept, equal, scratch))
                join_files(files, kept_path(self._folder, hashed), lambda form: form.assign_attrs(carried))
            self.note(f"{kept.size} of {runs} points are kept from the earlier sweep.")
        outdated = own_files(self._folder)
        write_content(self.home / NAME, manifest)
        for path in outdated:
            if path != kept_path(self._folder, hashed):
                path.unlink(missing_ok=True)
        if self.store is not None:
            remove_store(self.home / STORE, self.home / SEALS)
        return True

    def _sources(self) -> list[_Source]:
        """Return the files and shards with the computed rows."""
        target = self.home / "dataset.nc"
        if target.exists() and is_of((done := read_finished(target)).attrs, self.manifest, self.scene):
            return [_Source(target, done.run_index.astype(np.int64))]
        path = kept_path(self._folder, self.manifest.scene_hash)
        kept = read_kept(path, self.scene) if path.exists() else None
        held = self.store.held() if self.store is not None else []
        remove_parts_within(self._folder, held)
        runs = kept.runs if kept is not None else NO_RUNS
        found = []
        for part in list_parts(self._folder, self.manifest.scene_hash, self.note, runs):
            found.append(_Source(part.path, read_part(part.path).run_index.astype(np.int64)))
        if self.store is not None:
            for part in held:
                own = np.arange(part.chunk.first, part.chunk.stop)
                found.append(_Source(part.path, own, self.store.blocks))
        if kept is not None and (left := without_held(kept, held).runs).size:
            found.append(_Source(path, left, is_whole=left.size == kept.runs.size))
        return found

    def _store(self, sources: Sequence[_Source], scratch: Path, left: int) -> None:
        """Write all old points to a file of its own, since the new sweep leaves some of them out."""
        path = self.home / f"earlier-{self.manifest.scene_hash[:8]}.nc"

        def finished(form: xr.Dataset) -> xr.Dataset:
            attributed = form.assign_attrs(self.manifest.attributes(self.scene))
            attributed.attrs.pop(MANIFEST, None)
            return with_constants_of(attributed, self.scene)

        join_files([file for source in sources for file in source.files(scratch)], path, finished)
        self.note(f"{left} points of the earlier sweep are not in this one; they stay in {path.name}.")


@dataclass(frozen=True, slots=True)
class _Source:
    """A file of rows, or a shard of a store; `runs`, ascending, are those that are in no other source."""

    path: AnyPath
    runs: Runs
    read: Callable[[AnyPath], Iterator[xr.Dataset]] = blocks_of
    is_whole: bool = True

    def blocks(self) -> Iterator[xr.Dataset]:
        """Yield the rows of the runs in memory, some at a time, each block in run order."""
        for rows in self.read(self.path):
            index = rows.variables["run_index"].values
            there = self.runs[np.searchsorted(self.runs, index).clip(max=self.runs.size - 1)] == index
            if there.all():
                yield rows
            elif there.any():
                yield take_runs(rows, np.flatnonzero(there))

    def files(self, scratch: Path) -> Iterator[AnyPath]:
        """Yield the files with the rows: the source itself, or new files in a folder."""
        if self.read is blocks_of and self.is_whole:
            yield self.path
            return
        for rows in self.blocks():
            path = scratch / f"{self.path.stem}-{rows.run_index.values[0]}.nc"
            write_dataset(rows, path)
            yield path


def _files_of_kept(
    blocks: Iterator[xr.Dataset], old: Scene, new: Scene, runs: Runs, equal: Runs, scratch: Path
) -> Iterator[Path]:
    """Yield new files in a folder, one for each block of old rows, with the kept `runs` of the new sweep."""
    order = np.argsort(equal, kind="stable")
    by_old = equal[order]
    for number, rows in enumerate(blocks):
        index = rows.variables["run_index"].values
        first, stop = np.searchsorted(by_old, (index[0], index[-1] + 1))
        place = np.searchsorted(index, by_old[first:stop])
        there = index[place] == by_old[first:stop]
        found, place = order[first:stop][there], place[there]
        if found.size:
            ascending = np.argsort(found)
            path = scratch / f"{number:06d}.nc"
            kept = take_runs(rows, place[ascending])
            write_dataset(on_new_coordinates(kept, old, new, runs[found[ascending]]), path)
            yield path


@contextmanager
def _scratch(home: Path) -> Iterator[Path]:
    """Make a folder for files of the block on the disk of a campaign."""
    folder = home / EARLIER_ROWS
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder)
