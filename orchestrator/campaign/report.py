"""The report of a campaign: its numbers of runs, outcomes, workers and times."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk


class CampaignInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a campaign in good order; the text has the completed points and the way to resume."""


@dataclass(slots=True)
class CampaignReport:
    """The results of a campaign.

    Attributes
    ----------
    dataset : Path or ObjectPath
    runs : int
        Number of runs in the dataset.
    resumed : int
        Number of runs that were complete before; equal to `runs` if nothing was left to do.
    outcomes : Counter
        Number of runs of this command, by outcome.
    chunks : list of Chunk
        Computed chunks, in the order in which they ended.
    workers : int
        Number of workers; 0 where all was computed in this process.
    lost_workers : int
        Number of workers that died before the last point was done.
    compute_seconds : float
        Time from the first chunk to the end of the last chunk, without the start of workers, s.
    compaction_seconds : float
        Time to make one dataset of the parts, s.
    is_silent : bool
        Whether no run of the dataset has a message; known only if this command made the dataset.
    """

    dataset: AnyPath
    runs: int
    resumed: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    chunks: list[Chunk] = field(default_factory=list)
    workers: int = 0
    lost_workers: int = 0
    compute_seconds: float = 0.0
    compaction_seconds: float = 0.0
    is_silent: bool = False
