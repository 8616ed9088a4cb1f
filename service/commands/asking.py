"""What the commands of the client do: ask a service, and print what it answers."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.terminal import say
from vibroimpact.service.client import RemoteJob, Service, ServiceError


@dataclass(frozen=True, slots=True)
class Replayed:
    """What `submit` is told of a scene that replays: recordings, a fit, recordings that are scored alone."""

    recordings: Sequence[Path] = ()
    fit: str | None = None
    score: Sequence[Path] = ()

    @property
    def files(self) -> tuple[Sequence[Path], Sequence[Path]]:
        """What is uploaded."""
        return self.recordings, self.score


def submit_scene(
    scene: Path,
    url: str | None,
    folder: Path | None,
    workers: int | None,
    wait: bool,
    replay: Replayed | None = None,
) -> None:
    """Submit a scene, with recordings that are uploaded before it; the id is the one line of standard output."""
    asked = replay or Replayed()
    with Service(url, folder=folder) as service:
        fitted, scored = ([service.upload_recording(path) for path in paths] for paths in asked.files)
        try:
            job = service.submit(scene, workers=workers, recordings=fitted, fit=asked.fit, score=scored)
        except ServiceError as error:
            if error.problems:
                raise SceneError([_placed(scene, one) for one in error.problems]) from None
            raise
        say(job.id)
        if not wait:
            return
        for event in job.events():
            say(_line(event | {"id": ""}), err=True)
        if job.status["state"] != "done":
            raise ServiceError(f"{job.id}: {job.status['state']}: {job.status['message']}")


def show_status(name: str | None, url: str | None, folder: Path | None) -> None:
    """Print where one campaign is, or all."""
    with Service(url, folder=folder) as service:
        if name is not None:
            say(_line(service.job(name).status))
            return
        count = 0
        for job in service.jobs():
            say(_line(job.status))
            count += 1
        if not count:
            say("No campaigns.", err=True)


def fetch_dataset(name: str, output: Path, url: str | None, folder: Path | None) -> None:
    """Write the dataset of a campaign."""
    with Service(url, folder=folder) as service:
        job: RemoteJob = service.job(name)
        say(f"Dataset written to {job.fetch(output)}.", err=sys.stdout.isatty())


def cancel_campaign(name: str, url: str | None, folder: Path | None) -> None:
    """Cancel a campaign."""
    with Service(url, folder=folder) as service:
        say(_line(service.job(name).cancel().status))


def _placed(scene: Path, problem: dict[str, object]) -> str:
    line = f"line {problem['line']}: " if "line" in problem else ""
    return f"{scene}: {line}{problem.get('message')}"


def _line(status: dict[str, object]) -> str:
    points = f"{status['done']} of {status['total']} points" if status["total"] else ""
    parts = (status["id"], status["state"], points, status.get("title"), status["message"])
    return "  ".join(str(part) for part in parts if part)
