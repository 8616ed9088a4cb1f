"""From a path to the TOML document in it; everything that can be wrong with a file is a `SceneError`."""

from __future__ import annotations

import stat
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from vibroimpact.fmus import safe_toml
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene.problems import Problem, syntax_problem

LARGEST_FILE = 2**20  # bytes; a scene is some hundred lines, and more is most likely another kind of file


def read_text(path: Path, source: str) -> str:
    """Return the text of a scene file.

    Raises
    ------
    SceneError
        When the file is absent, cannot be read, is too large, or is not UTF-8.
    """
    content = _read_bytes(path, source)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        got = f"the byte 0x{content[error.start]:02x}"
        raise _file_error(source, "UTF-8 text", got, "Save the file as UTF-8.", f"line {line}") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the TOML document in a text.

    Raises
    ------
    SceneError
        When the text is not TOML, with the line.
    """
    try:
        return safe_toml.parse_toml(text)
    except ValueError as error:
        raise SceneError([syntax_problem(error, text).line(source)]) from None


def _read_bytes(path: Path, source: str) -> bytes:
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            got = "a folder" if stat.S_ISDIR(status.st_mode) else "something that is not a regular file"
            raise _file_error(source, "a scene file", got, "Name a .toml file.")
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        raise _file_error(source, "a scene file", "no file of this name", _file_hint(path)) from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, "strerror", None) or str(error)
        raise _file_error(
            source, "a readable scene file", f"an error: {reason}", "Check the path and its rights."
        ) from None
    if len(content) > LARGEST_FILE:
        hint = "Write a long list of values as a range, and check that this is a scene."
        raise _file_error(source, "a scene file of at most 1 MiB", "a larger one", hint)
    return content


def _file_hint(path: Path) -> str:
    """Return the nearest scene file in the same folder."""
    folder = path.parent
    names = sorted(entry.name for entry in folder.glob("*.toml")) if folder.is_dir() else []
    near = get_close_matches(path.name, names, n=1)
    if near:
        return f"Did you mean {folder / near[0]}?"
    return "Check the path." if folder.is_dir() else f"There is no folder {folder}."


def _file_error(source: str, expected: str, got: str, hint: str, key: str = "") -> SceneError:
    return SceneError([Problem(key, expected, got, hint).line(source)])
