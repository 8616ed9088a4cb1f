"""How a simulated response is compared with a measured one; `docs/replay_scores.md` says it in words."""

from __future__ import annotations

from vibroimpact.analysis.replay.alignment import Alignment, align
from vibroimpact.analysis.replay.baseline import naive_variance
from vibroimpact.analysis.replay.comparison import Comparison, compare
from vibroimpact.analysis.replay.event import Event, find_event
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
    "Comparison",
    "DominantFrequency",
    "Event",
    "EventMatch",
    "PeakErrors",
    "Verdict",
    "align",
    "best_gain",
    "compare",
    "compare_peaks",
    "comparison_dataset",
    "dominant_frequency",
    "find_event",
    "match_events",
    "naive_variance",
    "print_comparison",
    "running_windows",
    "trust",
    "variance_accounted_for",
    "windowed_variance",
]
