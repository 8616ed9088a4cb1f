"""The seals of a growing store: a file for each shard, written after all objects of the shard.

A seal has the SHA-256 of each object of its shard. A shard without a seal is not there, whatever its objects hold: its
runs are computed again. Objects that differ from their seal are damaged.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vibroimpact.analysis.files.at_once import done_at_once
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.object_paths import (
    AnyPath,
    ObjectPath,
    bounded_bytes,
    opened_bytes,
    raise_outage,
)
from vibroimpact.analysis.files.store_attributes import attributes_read
from vibroimpact.analysis.files.stores import objects_below, opened_group
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import CALL, message

STORE, SEALS = "dataset.zarr", "seals"
"""Names of the store of a campaign, and of the folder of its seals."""
FINISHED = "finished.json"
"""Name of the seal of a finished store."""
_NAME = re.compile(r"shard-\d{6,}\.json")
_LARGEST = 16 * 2**20
"""Largest size of a seal that is read, bytes: a manifest takes 8 kB, an object 100 bytes."""
_BLOCK = 1 << 20


@dataclass(frozen=True, slots=True)
class Seal:
    """The facts about a written shard that resuming a campaign needs.

    Attributes
    ----------
    shard : int
        Number of the shard in its store.
    branch, first, stop : int
        Branch of the first run, and the runs `first` to `stop - 1`.
    attrs : mapping
        Attributes as those of a part: scene, manifest, and start state of the next run of the branch.
    outcomes : mapping of str to int
        Number of runs by outcome.
    has_messages : bool
        Whether a run has a message.
    periods : int
        Largest number of recorded periods of a run.
    absent : tuple of str
        Variables of the store that no run of the shard has.
    objects : mapping of str to str
        SHA-256 of each object of the shard, by its key in the store.
    """

    shard: int
    branch: int
    first: int
    stop: int
    attrs: Mapping[str, Any]
    outcomes: Mapping[str, int]
    has_messages: bool
    periods: int
    absent: tuple[str, ...]
    objects: Mapping[str, str]


def seal_path(folder: AnyPath, shard: int) -> AnyPath:
    """Return the path of the seal of a shard."""
    return folder / f"shard-{shard:06d}.json"


def write_seal(folder: AnyPath, seal: Seal) -> AnyPath:
    """Write a seal, whole or not at all, and return its path."""
    path = seal_path(folder, seal.shard)
    write_sealed(path, asdict(seal))
    return path


def read_seal(path: AnyPath) -> Seal:
    """Return the seal of a shard.

    Raises
    ------
    DatasetError
        The file has changed since it was written.
    """
    content = read_sealed(path)
    try:
        return Seal(**content | {"absent": tuple(content["absent"])})
    except (LookupError, TypeError) as error:
        raise DatasetError(f"{path}: expected the seal of a shard, got other content: {error}.") from error


def write_sealed(path: AnyPath, content: Mapping[str, Any]) -> None:
    """Write facts with their SHA-256, whole or not at all."""
    write_atomically(path, json.dumps({**content, "sha256": _hash_of(content)}, indent=1).encode())


def read_sealed(path: AnyPath) -> dict[str, Any]:
    """Return the facts in a file.

    Raises
    ------
    DatasetError
        The file has changed since `write_sealed` wrote it.
    """
    try:
        content: dict[str, Any] = json.loads(bounded_bytes(path, _LARGEST))
        if content.pop("sha256") != _hash_of(content):
            raise ValueError("not the content whose SHA-256 it has")
        return content
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise_outage(path, error)
        reason = error.strerror if isinstance(error, OSError) else error
        raise DatasetError(f"{path}: expected the seal of a shard, got {reason}.") from error


def seals_in(folder: AnyPath) -> Iterator[AnyPath]:
    """Yield the paths of the seals in a folder, by the number of their shard; other files do not belong to it."""
    if isinstance(folder, ObjectPath) or folder.is_dir():
        yield from sorted(path for path in folder.iterdir() if _NAME.fullmatch(path.name))


def object_hash(path: AnyPath) -> str:
    """Return the SHA-256 of an object of a store in a folder."""
    digest = hashlib.sha256()
    with opened_bytes(path) as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def refuse_changed_objects(store: AnyPath, objects: Mapping[str, str]) -> None:
    """Raise DatasetError unless objects have their SHA-256.

    Raises
    ------
    DatasetError
        It names the first object that differs.
    """

    def refuse_changed(key: str) -> None:
        try:
            found = object_hash(store / key)
        except OSError as error:
            raise_outage(store, error)
            raise DatasetError(f"{store / key}: {error.strerror or error}.") from error
        if found != objects[key]:
            raise DatasetError(f"{store / key}: its content is not the one whose SHA-256 its seal has.")

    done_at_once(refuse_changed, objects, store)


def _scene_of(store: AnyPath) -> str | None:
    """Return the hash of the scene of a store; None without metadata that name one."""
    try:
        found = json.loads((store / "zarr.json").read_bytes())["attributes"].get("scene_hash")
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise_outage(store, error)
        return None
    return None if found is None else str(found)


def has_rows(store: AnyPath) -> bool:
    """Return whether there is a store, or something else, that may hold rows of runs."""
    return store.exists() and (_scene_of(store) is None or (store / "run_id/c").exists())


def refuse_other_store(store: AnyPath, seals: AnyPath, scene_hash: str, *, extended: bool) -> None:
    """Raise UsageError if there is a store of another scene; remove that of the sweep before an extension.

    Raises
    ------
    UsageError
    """
    if _scene_of(store) in (None, scene_hash):
        return
    if not extended or not isinstance(store, Path):
        expected = (
            "expected the store of this campaign, got that of another scene. Move it away; then the same "
        )
        raise UsageError(message(f"{store}: {expected}", CALL, " goes on."))
    remove_store(store, seals)


def remove_store(store: Path, seals: AnyPath) -> None:
    """Remove a store, its metadata last, and all of its seals."""
    for path in seals_in(seals):
        path.unlink()
    (seals / FINISHED).unlink(missing_ok=True)
    if not store.is_dir():
        return
    for inner in store.iterdir():
        if inner.is_dir():
            shutil.rmtree(inner)
    shutil.rmtree(store)


def finished_store(store: AnyPath, seals: AnyPath) -> tuple[int, dict[str, Any]] | None:
    """Return the number of runs and the attributes of a finished store; None where it is unfinished or damaged.

    Objects of shards have seals of their own, and are not read.
    """
    try:
        seal = read_sealed(seals / FINISHED)
        refuse_changed_objects(store, seal["objects"])
        return int(seal["runs"]), attributes_read(opened_group(store, "r").attrs)
    except DatasetError:
        return None


def seal_store(
    store: AnyPath, seals: AnyPath, runs: int, attrs: Mapping[str, Any], sealed: Collection[str] = ()
) -> None:
    """Write the seal of a finished store of some runs: attributes as those of a part, objects without another seal."""
    keys = [key for key in sorted(objects_below(store)) if key not in sealed]
    objects = dict(zip(keys, done_at_once(lambda key: object_hash(store / key), keys, store), strict=True))
    write_sealed(seals / FINISHED, {"runs": runs, "attrs": dict(attrs), "objects": objects})


def _hash_of(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()
