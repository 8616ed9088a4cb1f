"""The process that runs one job: `python -m vibroimpact.service.job_process FOLDER WORK`, WORK as `Work` writes it.

It makes the same results as the command line, by the same functions. It reports its progress in lines of JSON on its
standard output. It ends when its standard input does: then the service is gone, and another will restart the job.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError, VibroimpactError, WorkersGoneError
from vibroimpact.fmus.processes.child import end_when_closed, private_pipes
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign
from vibroimpact.orchestrator.run.dataset import tally
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.study.preparation import prepared_scene
from vibroimpact.service.passing import FULL, SHORT

REPORT_INTERVAL, REPORT_SHARE = 0.25, 1.0 / 500.0
"""Least interval between two reports of progress, s, and least share of the points: each report becomes an event."""
INTERRUPTED, LATER = 130, 75
"""Exit codes of a job that was interrupted in good order, and of a job that cannot go on now but may later."""
TRIAL_BYTES = 2**16
"""Bytes that must fit on a disk for it to count as not full."""
CONNECT_SECONDS = 2.0
"""Time limit for a scheduler to accept a connection, s."""


@dataclass(frozen=True, slots=True)
class Work:
    """Task of a job's process."""

    kind: str
    """`campaign`, `run`, `replay` or `estimate`."""
    workers: int | None = None
    """Worker processes; None: one for each processor."""
    scheduler: str | None = None
    """Address of a Dask scheduler to use instead."""
    options: dict[str, Any] = field(default_factory=dict)
    """Options: `fit` and `score` of a replay, or the options of `estimates.estimate`."""

    def written(self) -> str:
        """Return the task as one word of a command line."""
        return json.dumps(asdict(self))


def say(**what: Any) -> None:
    """Send a message to the service: one line of JSON on standard output."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


class ReportedProgress(Progress):
    """Progress that is reported to the service."""

    def __init__(self) -> None:
        super().__init__()
        self._last, self._reported = 0.0, 0

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Report the totals at once."""
        super().begin(total, done, said)
        self._reported = done
        say(total=total, done=done)

    def advance(self, points: int) -> None:
        """Report at intervals, and at the end."""
        super().advance(points)
        news = self._done - self._reported >= REPORT_SHARE * self._total
        if (news and time.monotonic() - self._last >= REPORT_INTERVAL) or self._done == self._total:
            self._last, self._reported = time.monotonic(), self._done
            say(total=self._total, done=self._done)

    def note(self, text: str) -> None:
        """Pass a note on."""
        say(note=text)


def run(folder: Path, work: Work) -> None:
    """Do the work of a job in its folder."""
    progress = ReportedProgress()
    if work.kind == "estimate":
        from vibroimpact.service.requests import estimate

        progress.begin(1, 0)
        estimate(folder, work.options)
        progress.advance(1)
        return
    scene = load_scene(folder / "scene.toml")
    if work.kind == "replay":
        progress.begin(1, 0)
        _replay(scene, folder, **work.options)
        progress.advance(1)
        return
    prepared = prepared_scene(scene, progress.note)
    if work.kind == "run":
        progress.begin(1, 0)
        say(outcomes=tally(run_scene(prepared, folder / "run.nc")))
        progress.advance(1)
        return
    workers = None if work.scheduler else work.workers
    report = run_campaign(
        prepared, folder / "campaign", workers=workers, scheduler=work.scheduler, progress=progress
    )
    say(outcomes=dict(report.outcomes))


def _replay(scene: Scene, folder: Path, fit: str | None = None, score: list[str] | None = None) -> None:
    """Replay the recordings of a scene, and fit numbers of it, into `replay.nc`; write the fitted scene next to it."""
    from vibroimpact.fmus.terminal import Terminal
    from vibroimpact.orchestrator.commands.replay import print_replays
    from vibroimpact.orchestrator.replay.output import fitted_scene_text
    from vibroimpact.orchestrator.replay.replaying import replay_scene

    scored = [folder / name for name in score or ()]
    whole = replay_scene(scene, fit=fit, score=scored)
    print_replays(Terminal(), whole)
    if whole.fit is not None:
        fitted = [replay.name for replay in whole.replays if replay.use == "fitted"]
        text = fitted_scene_text(scene, whole.fit, fitted, folder)
        write_atomically(folder / "fitted.toml", text.encode())
    write_results(whole.dataset, folder / "replay.nc")


def main(arguments: list[str]) -> int:
    """Run the job that the arguments name; return the exit code."""
    folder, work = Path(arguments[0]), Work(**json.loads(arguments[1]))
    orders, answers = private_pipes()
    end_when_closed(orders)
    sys.stdout = os.fdopen(answers, "w", encoding="utf-8")
    try:
        run(folder, work)
    except CampaignInterrupted as interrupted:
        say(note=str(interrupted))
        return INTERRUPTED
    except KeyboardInterrupt:
        return INTERRUPTED
    except (VibroimpactError, OSError) as error:
        if why := _passing(error, folder, work.scheduler):
            say(later=f"{why}: {error}")
            return LATER
        if isinstance(error, OSError):
            raise
        say(failed=str(error).replace(f"{folder}/", ""))  # hide the service's own folder
        return error.exit_code
    return 0


def _passing(error: Exception, folder: Path, scheduler: str | None) -> str:
    """Return in words the temporary cause that stops a job; empty if the job itself is at fault."""
    if _is_full(error, folder):
        return "waits for room on the disk"
    if any(isinstance(one, OSError) and one.errno in SHORT for one in _causes(error)):
        return "waits for free files and memory of the machine"
    if scheduler and (
        isinstance(error, WorkersGoneError) or (isinstance(error, UsageError) and not _answers(scheduler))
    ):
        return f"waits for workers behind {scheduler}"
    return ""


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its causes."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _is_full(error: BaseException, folder: Path) -> bool:
    """Return whether the disk is full, by the error or by a trial, since errors of workers arrive without causes."""
    if any(isinstance(one, OSError) and one.errno in FULL for one in _causes(error)):
        return True
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(TRIAL_BYTES))
    except OSError as found:
        return found.errno in FULL
    return False


def _answers(scheduler: str) -> bool:
    """Return whether something listens at the address of a scheduler."""
    try:
        place = urlsplit(scheduler)
        socket.create_connection((place.hostname or "", place.port or 0), CONNECT_SECONDS).close()
    except (OSError, ValueError):
        return False
    return True


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
