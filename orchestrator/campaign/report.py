"""What a campaign did, for whoever started it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from vibroimpact.orchestrator.campaign.chunks import Chunk


class CampaignInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a campaign in good order; its text says what is there and how to go on."""


@dataclass(slots=True)
class CampaignReport:
    """What a campaign did.

    Attributes
    ----------
    dataset : Path
    runs : int
        Runs in the dataset.
    resumed : int
        Runs that were there already; equal to `runs` when there was nothing to do.
    outcomes : Counter
        How the runs computed now ended.
    chunks : list of Chunk
        In the order in which they ended.
    workers : int
        0 where all was computed in this process.
    lost_workers : int
        How many died before the last point was done.
    compute_seconds : float
        From the first chunk handed out to the last one done; workers were ready before, s.
    compaction_seconds : float
        Making one dataset of the parts, s.
    is_silent : bool
        No run of the dataset failed or warns of anything, as is known where it was made now.
    """

    dataset: Path
    runs: int
    resumed: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    chunks: list[Chunk] = field(default_factory=list)
    workers: int = 0
    lost_workers: int = 0
    compute_seconds: float = 0.0
    compaction_seconds: float = 0.0
    is_silent: bool = False
