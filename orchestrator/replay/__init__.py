"""Recorded channels drive a scene; its motion is compared with measured channels, and fitted to them."""

from __future__ import annotations

from vibroimpact.orchestrator.replay.fit import ReplayFit, fit_replay
from vibroimpact.orchestrator.replay.replayer import Motion, Replayer, opened_replays
from vibroimpact.orchestrator.replay.scoring import Scores, compare_motion, scores_of

__all__ = [
    "Motion",
    "ReplayFit",
    "Replayer",
    "Scores",
    "compare_motion",
    "fit_replay",
    "opened_replays",
    "scores_of",
]
