"""The folder of a service, which is its owner's alone: whoever owns it, its token or its database runs code here."""

from __future__ import annotations

import os
from pathlib import Path

from vibroimpact.fmus.errors import UsageError

URL_FILE, TOKEN_FILE = "url", "token"
"""Where a service says its address while it runs, and its token."""
_RULE = "expected a path of your own"
_OWN = (".lock", URL_FILE, TOKEN_FILE, "jobs", "recordings", "fmus")


def refuse_foreign_folder(folder: Path, database: str) -> None:
    """Raise UsageError if the folder of a service, which need not exist, or the database in it, is another user's.

    The service believes what is in its database.
    """
    if not os.path.lexists(folder):
        return
    refuse_foreign(folder)
    journals = (f"{database}{ending}" for ending in ("", "-wal", "-shm", "-journal"))
    for name in (*_OWN, *journals):
        refuse_foreign(folder / name)


def refuse_foreign(path: Path) -> None:
    """Raise UsageError where a path, or what it links to, is another user's; an absent one is nobody's."""
    if not hasattr(os, "geteuid"):
        return  # systems without owners keep the folders of users apart by themselves
    for status_of in (os.lstat, os.stat):
        try:
            owner = status_of(path).st_uid
        except FileNotFoundError:
            continue
        except OSError as error:
            raise UsageError(f"{path}: {_RULE}, got {error.strerror}. Serve another folder.") from None
        if owner != os.geteuid():
            raise UsageError(
                f"{path}: {_RULE}, got one of user {owner}. Whoever owns it could run code with your rights. "
                "Serve another folder."
            )
