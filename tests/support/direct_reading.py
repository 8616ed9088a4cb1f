"""Imports whose files are read in this process: they test the readers, not the reading process around them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

from vibroimpact.analysis.recording import Recording
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.recordings import import_recording, sources


def imported_directly(path: Path, settings: Mapping[str, Any] | None = None) -> Recording:
    """Import a file; a reader that crashes ends this process."""
    with patch.object(sources, "read_file", read_raw):
        return import_recording([path], settings)
