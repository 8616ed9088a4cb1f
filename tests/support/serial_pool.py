"""Workers of a campaign that are this very process: what is under test is the campaign, not Dask."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import vibroimpact.orchestrator.campaign.campaign as campaign
from vibroimpact.orchestrator.campaign import CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.pool import Finished
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.scene import parse_scene


class SerialPool:
    """Does one piece of work at a time, when it is waited for; stops after so many chunks, as Ctrl-C would."""

    def __init__(self, most_chunks: int | None = None) -> None:
        self._queue: deque[tuple[int, Callable[..., Any], tuple[Any, ...]]] = deque()
        self._tickets = 0
        self._left = most_chunks
        self.lost_workers = 0
        self.is_local = True

    def worker_addresses(self) -> tuple[str, ...]:
        """Return one address."""
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
        """Make the next call."""
        if self._left == 0:
            raise KeyboardInterrupt
        ticket, function, arguments = self._queue.popleft()
        result = function(*arguments)
        self._left = None if self._left is None else self._left - 1
        return Finished(ticket, result)

    def cancel_all(self) -> None:
        """Forget what is queued."""
        self._queue.clear()


class Notes(Progress):
    """Keeps what a campaign says."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def note(self, text: str) -> None:
        """Keep it."""
        self.lines.append(text)


def workers_here(patch: pytest.MonkeyPatch, most_chunks: int | None = None) -> None:
    """Let campaigns have this process as their one worker."""

    @contextmanager
    def here(**_: object) -> Iterator[SerialPool]:
        yield SerialPool(most_chunks)

    patch.setattr(campaign, "open_workers", here)


def campaign_here(
    patch: pytest.MonkeyPatch,
    text: str,
    folder: Path,
    *,
    runner: str = "support.busy_runner:SceneRunner",
    most_chunks: int | None = None,
    notes: Notes | None = None,
) -> CampaignReport:
    """Run a campaign in this process."""
    with patch.context() as patched:
        workers_here(patched, most_chunks)
        return run_campaign(parse_scene(text, "test.toml"), folder, workers=1, runner=runner, progress=notes)
