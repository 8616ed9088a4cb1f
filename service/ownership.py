"""Owner of a service's folder: whoever owns the folder, its token or its database can run code here."""

from __future__ import annotations

import os
from pathlib import Path

from vibroimpact.fmus.errors import UsageError

URL_FILE, TOKEN_FILE = "url", "token"
"""Files with the address of a running service, and with its token."""
_RULE = "expected a path of your own"
_OWN = (".lock", URL_FILE, TOKEN_FILE, "jobs", "recordings", "fmus")


def refuse_foreign_folder(folder: Path, database: str) -> None:
    """Raise UsageError if another user owns a service's folder, which may be absent, or the database in it.

    The service trusts its database.
    """
    if not os.path.lexists(folder):
        return
    refuse_foreign(folder)
    journals = (f"{database}{ending}" for ending in ("", "-wal", "-shm", "-journal"))
    for name in (*_OWN, *journals):
        refuse_foreign(folder / name)


def refuse_foreign(path: Path) -> None:
    """Raise UsageError if another user owns a path, or the target of its link; an absent one passes."""
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
