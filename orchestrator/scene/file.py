"""From a path, or from tables in Python, to a TOML document; each problem with it is a `SceneError`."""

from __future__ import annotations

import stat
from collections.abc import Mapping, Sequence
from datetime import date, time
from difflib import get_close_matches
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from vibroimpact.fmus import safe_toml
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.file_names import is_text, refuse_no_text
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted, syntax_problem

LARGEST_FILE = 2**20  # bytes; a scene has some hundred lines, and a larger file is most likely no scene

_ARCHIVE = b"PK\x03\x04"
OTHER_KINDS = (
    (
        _ARCHIVE,
        "an archive",
        "An FMU runs as a component of a scene ([component.NAME]); a system's name ends in .ssp.",
    ),
    (b"\x89HDF", "a NetCDF or HDF5 file", "`vibroimpact describe` says what it holds."),
    (b"CDF", "a NetCDF file", "`vibroimpact describe` says what it holds."),
)
"""First bytes of other kinds of files, with the kind and a hint to the right command."""

_VALUE = "a value that TOML has: a number, True, False, text, a sequence or a mapping"


def read_scene_text(path: Path, source: str) -> str:
    """Return the text of a scene file."""
    content = _read_bytes(path, source)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        got = f"the byte 0x{content[error.start]:02x}"
        raise _file_error(source, "UTF-8 text", got, "Save the file as UTF-8.", f"line {line}") from None


def parse_scene_toml(text: str, source: str) -> dict[str, Any]:
    """Return the TOML document in a text.

    Raises
    ------
    SceneError
        The text is not TOML; the message has the line.
    """
    try:
        return safe_toml.parse_toml(text)
    except ValueError as error:
        raise SceneError([syntax_problem(error, text).line(source)]) from None


def text_of_tables(tables: Mapping[str, Any], source: str) -> str:
    """Return the TOML text of the tables of a scene.

    Parameters
    ----------
    tables : mapping
        Tables with values of TOML; numbers and arrays of NumPy or xarray, tuples and paths are allowed, too.
    source : str
        Name of the scene in messages.

    Raises
    ------
    SceneError
        Some values are not possible in TOML; the message has all of them.

    Examples
    --------
    >>> print(text_of_tables({"body": {"masses": np.ones(2)}, "record": {"impacts": True}}, "scene"), end="")
    [body]
    masses = [
        1.0,
        1.0,
    ]
    <BLANKLINE>
    [record]
    impacts = true
    """
    problems: list[Problem] = []
    refuse_no_mapping(tables, "the tables of a scene", source)
    plain = _plain(tables, (), problems)
    if problems:
        raise SceneError([problem.line(source) for problem in problems])
    return tomli_w.dumps(plain)


def _plain(value: Any, path: tuple[str | int, ...], problems: list[Problem]) -> Any:
    """Return a value in a type of TOML; add a problem for any other value."""
    if hasattr(value, "__array__"):
        value = np.asarray(value).tolist()
    if len(path) > safe_toml.MOST_PARTS:
        problems.append(
            Problem(key_path(path[:4]), f"at most {safe_toml.MOST_PARTS} tables in each other", "more")
        )
        return 0
    if isinstance(value, Mapping):
        keys = [key for key in value if is_text(key)]
        for key in value.keys() - set(keys):
            problems.append(Problem(key_path(path), "keys that are text", ascii(key)))
        return {key: _plain(value[key], (*path, key), problems) for key in keys}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_plain(of, (*path, place), problems) for place, of in enumerate(value)]
    if isinstance(value, PathLike):
        return fspath(value)
    if not isinstance(value, str | bool | int | float | date | time) or (
        isinstance(value, str) and not is_text(value)
    ):
        problems.append(
            Problem(key_path(path), _VALUE, ascii(value) if isinstance(value, str) else quoted(value))
        )
        return 0
    return value


def refuse_no_mapping(given: object, what: str, source: str) -> None:
    """Raise SceneError unless `given` is a mapping."""
    if not isinstance(given, Mapping):
        raise _file_error(source, f"a mapping of {what}", quoted(given), "Write a dictionary.")


def _read_bytes(path: Path, source: str) -> bytes:
    refuse_no_text(path)
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
    for first, kind, hint in OTHER_KINDS:
        if content.startswith(first):
            if first == _ARCHIVE and path.suffix.lower() == ".ssp":
                kind, hint = "a system (SSP)", "`vibroimpact.import_ssp` makes a scene of it."
            raise _file_error(source, "a scene file (TOML)", kind, hint)
    if b"\0" in content[:LARGEST_FILE]:
        raise _file_error(source, "a scene file (TOML)", "a file that is no text", "Name a .toml file.")
    if len(content) > LARGEST_FILE:
        hint = "Write a long list of values as a range, and many shapes into a file of modes."
        raise _file_error(source, "a scene file of at most 1 MiB", "a larger one", hint)
    return content


def _file_hint(path: Path) -> str:
    """Return a hint with the nearest scene file in the same folder."""
    folder = path.parent
    names = sorted(entry.name for entry in folder.glob("*.toml")) if folder.is_dir() else []
    near = get_close_matches(path.name, names, n=1)
    if near:
        return f"Did you mean {folder / near[0]}?"
    return "Check the path." if folder.is_dir() else f"There is no folder {folder}."


def _file_error(source: str, expected: str, got: str, hint: str, key: str = "") -> SceneError:
    return SceneError([Problem(key, expected, got, hint).line(source)])
