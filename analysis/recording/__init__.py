"""Recordings: channels on axes of their own, quality flags, event trains; their files; their units."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.analysis.recording.arrays import array_of, channel_of
    from vibroimpact.analysis.recording.channels import (
        Channel,
        EventTrain,
        Quality,
        Recording,
        SingleValue,
        TimeAxis,
    )
    from vibroimpact.analysis.recording.files import (
        is_recording,
        open_recording,
        open_signals,
        write_recording,
    )

__all__ = [
    "Channel",
    "EventTrain",
    "Quality",
    "Recording",
    "SingleValue",
    "TimeAxis",
    "array_of",
    "channel_of",
    "is_recording",
    "open_recording",
    "open_signals",
    "write_recording",
]

_MODULES = {
    **dict.fromkeys(("array_of", "channel_of"), "arrays"),
    **dict.fromkeys(("is_recording", "open_recording", "open_signals", "write_recording"), "files"),
}
"""Modules of the names that are not in `channels`."""


def __getattr__(name: str) -> Any:
    # Readers of formats import only units from here, and xarray takes half a second to load.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_MODULES.get(name, 'channels')}")
    return getattr(module, name)
