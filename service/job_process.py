"""The process that runs one job: `python -m vibroimpact.service.job_process SCENE FOLDER [WORKERS [SCHEDULER]]`.

It says how far it is in lines of JSON on its standard output, and ends when its standard input does: then the service
that started it is gone, and another one will start it again.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign, run_scene
from vibroimpact.orchestrator.campaign.progress import Progress
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.study.preparation import prepared_scene

SAID_EVERY, SAID_PART = 0.25, 1.0 / 500.0
"""Seconds between two lines of progress, at least, and part of all points: each becomes an event that is kept."""
INTERRUPTED = 130
"""Exit code of a job that was interrupted in good order."""


def say(**what: Any) -> None:
    """Tell the service something: one line of JSON."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


class Told(Progress):
    """Tells the service how many points are done."""

    def __init__(self) -> None:
        super().__init__()
        self._last, self._told = 0.0, 0

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Say it at once."""
        super().begin(total, done, said)
        self._told = done
        say(total=total, done=done)

    def advance(self, points: int) -> None:
        """Say it now and then, and at the end."""
        super().advance(points)
        news = self._done - self._told >= SAID_PART * self._total
        if (news and time.monotonic() - self._last >= SAID_EVERY) or self._done == self._total:
            self._last, self._told = time.monotonic(), self._done
            say(total=self._total, done=self._done)

    def note(self, text: str) -> None:
        """Pass it on."""
        say(note=text)


def end_with_service() -> None:
    """End this process and its workers as soon as standard input does."""
    os.read(0, 1)
    os.killpg(os.getpid(), signal.SIGKILL)


def run(scene: Scene, folder: Path, workers: int | None, scheduler: str | None) -> None:
    """Run a job into its folder."""
    progress = Told()
    prepared = prepared_scene(scene, progress.note)
    if scene.sweep:
        run_campaign(prepared, folder / "campaign", workers=workers, scheduler=scheduler, progress=progress)
        return
    progress.begin(1, 0)
    run_scene(prepared, folder / "run.nc")
    progress.advance(1)


def main(arguments: list[str]) -> int:
    """Run the job that the arguments name; return the exit code."""
    scene, folder, *others = arguments
    workers = int(others[0]) if others and others[0] else None
    scheduler = others[1] if len(others) > 1 else None
    threading.Thread(target=end_with_service, daemon=True).start()
    try:
        run(load_scene(Path(scene)), Path(folder), workers, scheduler)
    except CampaignInterrupted as interrupted:
        say(note=str(interrupted))
        return INTERRUPTED
    except KeyboardInterrupt:
        return INTERRUPTED
    except VibroimpactError as error:
        say(failed=str(error))
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
