"""The child side of `reading`: reads the modes of a file in its own process."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files.csv_table import read as read_csv
from vibroimpact.orchestrator.structures.modes_files.given import GivenModes, checked_modes
from vibroimpact.orchestrator.structures.modes_files.netcdf import FIRST_BYTES
from vibroimpact.orchestrator.structures.modes_files.netcdf import read as read_netcdf
from vibroimpact.orchestrator.structures.modes_files.toml_table import read as read_toml
from vibroimpact.orchestrator.structures.modes_files.universal import SIGNATURE
from vibroimpact.orchestrator.structures.modes_files.universal import read as read_universal
from vibroimpact.orchestrator.structures.readers.child import unpacked_content

Reader = Callable[[bytes], GivenModes]
SUFFIXES: Mapping[str, Reader] = {
    ".toml": read_toml,
    ".csv": read_csv,
    ".tsv": read_csv,
    ".txt": read_csv,
    ".nc": read_netcdf,
    ".uff": read_universal,
    ".unv": read_universal,
}
"""Readers by the end of a file's name, where its first bytes do not tell."""


def read(path: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the modes of a file, for another process; there are no options."""
    content, name = unpacked_content(Path(path))
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return packed(checked_modes(_reader_of(name, content)(content)), digest)


def _reader_of(name: str, content: bytes) -> Reader:
    if SIGNATURE.match(content):
        return read_universal
    if content.startswith(FIRST_BYTES):
        return read_netcdf
    found = SUFFIXES.get(Path(name).suffix)
    if found is None:
        raise UsageError(f"expected a file of modes ({', '.join(SUFFIXES)}), got another kind.")
    return found


def packed(modes: Modes, digest: str) -> tuple[dict[str, Any], list[Any]]:
    """Return modes as facts for JSON, and their arrays."""
    facts: dict[str, Any] = {
        "points": list(modes.shapes),
        "has": [modes.damping is not None, modes.participation is not None],
        "places": [name for name in modes.shapes if name in modes.coordinates],
        "residual_vectors": modes.residual_vectors,
        "error": modes.error,
        "files": dict(modes.files),
        "remarks": list(modes.remarks),
        "sha256": digest,
    }
    shapes = np.array(list(modes.shapes.values()))
    places = np.array([modes.coordinates[name] for name in facts["places"]])
    arrays = [modes.natural, modes.damping_ratios, shapes, modes.damping, modes.participation, places]
    return facts, [np.ascontiguousarray(each, dtype=np.float64) for each in arrays if each is not None]


def unpacked(facts: Mapping[str, Any], buffers: Sequence[bytearray]) -> tuple[Modes, str]:
    """Return the modes that `packed` has taken apart, and the hash of their file; the bytes may have made both.

    ValueError, TypeError, KeyError, IndexError or StopIteration: the facts have another form.
    """
    arrays = iter(np.frombuffer(each, dtype=np.float64) for each in buffers)
    natural, ratios, shapes = next(arrays), next(arrays), next(arrays)
    points, count = [str(name) for name in facts["points"]], len(natural)
    has_damping, has_participation = facts["has"]
    damping = next(arrays).reshape(count, count) if has_damping else None
    participation = next(arrays) if has_participation else None
    rows = shapes.reshape(len(points), count)
    places = [(x, y, z) for x, y, z in next(arrays).reshape(-1, 3).tolist()]
    if len(ratios) != count or (participation is not None and len(participation) != count):
        raise ValueError("arrays of modes differ in size")
    error = None if facts["error"] is None else float(facts["error"])
    files = {str(name): str(digest) for name, digest in facts["files"].items()}
    remarks = tuple(str(each) for each in facts["remarks"])
    found = Modes(
        natural,
        ratios,
        damping,
        dict(zip(points, rows, strict=True)),
        participation,
        int(facts["residual_vectors"]),
        error,
        files,
        remarks,
        dict(zip(map(str, facts["places"]), places, strict=True)),
    )
    return found, str(facts["sha256"])
