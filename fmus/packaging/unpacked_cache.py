"""The cache of unpacked FMUs, bounded in size and age; folders in use by a living process are never removed.

A process holds a shared lock on each unpacked folder that it uses. The system releases the lock when the process dies,
however it dies. A sweep removes folders with a free lock that were unused for long. If the cache is too large, the
longest unused folders go first. Windows cannot lock folders; there a folder with a loaded library stays, since it
cannot be renamed.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

if sys.platform != "win32":
    import fcntl

MOST_BYTES = 4 * 2**30
"""Size of all unpacked FMUs, bytes, above which the longest unused are removed."""
MOST_AGE = 30 * 86400.0
"""Time since a process last began to use an FMU, s, above which its copy is removed; it is unpacked again on demand."""
UNPACKING = ".unpacking-"
"""Prefix of the names of folders that are being filled or removed."""
SIZES = "sizes"
"""File of the cache with a line `folder bytes` for each measured folder, so that each is measured once."""
_ENTRY = re.compile(r"[0-9a-f]{64}")
_SIZE = re.compile(r"\d{1,15}", re.ASCII)
_MOST_GONE = 100
"""Number of lines of removed folders that the file of sizes may always keep."""
_MOST_TRIES, _PAUSE = 500, 0.01
"""Tries, and pause between tries, s, to lock a folder under removal by another process, which renames it at once."""

_held: dict[Path, int] = {}
_most_held: list[int] = []


def hold_at_most(count: int) -> None:
    """Limit the folders that this process holds to the last few; for processes that run no FMU themselves."""
    _most_held[:] = [count]


def hold(folder: Path) -> bool:
    """Protect a folder from removal while this process lives; return whether the folder exists.

    A child made by `fork` protects it too.
    """
    handle = _held.get(folder)
    if handle is not None:
        if _is_at(handle, folder):
            return True
        let_go(folder)
    handle = _locked(folder)
    if handle is None:
        return folder.is_dir()
    if _held.setdefault(folder, handle) != handle:  # another thread was first
        os.close(handle)
    for oldest in list(_held)[: -_most_held[0]] if _most_held else ():
        let_go(oldest)
    with suppress(OSError):  # a cache that cannot be written is not swept either
        os.utime(folder)
    return True


def let_go(folder: Path) -> None:
    """Allow other processes to remove a folder."""
    handle = _held.pop(folder, None)
    if handle is not None:
        os.close(handle)


def _is_at(handle: int, folder: Path) -> bool:
    """Whether an open folder is still the folder at a path."""
    try:
        return os.path.samestat(os.fstat(handle), folder.lstat())
    except OSError:
        return False


def _locked(folder: Path) -> int | None:
    """Return a handle of a folder with a shared lock; None if it is absent or cannot be locked."""
    for _ in range(_MOST_TRIES):
        handle = _opened(folder)
        if handle is None:
            return None
        taken = _try_lock(handle, shared=True)
        if taken and _is_at(handle, folder):
            return handle
        os.close(handle)
        if taken is None:
            return None
        time.sleep(_PAUSE)
    return None


def _opened(folder: Path) -> int | None:
    if sys.platform == "win32":
        return None
    try:
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None


def _try_lock(handle: int, *, shared: bool) -> bool | None:
    """Lock an open folder; return whether that was possible, None if its file system has no locks."""
    if sys.platform == "win32":
        return None
    try:
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def sweep(cache: Path, coming: int, abandoned_after: float) -> None:
    """Remove unused folders: remains of killed processes, old folders, and the longest unused of a too large cache.

    `coming` bytes are about to be unpacked, and count as used. A partly unpacked folder that is unlocked and older than
    `abandoned_after` (s) belongs to no process.
    """
    now, total, entries = time.time(), coming, []
    known = _known_sizes(cache)
    sizes: dict[str, int] = {}
    for folder in cache.iterdir():
        with suppress(FileNotFoundError):
            used = folder.lstat().st_mtime
            if folder.name.startswith(UNPACKING):
                if now - used > abandoned_after:
                    _remove_unused(folder)
            elif _ENTRY.fullmatch(folder.name):
                size = known[folder.name] if folder.name in known else _size(folder)
                sizes[folder.name] = size
                entries.append((used, size, folder))
                total += size
    _keep_sizes(cache, known, sizes)
    for used, size, folder in sorted(entries):
        if (now - used > MOST_AGE or total > MOST_BYTES) and _remove_unused(folder):
            total -= size


def _known_sizes(cache: Path) -> dict[str, int]:
    """Return the bytes of each folder that an earlier sweep measured; malformed lines are ignored."""
    try:
        lines = (cache / SIZES).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return {}
    pairs = (line.partition(" ") for line in lines)
    return {name: int(size) for name, _, size in pairs if _ENTRY.fullmatch(name) and _SIZE.fullmatch(size)}


def _keep_sizes(cache: Path, known: Mapping[str, int], sizes: Mapping[str, int]) -> None:
    """Append new sizes to the file, or rewrite it if most of its folders are gone; lost sizes are measured again."""
    new = {name: size for name, size in sizes.items() if name not in known}
    forgets = len(known) > 2 * len(sizes) + _MOST_GONE
    text = "".join(f"{name} {size}\n" for name, size in (sizes if forgets else new).items())
    if text:
        with suppress(OSError), (cache / SIZES).open("w" if forgets else "a", encoding="ascii") as file:
            file.write(text)


def _size(folder: Path) -> int:
    """Return the bytes of the files in a folder; links are not followed."""
    found = 0
    with suppress(OSError):
        for place, _, names in os.walk(folder):
            for name in names:
                with suppress(FileNotFoundError):
                    found += os.lstat(os.path.join(place, name)).st_size
    return found


def _remove_unused(folder: Path) -> bool:
    """Remove a folder unless a living process uses it; return whether it is gone."""
    handle = _opened(folder)
    if handle is None and sys.platform != "win32":
        return False
    try:
        if handle is not None and not _try_lock(handle, shared=False):
            return False
        doomed = folder.with_name(f"{UNPACKING}swept-{secrets.token_hex(8)}")
        folder.rename(doomed)
        shutil.rmtree(doomed, ignore_errors=True)
    except OSError:
        return False
    finally:
        if handle is not None:
            os.close(handle)
    return True
