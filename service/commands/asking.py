"""Implementations of the client's commands: ask a service, and print its answer."""

from __future__ import annotations

import sys
from pathlib import Path

from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.terminal import say
from vibroimpact.service.client import RemoteJob, Service, ServiceError
from vibroimpact.service.operations.cancel import Cancel
from vibroimpact.service.operations.fetch import Fetch
from vibroimpact.service.operations.status import Status
from vibroimpact.service.operations.submit import Submit


def submit_scene(options: Submit) -> None:
    """Submit a scene after uploading its recordings; the id is the only line on standard output."""
    with Service(options.service, folder=options.data) as service:
        fitted = [service.upload_recording(path) for path in options.recording or ()]
        scored = [service.upload_recording(path) for path in options.score or ()]
        try:
            job = service.submit(
                options.scene, workers=options.workers, recordings=fitted, fit=options.fit, score=scored
            )
        except ServiceError as error:
            if error.problems:
                raise SceneError([_placed(options.scene, one) for one in error.problems]) from None
            raise
        say(job.id)
        if not options.wait:
            return
        for event in job.events():
            say(_line(event | {"id": ""}), err=True)
        if job.status["state"] != "done":
            raise ServiceError(f"{job.id}: {job.status['state']}: {job.status['message']}")


def show_status(options: Status) -> None:
    """Print the state of one campaign, or of all."""
    with Service(options.service, folder=options.data) as service:
        if options.name is not None:
            say(_line(service.job(options.name).status))
            return
        count = 0
        for job in service.jobs():
            say(_line(job.status))
            count += 1
        if not count:
            say("No campaigns.", err=True)


def fetch_dataset(options: Fetch) -> None:
    """Write the dataset of a campaign."""
    with Service(options.service, folder=options.data) as service:
        job: RemoteJob = service.job(options.name)
        say(f"Dataset written to {job.fetch(options.output)}.", err=sys.stdout.isatty())


def cancel_campaign(options: Cancel) -> None:
    """Cancel a campaign."""
    with Service(options.service, folder=options.data) as service:
        say(_line(service.job(options.name).cancel().status))


def _placed(scene: Path, problem: dict[str, object]) -> str:
    line = f"line {problem['line']}: " if "line" in problem else ""
    return f"{scene}: {line}{problem.get('message')}"


def _line(status: dict[str, object]) -> str:
    points = f"{status['done']} of {status['total']} points" if status["total"] else ""
    parts = (status["id"], status["state"], points, status.get("title"), status["message"])
    return "  ".join(str(part) for part in parts if part)
