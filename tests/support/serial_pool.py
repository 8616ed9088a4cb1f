"""Workers of a campaign that are this very process: the tests check the campaign, not Dask."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import vibroimpact.orchestrator.campaign.campaign as campaign
from vibroimpact.orchestrator.campaign import CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.formats import DatasetFormat
from vibroimpact.orchestrator.campaign.workers.pool import Finished
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.scene import parse_scene


class SerialPool:
    """Does one piece of work at a time, when it is waited for; stops after a number of chunks, as by Ctrl-C."""

    def __init__(self, most_chunks: int | None = None) -> None:
        self._queue: deque[tuple[int, Callable[..., Any], tuple[Any, ...]]] = deque()
        self._tickets = 0
        self._left = most_chunks
        self.lost_workers = 0
        self.is_local = True

    def worker_addresses(self) -> tuple[str, ...]:
        """Return a single address."""
        return ("here",)

    def call_everywhere(self, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        """Call a function once."""
        return {"here": function(*arguments)}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> int:
        """Queue a call."""
        self._tickets += 1
        self._queue.append((self._tickets, function, arguments))
        return self._tickets

    def next_finished(self) -> Finished:
        """Do the next call and return its result."""
        if self._left == 0:
            raise KeyboardInterrupt
        ticket, function, arguments = self._queue.popleft()
        result = function(*arguments)
        self._left = None if self._left is None else self._left - 1
        return Finished(ticket, result)

    def cancel_all(self) -> None:
        """Drop all queued calls."""
        self._queue.clear()


class Notes(Progress):
    """Keeps the messages of a campaign."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def note(self, text: str) -> None:
        """Keep a message."""
        self.lines.append(text)


def workers_here(patch: pytest.MonkeyPatch, most_chunks: int | None = None) -> None:
    """Make this process the only worker of campaigns."""

    @contextmanager
    def here(**_: object) -> Iterator[SerialPool]:
        yield SerialPool(most_chunks)

    patch.setattr(campaign, "open_workers", here)


def campaign_here(
    patch: pytest.MonkeyPatch,
    text: str,
    folder: str | Path,
    *,
    runner: str = "support.busy_runner:SceneRunner",
    most_chunks: int | None = None,
    notes: Notes | None = None,
    format: DatasetFormat | None = None,
) -> CampaignReport:
    """Run a campaign in this process."""
    with patch.context() as patched:
        workers_here(patched, most_chunks)
        return run_campaign(
            parse_scene(text, "test.toml"), folder, workers=1, runner=runner, progress=notes, format=format
        )
