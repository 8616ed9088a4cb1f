"""The Zarr store of a campaign: made before the first run, filled by shards in any order, finished after the last run.

Each sealed shard is the truth about its runs, as a part is. The metadata of the store are made again by each command,
so that damaged or lost ones come back. A file of its own seals the finished store.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.analysis.dataset.assembling import new_variable
from vibroimpact.analysis.dataset.flat_file import FlatFile
from vibroimpact.analysis.dataset.merging import joined
from vibroimpact.analysis.dataset.schema import RULES, attributes_of
from vibroimpact.analysis.dataset.stores.store import StoreWriter, create_store
from vibroimpact.analysis.files.at_once import done_at_once
from vibroimpact.analysis.files.object_paths import AnyPath, located
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.files.stores import objects_below
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.campaign.destination import (
    Attributes,
    Destination,
    ShardParts,
    UnfitShardsError,
)
from vibroimpact.orchestrator.campaign.extension import Kept, is_of, kept_path
from vibroimpact.orchestrator.campaign.manifest import Manifest
from vibroimpact.orchestrator.campaign.parts import Note, StoredPart
from vibroimpact.orchestrator.campaign.stores.sealing import OPTIONAL, GrowingStore, read_shard, write_shard
from vibroimpact.orchestrator.campaign.stores.seals import (
    FINISHED,
    STORE,
    Seal,
    finished_store,
    read_seal,
    read_sealed,
    refuse_changed_objects,
    refuse_other_store,
    seal_path,
    seal_store,
    seals_in,
)
from vibroimpact.orchestrator.campaign.stores.shards import Shard, SweepGrid
from vibroimpact.orchestrator.campaign.workers.chunks import (
    Chunk,
    ChunkResult,
    Work,
    attributes_of_part,
    carried_state,
)
from vibroimpact.orchestrator.run.dataset import DatasetForm, empty_dataset, with_constants_of
from vibroimpact.orchestrator.scene import Scene


def seal_parts(work: Work, complete: ShardParts) -> Seal:
    """Write a shard from the files that have all of its runs, and return its seal.

    Raises
    ------
    DatasetError
        A part is damaged, or the parts do not fit together.
    OSError
        The shard cannot be written.
    """
    assert work.store is not None
    shard, pieces = complete.shard, done_at_once(read_flat, complete.paths, work.store.path)
    if complete.kept is not None:
        with FlatFile(complete.kept) as kept:
            index = kept.dataset.variables["run_index"].values
            first, stop = np.searchsorted(index, (shard.first, shard.stop))
            pieces += [kept.runs(np.arange(first, stop))] if stop > first else []
    rows = joined(pieces, [f"shard {shard.number}"] * len(pieces))
    if not np.array_equal(rows.run_index.values, np.arange(shard.first, shard.stop)):
        raise DatasetError(f"shard {shard.number}: expected each of its runs in one part, got others.")
    attrs = attributes_of_part(work, complete.carried)
    return write_shard(work.store, work.scene, shard, rows, complete.branch, attrs)


class GrownStore(Destination):
    """The store `dataset.zarr` of a campaign, with a seal for each of its shards."""

    def __init__(
        self, store: GrowingStore, scene: Scene, grid: SweepGrid, scene_hash: str, note: Note
    ) -> None:
        self.path, self.store, self.shards = store.path, store, grid.shards
        self._growing, self._seals = store, store.seals
        self._scene, self._grid, self._hash, self._note = scene, grid, scene_hash, note
        self._sealed: dict[int, Seal] = {}
        self._files: dict[int, list[StoredPart]] = defaultdict(list)
        self._missing: dict[int, int] = {}
        self._kept: Kept | None = None

    def finished(self, manifest: Manifest) -> tuple[int, Attributes] | None:
        """Return the number of runs and the attributes of the finished store of a campaign; None without one."""
        done = finished_store(self.path, self._seals)
        if done is None or not is_of(done[1], manifest, self._scene):
            return None
        return done if sum(part.rows for part in self.held()) == done[0] else None

    def retitle(self, attrs: Attributes) -> None:
        """Change attributes of the finished store."""
        self._finish(attrs, read_sealed(self._seals / FINISHED)["attrs"])

    def make(self) -> None:
        """Make the arrays of the store, or those of its metadata again that are missing or have changed."""
        refuse_other_store(self.path, self._seals, self._hash, extended=self._is_extended())
        self._seals.mkdir(exist_ok=True)
        (self._seals / FINISHED).unlink(missing_ok=True)
        with ScratchFolder("store") as folder:
            made_again = Path(folder.name, STORE)
            self._create(made_again)
            there = set(objects_below(self.path))

            def put(key: str) -> None:
                place, content = self.path / key, (made_again / key).read_bytes()
                if key in there and place.read_bytes() == content:
                    return
                if isinstance(place, Path):
                    place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(content)

            # the root names the scene: a store that is cut off without it would be taken for one of another program
            put("zarr.json")
            done_at_once(put, sorted(set(objects_below(made_again)) - {"zarr.json"}), self.path)

    def _create(self, place: Path) -> None:
        """Make the arrays of the store, without runs, at another place."""
        scene = self._scene
        axes = dict(self._grid.axes)
        like = with_constants_of(empty_dataset(scene), scene).assign_attrs(scene_hash=self._hash)
        if not scene.is_one_body:
            empty = new_variable("run", np.empty(1), attributes_of("loop_residual", scene.units))
            like = like.assign(loop_residual=empty)
        if "direction" not in axes:
            axes["direction"] = new_variable(
                (), np.asarray("independent"), {"long_name": RULES["direction"].long_name}
            )
        create_store(place, like, self._grid.cells, axes, sizes={"period": self._periods()})

    def _is_extended(self) -> bool:
        return kept_path(self.path.with_name("parts"), self._hash).exists()

    def _periods(self) -> int:
        record = self._scene.record
        return record.recorded_periods if record.each_period else 1

    def held(self) -> list[StoredPart]:
        """Return the runs in sealed shards; a damaged shard is named and loses its seal."""
        numbers = {shard.number: shard for shard in self.shards}
        found = []
        for path in seals_in(self._seals):
            try:
                seal = self._sealed.get(_number(path)) or self._checked(path, numbers)
            except DatasetError as error:
                path.unlink()
                self._note(f"{path.stem} of the store was damaged; its points come again: {error}")
                continue
            self._sealed[seal.shard] = seal
            chunk = Chunk(seal.branch, seal.first, seal.stop)
            found.append(StoredPart(path, chunk, carried_state(seal.attrs), chunk.count))
        return sorted(found, key=lambda part: part.chunk.first)

    def _checked(self, path: AnyPath, shards: Mapping[int, Shard]) -> Seal:
        """Return a seal whose shard is whole and belongs to this campaign."""
        seal = read_seal(path)
        shard = shards.get(seal.shard)
        if (
            shard is None
            or (shard.first, shard.stop) != (seal.first, seal.stop)
            or _number(path) != seal.shard
        ):
            raise DatasetError(f"{path}: expected a shard of this sweep, got another.")
        if seal.attrs.get("scene_hash") != self._hash:
            raise DatasetError(f"{path}: expected a shard of this scene, got one of another.")
        refuse_changed_objects(self.path, seal.objects)
        return seal

    def rows(self, path: AnyPath) -> xr.Dataset:
        """Return the rows of a part, or of the shard of a seal."""
        if path.parent != self._seals:
            return super().rows(path)
        return read_shard(self._growing, self._scene, read_seal(path))

    def expect(self, parts: Sequence[StoredPart], kept: Kept | None) -> None:
        """Take note of the parts that are there before the first chunk."""
        self._kept = kept
        self._files.clear()
        self._missing = {
            shard.number: shard.count for shard in self.shards if shard.number not in self._sealed
        }
        for shard in self.shards if kept is not None else ():
            if shard.number in self._missing and kept is not None:
                first, stop = np.searchsorted(kept.runs, (shard.first, shard.stop))
                self._missing[shard.number] -= int(stop - first)
        for part in parts:
            self._add(part)

    def _add(self, part: StoredPart) -> Shard:
        """Take note of a part, which lies in one shard; return the shard."""
        shard = self._grid.shard_around(part.chunk.first)
        self._files[shard.number].append(part)
        self._missing[shard.number] -= part.rows
        return shard

    def taken(self, result: ChunkResult) -> list[ShardParts]:
        """Take note of the rows of a chunk; return the shard that is complete by it, and not yet written."""
        rows = sum(result.outcomes.values())
        if not rows:
            return []
        path = located(result.path)
        if path.parent == self._seals:
            self.sealed(read_seal(path))
            return []
        shard = self._add(StoredPart(path, result.chunk, result.carried, rows))
        return [] if self._missing[shard.number] else [self._of_shard(shard)]

    def _of_shard(self, shard: Shard) -> ShardParts:
        parts = sorted(self._files[shard.number], key=lambda part: part.chunk.first)
        kept = None if self._kept is None else self._kept.path
        branch = self._branch_of(shard.first)
        carried = parts[-1].carried if parts else None
        return ShardParts(shard, branch, tuple(part.path for part in parts), kept, carried)

    def _branch_of(self, run: int) -> int:
        carried = next((axis for axis in self._scene.sweep if axis.continuation), None)
        return 0 if carried is None else run // len(carried.values)

    def sealed(self, seal: Seal) -> None:
        """Take note of a shard that is written, and remove its parts."""
        self._sealed[seal.shard] = seal
        self._missing.pop(seal.shard, None)
        done_at_once(_remove, self._files.pop(seal.shard, []), self.path)

    def complete(self, work: Work, paths: Sequence[AnyPath], form: DatasetForm, attrs: Attributes) -> bool:
        """Write the shards whose runs are all in parts, then finish the store; return whether a run has a message."""
        for shard in self.shards:
            if shard.number in self._missing:
                self.sealed(seal_parts(work, self._of_shard(shard)))
        self._refuse_changed_shards()
        self._finish(attrs, attributes_of_part(work, None))
        return any(seal.has_messages for seal in self._sealed.values())

    def _refuse_changed_shards(self) -> None:
        """Raise UnfitShardsError unless all shards are as they were sealed: a worker that was lost may still write."""
        found = []
        for number, seal in sorted(self._sealed.items()):
            try:
                refuse_changed_objects(self.path, seal.objects)
            except DatasetError as error:
                found.append((seal_path(self._seals, number), str(error)))
                del self._sealed[number]
        if found:
            raise UnfitShardsError(found)

    def _finish(self, attrs: Attributes, of_seal: Attributes) -> None:
        """Write what is known at the end only, the consolidated metadata, and the seal of the finished store."""
        (self._seals / FINISHED).unlink(missing_ok=True)
        seals = list(self._sealed.values())
        absent = [name for name in OPTIONAL if all(name in seal.absent for seal in seals)]
        writer = StoreWriter(self.path)
        writer.finish(attrs, sizes={"period": max(seal.periods for seal in seals)}, absent=absent)
        runs = sum(seal.stop - seal.first for seal in seals)
        seal_store(self.path, self._seals, runs, of_seal, {key for seal in seals for key in seal.objects})


def _remove(part: StoredPart) -> None:
    part.path.unlink(missing_ok=True)


def _number(seal: AnyPath) -> int:
    return int(seal.stem.removeprefix("shard-"))
