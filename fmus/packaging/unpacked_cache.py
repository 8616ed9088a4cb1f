"""The cache of unpacked FMUs is bounded in size and age; what a living process uses is never swept.

A process holds a shared lock on each unpacked folder that it uses. The system releases the lock when the process dies,
however it dies. A folder whose lock is free is swept where it was not used for long. Where the cache is too large, the
longest unused go first. Windows cannot lock folders; a folder with a loaded library stays there, since it cannot be
renamed.
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
"""Bytes of all unpacked FMUs above which those that were not used for the longest time go."""
MOST_AGE = 30 * 86400.0
"""Time since a process began to use an FMU, s, above which its unpacked copy goes; it is unpacked again when needed."""
UNPACKING = ".unpacking-"
"""First letters of the names of folders that are being filled or removed."""
SIZES = "sizes"
"""File of the cache: a line `folder bytes` for each folder whose files were counted, so that each is counted once."""
_ENTRY = re.compile(r"[0-9a-f]{64}")
_SIZE = re.compile(r"\d{1,15}", re.ASCII)
_MOST_GONE = 100
"""Lines of folders that are gone which the file of sizes may have in any case."""
_MOST_TRIES, _PAUSE = 500, 0.01
"""Tries, and s between two, to lock a folder that another process sweeps: it renames it at once."""

_held: dict[Path, int] = {}
_most_held: list[int] = []


def hold_at_most(count: int) -> None:
    """Let this process, which runs no FMU itself, hold only the last few that it looked at."""
    _most_held[:] = [count]


def hold(folder: Path) -> bool:
    """Keep a folder from being swept for as long as this process lives; return whether it is there.

    A child made by `fork` holds it too.
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
    """Let a folder be swept by others."""
    handle = _held.pop(folder, None)
    if handle is not None:
        os.close(handle)


def _is_at(handle: int, folder: Path) -> bool:
    """Whether an open folder is the one that lies at a path."""
    try:
        return os.path.samestat(os.fstat(handle), folder.lstat())
    except OSError:
        return False


def _locked(folder: Path) -> int | None:
    """Return a handle of a folder with a shared lock; None where it is not there, or cannot be locked."""
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
    """Lock an open folder; return whether that was possible, None where its file system has no locks."""
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
    """Remove what no living process uses: what killed ones left half unpacked, what is old, and what is too much.

    So many bytes are coming, about to be unpacked. A folder that is half unpacked, not locked and older than
    `abandoned_after` (s) is nobody's.
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
    """Return the bytes of each folder that an earlier sweep has counted; a line that says nothing is passed over."""
    try:
        lines = (cache / SIZES).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return {}
    pairs = (line.partition(" ") for line in lines)
    return {name: int(size) for name, _, size in pairs if _ENTRY.fullmatch(name) and _SIZE.fullmatch(size)}


def _keep_sizes(cache: Path, known: Mapping[str, int], sizes: Mapping[str, int]) -> None:
    """Keep sizes for the next sweep: new ones at the end, all anew where most are gone. Lost ones are counted again."""
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
