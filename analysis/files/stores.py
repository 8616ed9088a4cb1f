"""The only module that imports zarr: stores in folders and at addresses, read within bounds.

A store is not trusted. Each object that is read has a bounded size, and each compressed chunk must expand to the size
that its array announces. Every fault of a store is one DatasetError that names it.
"""

from __future__ import annotations

import errno
import json
import logging
import math
import os
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from vibroimpact.analysis.files.store_metadata import MOST_METADATA_BYTES, finished_nodes
from vibroimpact.fmus.errors import DatasetError, UsageError

if TYPE_CHECKING:
    import numpy as np

STORE_ENDING = ".zarr"
LONGEST_REASON = 200
_SETTING = threading.RLock()
"""Held while the settings of zarr are those of this module."""
_TASK_OF_ZARR = re.compile(r"never retrieved(?s:.)* defined at [^\n]*[/\\]zarr[/\\]")
_NUMBERS = {
    FileNotFoundError: errno.ENOENT,
    FileExistsError: errno.EEXIST,
    PermissionError: errno.EACCES,
}
Place = str | os.PathLike[str]
"""A path, or an address such as `s3://bucket/map.zarr`."""


def is_address(place: Place) -> bool:
    """Return whether a place is an address of fsspec, and no path.

    >>> is_address("s3://bucket/map.zarr"), is_address("map.zarr")
    (True, False)
    """
    return "://" in os.fspath(place)


def is_store(place: Place) -> bool:
    """Return whether a place is one of a store: any address, or a folder with the metadata of one."""
    return is_address(place) or holds_store(place)


def holds_store(place: Place) -> bool:
    """Return whether there are metadata of a store at a place."""
    if not is_address(place):
        return os.path.isfile(os.path.join(place, "zarr.json"))
    zarr_package()
    with one_store_error(place):
        system, root = system_of(place)
        return bool(system.exists(f"{root}/zarr.json"))


@cache
def zarr_package() -> ModuleType:
    """Return the package zarr; raise UsageError where it is missing."""
    try:
        import fsspec  # noqa: F401  # of the same extra
        import zarr
    except ImportError as missing:
        raise UsageError(
            f"store: expected the package {missing.name} for Zarr stores, got none. Install it: pip install "
            "'vibroimpact[store]', or in a clone pip install '.[store]'."
        ) from None
    logging.getLogger("asyncio").addFilter(_is_of_others)
    return zarr


def _is_of_others(record: logging.LogRecord) -> bool:
    """Return whether a line of asyncio is about other tasks than zarr's.

    Of several requests that fail, zarr raises the first error; asyncio would print the others with their traces.
    """
    return _TASK_OF_ZARR.search(record.getMessage()) is None


