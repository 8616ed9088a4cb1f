"""Modes kept by the content of the files and the keys that they come from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder
from vibroimpact.orchestrator.structures.modes import Modes

VERSION = 2
"""Version of the reduction; results of an older version are made anew."""
MOST_KEPT = 256
"""Largest number of results that are kept; the oldest go first."""
MOST_BYTES = 64 << 20
"""Largest size of a result, bytes; a larger file is none of ours."""


def kept_modes(key: str, make: Callable[[], Modes]) -> Modes:
    """Return the modes of a key: those that were kept, or new ones, which are kept.

    Results lie in the user's cache folder. Without such a folder nothing is kept. A damaged result is made anew.

    Parameters
    ----------
    key : str
        Text of all that the modes depend on: hashes of files, and keys of the scene.
    make : callable
        Makes the modes.
    """
    try:
        folder = private_folder("structures")
    except (OSError, UnsafeFolderError):
        return make()
    path = folder / f"{hashlib.sha256(f'{VERSION} {key}'.encode()).hexdigest()}.json"
    found = _read(path)
    if found is None:
        found = make()
        with suppress(OSError):  # a full disk costs the next run its time, and nothing else
            write_atomically(path, _sealed(found))
            _forget_oldest(folder)
    return found


def _sealed(modes: Modes) -> bytes:
    """Return modes as JSON after the SHA-256 of this JSON."""
    text = json.dumps(asdict(modes), default=lambda array: array.tolist()).encode()
    return hashlib.sha256(text).hexdigest().encode() + b"\n" + text


def _read(path: Path) -> Modes | None:
    """Return the modes of a file; None if it is missing or damaged."""
    try:
        with path.open("rb") as file:
            seal, _, text = file.read(MOST_BYTES).partition(b"\n")
    except OSError:
        return None
    if hashlib.sha256(text).hexdigest().encode() != seal:
        return None
    found: dict[str, Any] = json.loads(text)
    if found.keys() != {each.name for each in fields(Modes)}:
        return None
    arrays: dict[str, Any] = {name: np.array(found[name]) for name in ("natural", "damping_ratios")}
    arrays |= {
        name: None if found[name] is None else np.array(found[name]) for name in ("damping", "participation")
    }
    shapes = {name: np.array(shape) for name, shape in found["shapes"].items()}
    places = {name: tuple(place) for name, place in found["coordinates"].items()}
    tuples = {"remarks": tuple(found["remarks"]), "coordinates": places}
    return Modes(**{**found, **arrays, **tuples, "shapes": shapes})


def _forget_oldest(folder: Path) -> None:
    kept = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)
    for path in kept[:-MOST_KEPT]:
        path.unlink(missing_ok=True)
