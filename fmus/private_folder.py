"""Folders of the user's cache that nobody else can write: their content is loaded and trusted.

Everything below the cache folder has mode 0700. A folder that another user owns or may write is refused: such a user
could choose the code that runs.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "VIBROIMPACT_CACHE"
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class UnsafeFolderError(Exception):
    """Another user owns a folder or may write it; the text names the user, and the remedy."""


def private_folder(name: str) -> Path:
    """Return a folder in the cache that only this user can write; make it if it is absent.

    The cache is `$VIBROIMPACT_CACHE`, by default the user's cache folder of the system.

    Raises
    ------
    UnsafeFolderError
        Another user owns the folder or the cache folder, or may write it.
    OSError
        The folder cannot be made.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    root = Path(chosen) if chosen else platformdirs.user_cache_path("vibroimpact")
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = root / name
    folder.mkdir(mode=0o700, exist_ok=True)
    refuse_links(folder)
    # a folder that the user chose may hold other things and keeps its mode; the others belong to this package
    for place, ours in ((root, not chosen), (folder, True)):
        if chosen:
            refuse_unsafe(place)
        if ours:
            _close_to_others(place)
        refuse_unsafe(place)
    return folder


def refuse_links(folder: Path) -> None:
    """Raise UnsafeFolderError if a folder is a link, whose target was not checked."""
    if folder.is_symlink():
        raise UnsafeFolderError(f"{folder}: expected a folder, got a link. Delete the link.")


def refuse_unsafe(folder: Path) -> None:
    """Raise UnsafeFolderError if another user owns a folder, or others may write it.

    The superuser, who can change everything anyway, may own it. With the sticky bit (as /tmp has it), others can add
    names to a folder but replace none.
    """
    if not hasattr(os, "geteuid"):
        return  # systems without owners and modes keep the folders of users apart by themselves
    status = folder.stat()
    if status.st_uid not in (0, os.geteuid()):
        raise UnsafeFolderError(
            f"{folder}: expected a folder of your own, got one of user {status.st_uid}. Whoever owns it could change "
            f"the code that runs. Set {CACHE_VARIABLE} to a folder of your own."
        )
    if status.st_mode & _OTHERS_WRITE and not status.st_mode & stat.S_ISVTX:
        raise UnsafeFolderError(
            f"{folder}: expected a folder that only you can write, got mode {stat.S_IMODE(status.st_mode):04o}. Others "
            f"could have changed the code that runs: delete the folder, which is made again, then `chmod go-w` the one "
            f"it lies in; or set {CACHE_VARIABLE} to another one."
        )


def _close_to_others(folder: Path) -> None:
    """Set mode 0700 on a folder of this user; version 0.1 left it open."""
    if hasattr(os, "geteuid") and folder.stat().st_uid == os.geteuid():
        folder.chmod(0o700)
