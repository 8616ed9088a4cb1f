"""The token of a server, in a file that only its owner reads."""

from __future__ import annotations

import os
import re
import secrets
from pathlib import Path

from vibroimpact.fmus.errors import UsageError

_TOKEN = re.compile(r"[!-~]+")


def token_at(path: Path) -> str:
    """Return the token in a file that only its owner reads; the file is made if it is absent.

    Raise UsageError if others may read the file, or if it holds no token.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        if os.name == "posix" and path.is_file() and path.stat().st_mode & 0o077:
            raise UsageError(
                f"{path}: expected a file that only you can read, got mode {path.stat().st_mode & 0o777:04o}. "
                "Others may know the token: delete the file, and a new one is made."
            ) from None
        return _token_in(path)
    except OSError as error:
        raise UsageError(f"{path}: expected a file for the token, got {error.strerror}.") from None
    token = secrets.token_urlsafe(32)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(f"{token}\n")
    return token


def _token_in(path: Path) -> str:
    try:
        token = path.read_text(encoding="ascii").strip()
    except OSError as error:
        raise UsageError(f"{path}: expected a token, got {error.strerror}. Delete it.") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: expected a token, got no text of ASCII. Delete it.") from None
    if not _TOKEN.fullmatch(token):
        got = "blanks in it" if token else "an empty file"
        raise UsageError(f"{path}: expected a token, got {got}. Delete it.")
    return token
