"""The Zarr store of a campaign whose points are no grid, or known at its end only: written from all parts at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.dataset.stores.converting import convert_dataset
from vibroimpact.analysis.dataset.stores.runs import StoreRuns, read_runs
from vibroimpact.analysis.dataset.stores.store import StoreWriter
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.orchestrator.campaign.destination import Attributes, Destination
from vibroimpact.orchestrator.campaign.extension import is_of, kept_path
from vibroimpact.orchestrator.campaign.manifest import Manifest
from vibroimpact.orchestrator.campaign.parts import StoredPart, compact
from vibroimpact.orchestrator.campaign.stores.seals import (
    FINISHED,
    SEALS,
    STORE,
    finished_store,
    read_sealed,
    refuse_other_store,
    seal_store,
)
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, Work, attributes_of_part
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.scene import Scene

_JOINED = ".joined.nc"
"""Name of the file of all rows before they become the store."""


class WholeStore(Destination):
    """The store `dataset.zarr`, written when the last run is computed."""

    def __init__(self, home: Path, scene: Scene, scene_hash: str) -> None:
        self.path = self._store = home / STORE
        self._seals, self._scene, self._hash = home / SEALS, scene, scene_hash

    def make(self) -> None:
        """Raise UsageError if the store of another campaign is at this place."""
        extended = kept_path(self.path.with_name("parts"), self._hash).exists()
        refuse_other_store(self.path, self._seals, self._hash, extended=extended)

    def finished(self, manifest: Manifest) -> tuple[int, Attributes] | None:
        """Return the number of runs and the attributes of the store of a campaign; None without one."""
        done = finished_store(self.path, self._seals)
        return done if done is not None and is_of(done[1], manifest, self._scene) else None

    def held(self) -> list[StoredPart]:
        """Return all runs of a finished store as one part."""
        done = finished_store(self.path, self._seals)
        return [] if done is None else [StoredPart(self.path, Chunk(0, 0, done[0]), None, done[0])]

    def rows(self, path: AnyPath) -> xr.Dataset:
        """Return the rows of a part, or of the store."""
        return read_runs(path) if path == self.path else super().rows(path)

    def blocks(self, path: AnyPath) -> Iterator[xr.Dataset]:
        """Yield the rows of a part, or those of each shard of the store."""
        if path != self.path:
            yield from super().blocks(path)
            return
        for shard in StoreRuns(path).shards:
            yield shard.rows()

    def complete(self, work: Work, paths: Sequence[AnyPath], form: DatasetForm, attrs: Attributes) -> bool:
        """Write the rows of all parts as one store; return whether a run has a message."""
        joined = self._store.with_name(_JOINED)
        try:
            has_messages = compact(paths, joined, form, attrs)
            self._seals.mkdir(exist_ok=True)
            (self._seals / FINISHED).unlink(missing_ok=True)
            runs = convert_dataset(joined, self.path)
        finally:
            joined.unlink(missing_ok=True)
        seal_store(self.path, self._seals, runs, attributes_of_part(work, None))
        return has_messages

    def retitle(self, attrs: Attributes) -> None:
        """Change attributes of the finished store."""
        seal = read_sealed(self._seals / FINISHED)
        (self._seals / FINISHED).unlink()
        StoreWriter(self.path).finish(attrs)
        seal_store(self.path, self._seals, seal["runs"], seal["attrs"])
