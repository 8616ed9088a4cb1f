"""The child side of `reading`: reads a file in its own process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.formats.crossing import packed, packed_datasets
from vibroimpact.hardware.formats.uff import read_datasets as datasets_of

measured_unit("g")  # loads the units once: this module is imported before each file's process is forked


def read(path: str, options: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the content of a file, for another process."""
    return packed(read_raw(Path(path), **options))


def read_datasets(path: str, options: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the datasets of a universal file, for another process."""
    return packed_datasets(*datasets_of(path, frozenset(options["wanted"])))