@contextmanager
def quiet_zarr() -> Iterator[None]:
    """Hold back the remark that consolidated metadata are zarr's own extension of format 3."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Consolidated metadata is currently not part")
        yield


def opened_group(place: Place, mode: str) -> Any:
    """Return the root group of a store.

    Parameters
    ----------
    place : path or address
    mode : {"r", "r+", "w-"}
        Read a finished store by its consolidated metadata; write into a store; make a new store.

    Raises
    ------
    DatasetError
        There is no store, it is unfinished, or it cannot be reached.
    """
    zarr = zarr_package()
    with one_store_error(place, writes=is_written(place, mode)), quiet_zarr(), _settings():
        store = _bounded_store(place, read_only=mode == "r")
        if mode == "w-":
            return zarr.create_group(store, zarr_format=3)
        if mode == "r":
            _refuse_unfinished(place)
        return zarr.open_group(store, mode=mode, zarr_format=3, use_consolidated=mode == "r")


def is_written(place: Place, mode: str) -> bool:
    """Return whether an OSError at a store is none of its damage: it is new, or at an address that is written to."""
    return mode == "w-" or (mode == "r+" and is_address(place))


@contextmanager
def _settings() -> Iterator[None]:
    """Hold the settings with which arrays are made and opened, with the bounded codecs, for one thread at a time.

    They are zarr's for the whole process: a thread that leaves would take them from another one.
    """
    from vibroimpact.analysis.files.bounded_stores import SETTINGS

    with _SETTING, zarr_package().config.set(SETTINGS):
        yield


def arrays_of(group: Any) -> dict[str, Any]:
    """Return the arrays of a group, by name."""
    with _settings():
        return dict(group.arrays())


def _bounded_store(place: Place, *, read_only: bool) -> Any:
    from zarr.storage import FsspecStore, LocalStore

    from vibroimpact.analysis.files.bounded_stores import BoundedStore

    if is_address(place):
        options = {"use_listings_cache": False}
        found = FsspecStore.from_url(os.fspath(place), storage_options=options, read_only=read_only)
        return BoundedStore(found)
    return BoundedStore(LocalStore(Path(place).absolute(), read_only=read_only))


def _refuse_unfinished(place: Place) -> None:
    """Raise DatasetError unless a store has the consolidated metadata that are written last."""
    system, root = system_of(place)
    head = f"{root}/zarr.json"
    try:
        found = first_bytes(system, head, MOST_METADATA_BYTES + 1)
        if len(found) > MOST_METADATA_BYTES:
            raise ValueError(f"metadata above {MOST_METADATA_BYTES} bytes")
    except FileNotFoundError:
        raise DatasetError(f"{os.fspath(place)}: expected a Zarr store, got none there.") from None
    if finished_nodes(json.loads(found)) is None:
        raise DatasetError(
            f"{os.fspath(place)}: expected a finished store, got one without consolidated metadata. "
            "Its writing has not ended: run the command that writes it again."
        )


def system_of(place: Place) -> tuple[Any, str]:
    """Return the file system of a place, and its path there."""
    from fsspec.core import url_to_fs

    if is_address(place):
        # other processes write here, too: a remembered listing would hide their objects
        system, root = url_to_fs(os.fspath(place), use_listings_cache=False)
    else:
        system, root = url_to_fs(os.path.abspath(place))
    return system, str(root).rstrip("/")


def first_bytes(system: Any, path: str, most: int | None = None) -> bytes:
    """Return the content of an object, or no more than its first bytes: a range needs no request for its size."""
    try:
        return bytes(system.cat_file(path, start=0, end=most))
    except OSError as error:
        if "not satisfiable" in str(error):  # an empty object of S3 has no first byte
            return b""
        raise


def size_of(place: Place) -> tuple[int, int]:
    """Return the size of a store or a file, bytes, and the number of its objects."""
    sizes = list(_sizes(place))
    return sum(sizes), len(sizes)


def size_up_to(place: Place, enough: int) -> int:
    """Return the size of a store or a file, bytes; in a folder the listing ends when it reaches `enough`."""
    found = 0
    for size in _sizes(place):
        found += size
        if found >= enough:
            break
    return found


def _sizes(place: Place) -> Iterator[int]:
    """Yield the size of each object of a store or a file, bytes."""
    zarr_package()
    with one_store_error(place):
        if is_address(place):
            system, root = system_of(place)
            yield from system.du(root, total=False).values()
        elif os.path.isdir(place):
            for folder, _, names in os.walk(place, onerror=_raised):
                yield from (os.stat(os.path.join(folder, name)).st_size for name in names)
        else:
            yield os.stat(place).st_size


def _raised(error: OSError) -> None:
    raise error


def announce(place: Place, name: str, shape: tuple[int, ...]) -> None:
    """Write another shape of an array into its metadata; zarr would list every chunk of the old shape."""
    system, root = system_of(place)
    path = f"{root}/{name}/zarr.json"
    system.pipe_file(path, json.dumps(json.loads(first_bytes(system, path)) | {"shape": shape}).encode())


def objects_below(place: Place, prefix: str = "") -> list[str]:
    """Return the keys of the objects of a store below a prefix, by default of all; OSError out of reach."""
    system, root = system_of(place)
    # other file systems leave out what they cannot list, unless they are asked to raise
    options = {} if system.async_impl else {"on_error": "raise"}
    with one_store_error(place, writes=True):
        try:
            found = system.find(f"{root}/{prefix}" if prefix else root, **options)
        except FileNotFoundError:
            return []
        return [str(path).removeprefix(f"{root}/") for path in found]


def dims_of(array: Any) -> tuple[str, ...]:
    """Return the names of the dimensions of an array."""
    return tuple(array.metadata.dimension_names or ())


def kind_of(array: Any) -> np.dtype[Any]:
    """Return the type of the values of an array in memory: texts are objects."""
    import numpy as np  # commands of the service need none

    return np.dtype(object) if array.dtype.kind in "OUT" else np.dtype(array.dtype).newbyteorder("=")


_MISSING = {"f": math.nan, "u": 0}
"""Values of cells that are never written, by the kind of numpy; rows, the only unsigned numbers, are all written."""


def new_array(
    group: Any,
    name: str,
    dims: tuple[str, ...],
    shape: tuple[int, ...],
    chunk: tuple[int, ...],
    shard: tuple[int, ...],
    dtype: Any,
    attributes: dict[str, Any],
) -> Any:
    """Make an array of a group: compressed chunks with a checksum each; values never written are missing."""
    import numpy as np  # files are written by processes that need no arrays
    from zarr.codecs import BloscCodec, Crc32cCodec, ZstdCodec

    kind = np.dtype(dtype).kind
    is_text = kind in "OUT"
    packed = ZstdCodec(level=1) if is_text else BloscCodec(cname="zstd", clevel=1, shuffle="shuffle")
    with _settings():
        return group.create_array(
            name,
            shape=shape,
            dtype="string" if is_text else dtype,
            chunks=chunk,
            shards=None if shard == chunk else shard,
            compressors=(packed, Crc32cCodec()),
            fill_value="" if is_text else _MISSING.get(kind, -1),
            attributes=attributes,
            dimension_names=dims,
        )


@contextmanager
def one_store_error(place: Place, *, writes: bool = False) -> Iterator[None]:
    """Turn every exception from a store into one DatasetError that names it.

    While it `writes`, an OSError stays as it is: a full disk is no damage. A lost connection becomes an OSError, too.
    """
    try:
        yield
    except (DatasetError, UsageError):
        raise
    except ModuleNotFoundError as missing:
        raise UsageError(
            f"{os.fspath(place)}: expected the package {missing.name} for this kind of address, got none. "
            f"Install it: pip install {missing.name}."
        ) from missing
    except Exception as problem:
        if isinstance(problem, NameError | AssertionError):
            raise
        if writes and is_address(place) and not isinstance(problem, ValueError | LookupError | TypeError):
            raise outage(place, problem) from problem
        if writes and isinstance(problem, OSError):
            raise
        raise DatasetError(
            f"{os.fspath(place)}: expected a Zarr store that can be read and written, got "
            f"{type(problem).__name__}: {reason_of(problem)}. It is damaged, of another kind, or out of reach."
        ) from problem


def reason_of(problem: Exception) -> str:
    """Return the first line of an exception, cut to a bounded length."""
    words = (getattr(problem, "strerror", None) or str(problem)).strip().splitlines()[:1]
    return words[0][:LONGEST_REASON].rstrip(".") if words else ""


def outage(place: Place, problem: Exception) -> OSError:
    """Return any error of an object store as an OSError with a number, one line, and the address.

    Each package for a kind of address has exceptions of its own, and few of them have a number.
    """
    reason = reason_of(problem) or type(problem).__name__
    if not isinstance(problem, OSError):
        return OSError(errno.EIO, f"{type(problem).__name__}: {reason}", os.fspath(place))
    numbers = (number for kind, number in _NUMBERS.items() if isinstance(problem, kind))
    return OSError(problem.errno or next(numbers, errno.EIO), reason, os.fspath(place))


def consolidate(place: Place) -> None:
    """Write the consolidated metadata of a store, which mark it as finished."""
    zarr = zarr_package()
    with one_store_error(place, writes=True), quiet_zarr():
        zarr.consolidate_metadata(_bounded_store(place, read_only=False), zarr_format=3)
