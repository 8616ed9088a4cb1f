"""Import of instruments' files as recordings."""

from __future__ import annotations

from vibroimpact.hardware.recordings.importing import import_recording
from vibroimpact.hardware.recordings.settings import ImportSettings, read_settings

__all__ = [
    "ImportSettings",
    "import_recording",
    "read_settings",
]
