"""Recordings: channels on axes of their own, quality flags, event trains; their files; their units."""

from __future__ import annotations

from vibroimpact.analysis.recording.arrays import array_of, channel_of
from vibroimpact.analysis.recording.channels import (
    Channel,
    EventTrain,
    Quality,
    Recording,
    SingleValue,
    TimeAxis,
)
from vibroimpact.analysis.recording.files import is_recording, open_recording, open_signals, write_recording

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
