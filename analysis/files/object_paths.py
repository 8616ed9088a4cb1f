"""A file of a campaign: in a folder (`pathlib.Path`), or an object at an address with the same few operations.

An object store has no rename, no append and no fsync. A write of an object is whole or absent, and later reads see it.
Folders are prefixes of names there: they need no making, and vanish with their last object.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.files.stores import (
    first_bytes,
    is_address,
    outage,
    reason_of,
    system_of,
    zarr_package,
)
from vibroimpact.fmus.errors import UsageError


@dataclass(frozen=True, slots=True, order=True)
class ObjectPath(os.PathLike[str]):
    """The address of an object, with the operations of `pathlib.Path` that a campaign needs.

    Every fault of the object store is an OSError that names the address, also a lost connection.
    """

    address: str

    def __str__(self) -> str:
        """Return the address."""
        return self.address

    def __fspath__(self) -> str:
        """Return the address, by which datasets are opened."""
        return self.address

    def __truediv__(self, name: str) -> ObjectPath:
        """Return the address of an object below this one."""
        return ObjectPath(f"{self.address}/{name}")

    @property
    def name(self) -> str:
        """Last part of the address."""
        return self.address.rpartition("/")[2]

    @property
    def stem(self) -> str:
        """Name without its ending."""
        return Path(self.name).stem

    @property
    def suffix(self) -> str:
        """Ending of the name."""
        return Path(self.name).suffix

    @property
    def parent(self) -> ObjectPath:
        """Address without its last part."""
        return ObjectPath(self.address.rpartition("/")[0])

    def with_name(self, name: str) -> ObjectPath:
        """Return the address of an object beside this one."""
        return self.parent / name

    def absolute(self) -> ObjectPath:
        """Return this address: addresses are absolute."""
        return self

    def mkdir(self, *, exist_ok: bool = True) -> None:
        """Do nothing: a prefix needs no making."""

    def rmdir(self) -> None:
        """Do nothing: a prefix vanishes with its last object."""

    def exists(self) -> bool:
        """Return whether there is an object, or one below this prefix."""
        return self._kind() is not None

    def is_file(self) -> bool:
        """Return whether there is an object."""
        return self._kind() == "file"

    def is_dir(self) -> bool:
        """Return whether there are objects below this prefix."""
        return self._kind() == "directory"

    def _kind(self) -> str | None:
        try:
            with self._opened() as (system, path):
                return str(system.info(path)["type"])
        except FileNotFoundError:
            return None

    def iterdir(self) -> Iterator[ObjectPath]:
        """Yield the objects and prefixes below this prefix, one level deep."""
        try:
            with self._opened() as (system, path):
                found = [str(each).rstrip("/") for each in system.ls(path, detail=False)]
        except FileNotFoundError:
            return
        yield from (self / each.rpartition("/")[2] for each in sorted(found) if each != path)

    def read_bytes(self, most: int | None = None) -> bytes:
        """Return the content of the object, or no more than its first bytes."""
        with self._opened() as (system, path):
            return first_bytes(system, path, most)

    def read_text(self, encoding: str) -> str:
        """Return the content of the object as text."""
        return self.read_bytes().decode(encoding)

    def write_bytes(self, content: bytes) -> None:
        """Write the object, whole or not at all."""
        with self._opened() as (system, path):
            system.pipe_file(path, content)

    def write_text(self, content: str, encoding: str) -> None:
        """Write the object, whole or not at all."""
        self.write_bytes(content.encode(encoding))

    def create(self, content: bytes) -> None:
        """Write an object that is not there yet; raise FileExistsError where it is. One of two writers succeeds."""
        with self._opened() as (system, path):
            system.pipe_file(path, content, mode="create")

    def unlink(self, *, missing_ok: bool = False) -> None:
        """Remove the object."""
        try:
            with self._opened() as (system, path):
                system.rm_file(path)
        except FileNotFoundError:
            if not missing_ok:
                raise

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, str]]:
        """Yield the file system and the path there; each of its faults becomes an OSError with the address."""
        try:
            yield system_of(self)
        except Exception as error:
            raise outage(self, error) from error


AnyPath = Path | ObjectPath
"""A file or a folder of a campaign, wherever the campaign lies."""


def located(place: str | os.PathLike[str]) -> AnyPath:
    """Return the path of a place: an ObjectPath for an address, unless it is one of this machine's files.

    Raises
    ------
    UsageError
        A package for this kind of address is missing, or there is no such kind.

    Examples
    --------
    >>> located("memory://map") / "seals"
    ObjectPath(address='memory://map/seals')
    >>> located("file:///data/map").name
    'map'
    """
    text = os.fspath(place)
    if not is_address(text):
        return Path(text)
    zarr_package()
    try:
        if "::" in text:
            raise ValueError("a chain of addresses, whose copies hide objects of others")
        system, root = system_of(text)
    except (ImportError, ValueError, OSError) as error:
        raise UsageError(
            f"{text}: expected an address of fsspec, such as s3://bucket/map, got {reason_of(error)}."
        ) from error
    kinds = (system.protocol,) if isinstance(system.protocol, str) else system.protocol
    return Path(root) if "file" in kinds else ObjectPath(text.rstrip("/"))


def bounded_bytes(path: AnyPath, most: int) -> bytes:
    """Return the content of a file or an object; ValueError if it is no file, or has more bytes than `most`.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
    """
    if isinstance(path, ObjectPath):
        content = path.read_bytes(most + 1)
        if len(content) > most:
            raise ValueError(f"it has more than {most} bytes")
        return content
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is no file")
    if status.st_size > most:
        raise ValueError(f"it has {status.st_size} bytes, more than {most}")
    return path.read_bytes()


@contextmanager
def opened_bytes(path: AnyPath) -> Iterator[BinaryIO]:
    """Open a file to read its bytes block by block, or an object, which is in memory then."""
    with open(path, "rb") if isinstance(path, Path) else BytesIO(path.read_bytes()) as file:
        yield file


@contextmanager
def local_copy(path: str | os.PathLike[str]) -> Iterator[str | os.PathLike[str]]:
    """Yield a path that libraries of this machine can open: the path itself, or a copy of an object that is there."""
    if not isinstance(path, ObjectPath):
        yield path
        return
    with ScratchFolder("object") as folder:
        copy = Path(folder.name, path.name)
        with suppress(FileNotFoundError):
            copy.write_bytes(path.read_bytes())
        yield copy


def raise_outage(path: AnyPath, error: Exception) -> None:
    """Raise the error of an object store that is out of reach: it says nothing about the object, which may be sound."""
    if isinstance(path, ObjectPath) and isinstance(error, OSError) and error.errno != errno.ENOENT:
        raise error
