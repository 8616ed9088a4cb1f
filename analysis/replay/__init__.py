"""Comparison of a simulated response with a measured one; `docs/replay_scores.md` explains it in words.

Examples
--------
>>> import numpy as np
>>> from vibroimpact.analysis.recording import Channel, TimeAxis
>>> time = np.arange(2000) * 1e-4
>>> ring = np.where(time > 0.05, np.exp(-30.0 * (time - 0.05)) * np.sin(300.0 * (time - 0.05)), 0.0)
>>> board = Channel("board", 0.3 + ring, "m s-2", TimeAxis(time, 1e-4), np.zeros(2000, np.uint8))
>>> found = compare(time, 0.9 * ring, board, lag=0.0, polarity=1)
>>> round(found.variance, 1), round(found.offset, 6)
(99.0, 0.3)
"""

from __future__ import annotations

from vibroimpact.analysis.replay.alignment import Alignment, align
from vibroimpact.analysis.replay.comparison import Comparison, compare, naive_variance
from vibroimpact.analysis.replay.event import ChannelEvent, find_event
from vibroimpact.analysis.replay.held import Held, held_over
from vibroimpact.analysis.replay.matching import EventMatch, match_events
from vibroimpact.analysis.replay.peaks import PeakErrors, compare_peaks
from vibroimpact.analysis.replay.replay_dataset import comparison_dataset
from vibroimpact.analysis.replay.scoring import (
    best_gain,
    running_windows,
    variance_accounted_for,
    windowed_variance,
)
from vibroimpact.analysis.replay.spectra import DominantFrequency, dominant_frequency
from vibroimpact.analysis.replay.table import print_comparison
from vibroimpact.analysis.replay.trust import Verdict, trust

__all__ = [
    "Alignment",
    "ChannelEvent",
    "Comparison",
    "DominantFrequency",
    "EventMatch",
    "Held",
    "PeakErrors",
    "Verdict",
    "align",
    "best_gain",
    "compare",
    "compare_peaks",
    "comparison_dataset",
    "dominant_frequency",
    "find_event",
    "held_over",
    "match_events",
    "naive_variance",
    "print_comparison",
    "running_windows",
    "trust",
    "variance_accounted_for",
    "windowed_variance",
]
