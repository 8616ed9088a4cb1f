"""The dataset of a campaign: one file that is joined from all parts at the end, or a store that grows by shards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from vibroimpact.analysis.dataset import read_flat, write_dataset
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.campaign.extension import Kept, is_of, read_finished
from vibroimpact.orchestrator.campaign.manifest import Manifest
from vibroimpact.orchestrator.campaign.parts import StoredPart, compact
from vibroimpact.orchestrator.campaign.workers.chunks import ChunkResult, Work
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene import Scene

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.stores.sealing import GrowingStore
    from vibroimpact.orchestrator.campaign.stores.seals import Seal
    from vibroimpact.orchestrator.campaign.stores.shards import Shard

Attributes = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ShardParts:
    """A shard whose runs are all in parts or kept rows, with the start state of the next run of its branch."""

    shard: Shard
    branch: int
    paths: tuple[AnyPath, ...]
    kept: AnyPath | None
    carried: State | None


class UnfitShardsError(DatasetError):
    """Shards of a store do not have the objects that their seals name; `found` has the seals, each with the reason."""

    def __init__(self, found: list[tuple[AnyPath, str]]) -> None:
        super().__init__(f"{found[0][0].name}: {found[0][1]}")
        self.found = found


class Destination(ABC):
    """The dataset of a campaign; all rows are parts until the end, unless a class says otherwise.

    Attributes
    ----------
    path : Path or ObjectPath
    store : GrowingStore or None
        The store into which workers write shards.
    shards : sequence of Shard
        Shards that no chunk crosses, in run order.
    """

    path: AnyPath
    store: GrowingStore | None = None
    shards: Sequence[Shard] = ()

    @abstractmethod
    def finished(self, manifest: Manifest) -> tuple[int, Attributes] | None:
        """Return the number of runs and the attributes of the finished dataset of a campaign; None without one."""

    @abstractmethod
    def retitle(self, attrs: Attributes) -> None:
        """Change attributes of the finished dataset."""

    @abstractmethod
    def complete(self, work: Work, paths: Sequence[AnyPath], form: DatasetForm, attrs: Attributes) -> bool:
        """Write the dataset from the rows in these files; return whether a run has a message.

        DatasetError: a part cannot be used; `parts.unfit_parts` finds it. UnfitShardsError: shards have changed.
        OSError: the dataset cannot be written.
        """

    def make(self) -> None:
        """Prepare the dataset for the first rows."""
        return

    def held(self) -> list[StoredPart]:
        """Return the runs that are in the dataset already; a damaged shard is named and given up."""
        return []

    def rows(self, path: AnyPath) -> xr.Dataset:
        """Return the rows of a part, or of the shard of a seal."""
        return read_flat(path)

    def blocks(self, path: AnyPath) -> Iterator[xr.Dataset]:
        """Yield the same rows in blocks that fit in memory."""
        yield self.rows(path)

    def drop(self, part: StoredPart) -> None:
        """Remove a part, or a shard from the dataset, whose points are computed again."""
        part.path.unlink(missing_ok=True)

    def expect(self, parts: Sequence[StoredPart], kept: Kept | None) -> None:
        """Take note of the parts that are there before the first chunk."""
        return

    def taken(self, result: ChunkResult) -> list[ShardParts]:
        """Take note of the rows of a chunk; return the shards that are complete by it, and not yet written."""
        return []

    def sealed(self, seal: Seal) -> None:
        """Take note of a shard that is written."""
        return

    def seal(self, work: Work, complete: ShardParts) -> None:
        """Write a complete shard; it stays in its parts where one of them is damaged, which is met again at the end."""
        return


class JoinedFile(Destination):
    """The file `dataset.nc`, made of all parts when the last run is computed."""

    def __init__(self, home: Path, scene: Scene) -> None:
        self._file = self.path = home / "dataset.nc"
        self._scene = scene

    def finished(self, manifest: Manifest) -> tuple[int, Attributes] | None:
        """Return the number of runs and the attributes of the dataset of a campaign; None without one."""
        if not self.path.exists():
            return None
        done = read_finished(self.path)
        return (len(done.run_index), done.attrs) if is_of(done.attrs, manifest, self._scene) else None

    def retitle(self, attrs: Attributes) -> None:
        """Change attributes of the dataset, which is written anew."""
        write_dataset(read_flat(self.path).assign_attrs(attrs), self.path)

    def complete(self, work: Work, paths: Sequence[AnyPath], form: DatasetForm, attrs: Attributes) -> bool:
        """Join the rows of all parts to one file; return whether a run has a message."""
        return compact(paths, self._file, form, attrs)
