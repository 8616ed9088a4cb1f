"""The Zarr store of a campaign: made before the first run, filled by shards in any order, finished after the last run.

Each sealed shard is the truth about its runs, as a part is. Shards of rounds are appended: the last one has the runs
that are left. It is sealed at the end, and grows if a later command finds more points.

The metadata of the store are made again by each command, so that damaged or lost ones come back. A file of its own
seals the finished store.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
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
from vibroimpact.orchestrator.campaign.stores.sealing import (
    GrowingStore,
    optional_columns,
    read_shard,
    write_shard,
)
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
from vibroimpact.orchestrator.campaign.stores.shards import Shard
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
    store, shard = work.store, complete.shard
    pieces = done_at_once(lambda path: _rows(store, work.scene, path), complete.paths, store.path)
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


def _rows(store: GrowingStore, scene: Scene, path: AnyPath) -> xr.Dataset:
    """Return the rows of a part, or of the shard of a seal."""
    return read_shard(store, scene, read_seal(path)) if path.parent == store.seals else read_flat(path)


class GrownStore(Destination):
    """The store `dataset.zarr` of a campaign, with a seal for each of its shards."""

    def __init__(self, store: GrowingStore, scene: Scene, scene_hash: str, note: Note) -> None:
        self._cells = store.cells(scene)
        self.path, self.store, self.shards = store.path, store, self._cells.shards
        self._growing, self._seals = store, store.seals
        self._scene, self._hash, self._note = scene, scene_hash, note
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
        axes, cells = dict(self._cells.axes), self._cells.cells
        like = with_constants_of(empty_dataset(scene), scene).assign_attrs(scene_hash=self._hash)
        if not scene.is_one_body:
            for name in optional_columns(scene):
                like[name] = new_variable("run", np.empty(1), attributes_of(name, scene.units))
        if "direction" not in axes and not cells.is_line:
            axes["direction"] = new_variable(
                (), np.asarray("independent"), {"long_name": RULES["direction"].long_name}
            )
        create_store(place, like, cells, axes, sizes={"period": self._periods()})

    def _is_extended(self) -> bool:
        return kept_path(self.path.with_name("parts"), self._hash).exists()

    def _periods(self) -> int:
        record = self._scene.record
        return record.recorded_periods if record.each_period else 1

    def held(self) -> list[StoredPart]:
        """Return the runs in sealed shards; a damaged shard is named and loses its seal."""
        found = []
        for path in seals_in(self._seals):
            try:
                seal = self._sealed.get(_number(path)) or self._checked(path)
            except DatasetError as error:
                path.unlink()
                self._note(f"{path.stem} of the store was damaged; its points come again: {error}")
                continue
            self._sealed[seal.shard] = seal
            found.append(self._part_of(seal))
        return sorted(found, key=lambda part: part.chunk.first)

    def _part_of(self, seal: Seal) -> StoredPart:
        """Return the runs of a sealed shard as a part."""
        chunk = Chunk(seal.branch, seal.first, seal.stop)
        path = seal_path(self._seals, seal.shard)
        return StoredPart(path, chunk, carried_state(seal.attrs), chunk.count)

    def _checked(self, path: AnyPath) -> Seal:
        """Return a seal whose shard is whole and belongs to this campaign."""
        seal = read_seal(path)
        shard = self._cells.sealed_shard(seal.first, seal.stop)
        if shard is None or not shard.number == seal.shard == _number(path):
            raise DatasetError(f"{path}: expected a shard of this sweep, got another.")
        if seal.attrs.get("scene_hash") != self._hash:
            raise DatasetError(f"{path}: expected a shard of this scene, got one of another.")
        refuse_changed_objects(self.path, seal.objects)
        return seal

    def rows(self, path: AnyPath) -> xr.Dataset:
        """Return the rows of a part, or of the shard of a seal."""
        return _rows(self._growing, self._scene, path)

    def drop(self, part: StoredPart) -> None:
        """Remove a part, or the seal of a shard."""
        super().drop(part)
        shard = self._cells.shard_around(part.chunk.first)
        if part.path.parent == self._seals:
            self._sealed.pop(shard.number, None)
            self._missing.setdefault(shard.number, shard.count)
        else:
            self._missing[shard.number] += part.rows
        self._files[shard.number] = [one for one in self._files[shard.number] if one.path != part.path]

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
        for shard in self.shards:
            seal = self._sealed.get(shard.number)
            if seal is not None and seal.stop < shard.stop:
                self._missing[shard.number] = shard.count
                self._add(self._part_of(seal))
        for part in parts:
            self._add(part)

    def _add(self, part: StoredPart) -> Shard:
        """Take note of a part, which lies in one shard; return the shard."""
        shard = self._cells.shard_around(part.chunk.first)
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
        return 0 if carried is None or self._cells.is_open else run // len(carried.values)

    def sealed(self, seal: Seal) -> None:
        """Take note of a shard that is written, and remove its parts."""
        self._sealed[seal.shard] = seal
        self._missing.pop(seal.shard, None)
        parts = [part for part in self._files.pop(seal.shard, []) if part.path.parent != self._seals]
        done_at_once(_remove, parts, self.path)

    def seal(self, work: Work, complete: ShardParts) -> None:
        """Write a complete shard; it stays in its parts where one of them is damaged, which is met again at the end."""
        with suppress(DatasetError):
            self.sealed(seal_parts(work, complete))

    def complete(self, work: Work, paths: Sequence[AnyPath], form: DatasetForm, attrs: Attributes) -> bool:
        """Write the shards whose runs are all in parts, then finish the store; return whether a run has a message."""
        for shard in self._unsealed():
            self.sealed(seal_parts(work, self._of_shard(shard)))
        self._refuse_changed_shards()
        self._finish(attrs, attributes_of_part(work, None))
        return any(seal.has_messages for seal in self._sealed.values())

    def _unsealed(self) -> Iterator[Shard]:
        """Yield the shards that are not in the store as they are at the end."""
        end = self.shards[-1].stop
        if self._cells.is_open:
            end = max(part.chunk.stop for parts in [self.held(), *self._files.values()] for part in parts)
        for shard in self.shards:
            seal = self._sealed.get(shard.number)
            stop = min(shard.stop, end)
            whole = self._cells.sealed_shard(shard.first, stop) if shard.first < stop else None
            if whole is not None and (seal is None or seal.stop < stop):
                yield whole

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
        absent = [
            name for name in optional_columns(self._scene) if all(name in seal.absent for seal in seals)
        ]
        writer = StoreWriter(self.path)
        runs = sum(seal.stop - seal.first for seal in seals)
        sizes = {"period": max(seal.periods for seal in seals), "run": runs}
        writer.finish(attrs, sizes=sizes, absent=absent)
        seal_store(self.path, self._seals, runs, of_seal, {key for seal in seals for key in seal.objects})


def _remove(part: StoredPart) -> None:
    part.path.unlink(missing_ok=True)


def _number(seal: AnyPath) -> int:
    return int(seal.stem.removeprefix("shard-"))
