"""Homes of campaigns that are disturbed: a file in a folder, a store in a folder, a store in an object store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from support.object_server import served_apart
from support.object_store import bucket_of

from vibroimpact.analysis.files import object_lock
from vibroimpact.analysis.files.object_paths import AnyPath, located
from vibroimpact.orchestrator.campaign import formats

KINDS = ("netcdf", "zarr", "object store")
"""Kinds of homes, one after the other by the seed of a case."""
BEAT_SECONDS, LEASE_SECONDS = 0.4, 3.0
"""Beat and lease of the lock of an address: a killed command is succeeded after the lease."""


@dataclass(frozen=True, slots=True)
class Home:
    """The home of a campaign.

    Attributes
    ----------
    place : str
        Folder, or address.
    options : tuple of str
        Options of the command that begins the campaign.
    switch : Path
        File whose presence makes requests to the object store fail.
    """

    place: str
    options: tuple[str, ...]
    switch: Path

    @property
    def path(self) -> AnyPath:
        """Path of the home."""
        return located(self.place)

    @property
    def is_address(self) -> bool:
        """Whether the home is in an object store."""
        return not isinstance(self.path, Path)

    def files(self, folder: str, beginning: str) -> list[AnyPath]:
        """Return the files of a folder of the home whose names begin in a way, sorted."""
        inside = self.path / folder
        there = inside.iterdir() if self.is_address or inside.is_dir() else ()
        return sorted(path for path in there if path.name.startswith(beginning))


def entry(shard_points: int, program: str) -> str:
    """Return a program of the command line with small shards, and a lock that is lost after seconds."""
    return (
        f"import {formats.__name__} as formats, {object_lock.__name__} as lock; "
        f"formats.SHARD_POINTS = {shard_points}; "
        f"lock.BEAT_SECONDS, lock.LEASE_SECONDS = {BEAT_SECONDS}, {LEASE_SECONDS}; {program}"
    )


def left_in(scratch: Path) -> list[str]:
    """Return the names of the files that commands have left behind in their folder for temporary files.

    The socket of a fork server outlives a killed command, in a folder of Python's own (`pymp-`).
    """
    return [path.name for path in scratch.iterdir() if not path.name.startswith("pymp-")]


@contextmanager
def home_of(kind: str) -> Iterator[Home]:
    """Yield the home of a campaign, with the object store that it needs."""
    switch = Path("failing")
    if kind != "object store":
        yield Home("campaign", ("--format", kind), switch)
        return
    with served_apart(switch) as endpoint, pytest.MonkeyPatch.context() as patch, bucket_of(endpoint, patch):
        yield Home("s3://bucket/campaign", (), switch)
