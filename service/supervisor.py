"""Runs the queue: one job at a time in a process of its own, which may die, hang, or be cancelled.

Nothing of a job lives here but its process. What it has computed is in its folder, whose parts are complete whatever
ends it; what is known of it is in the store. So a service that is killed and started again goes on where it was.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from vibroimpact.fmus.python_child import ending, python_command
from vibroimpact.service.job_process import INTERRUPTED
from vibroimpact.service.store import Job, State, Store

GRACE = 0.5
"""Seconds that a cancelled job has to end in good order, before it and its workers are killed."""
MOST_ATTEMPTS = 3
"""How often a job whose process was killed by something else is started."""
IDLE = 0.2
"""Seconds between two looks into an empty queue."""
LAST_LINES = 5
"""Of what a process wrote to its standard error, that a failure is told with."""


class Supervisor:
    """Takes jobs from a store and runs them until it is closed.

    Parameters
    ----------
    store : Store
    scheduler : str or None
        Address of a Dask scheduler whose workers compute; None: workers on this machine.
    """

    def __init__(self, store: Store, scheduler: str | None = None) -> None:
        self._store, self._scheduler = store, scheduler
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._running: tuple[str, subprocess.Popen[str]] | None = None
        self._thread = threading.Thread(target=self._work, name="supervisor", daemon=True)

    def start(self) -> None:
        """Take up what a dead service has left, and begin."""
        self._store.requeue_running()
        self._thread.start()

    def close(self) -> None:
        """End the job that runs, which waits for the next start, and stop."""
        self._closing.set()
        self._stop(None)
        self._thread.join()

    def cancel(self, name: str) -> bool:
        """Cancel a job that waits or runs; return whether it did."""
        waiting = self._store.change(
            name, only_from=[State.queued], state=State.cancelled, ended=time.time(), message="cancelled"
        )
        if waiting:
            return True
        running = self._store.change(name, only_from=[State.running], state=State.cancelling)
        if running:
            threading.Thread(target=self._stop, args=(name,), daemon=True).start()
        return running

    # ---- the queue ----

    def _work(self) -> None:
        while not self._closing.is_set():
            job = self._store.next_queued()
            if job is None:
                self._closing.wait(IDLE)
                continue
            try:
                self._run(job)
            except OSError as error:  # of its folder; the queue goes on with the next
                message = f"its folder cannot be used: {error}"
                self._store.change(job.id, state=State.failed, ended=time.time(), message=message)

    def _run(self, job: Job) -> None:
        started = self._store.change(
            job.id,
            only_from=[State.queued],
            state=State.running,
            started=time.time(),
            ended=None,
            attempts=job.attempts + 1,
            message="",
        )
        if not started:
            return  # cancelled in the same instant
        folder = self._store.folder_of(job.id)
        with (folder / "log.txt").open("a", encoding="utf-8") as log:
            log.write(f"--- {time.strftime('%Y-%m-%d %H:%M:%S')} attempt {job.attempts + 1}\n")
            log.flush()
            process = self._open(job, folder)
            with process:  # closes its pipes
                failed, last = self._listen(job, process, log)
                code = process.wait()
        with self._lock:
            self._running = None
        kill_group(process)  # workers that outlived it
        self._note_end(job, code, failed, last)

    def _open(self, job: Job, folder: Path) -> subprocess.Popen[str]:
        arguments = [
            *("-m", "vibroimpact.service.job_process", str(self._store.scene_of(job.id)), str(folder)),
            "" if job.workers is None else str(job.workers),
            *([self._scheduler] if self._scheduler else []),
        ]
        process = subprocess.Popen(
            python_command(*arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        with self._lock:
            self._running = (job.id, process)
        if self._closing.is_set() or self._store.job(job.id).state == State.cancelling:
            self._stop(job.id)
        return process

    def _listen(self, job: Job, process: subprocess.Popen[str], log: Any) -> tuple[str, list[str]]:
        """Follow what a process says until it ends; return why it failed, and the end of its standard error."""
        assert process.stdout is not None
        assert process.stderr is not None
        last: deque[str] = deque(maxlen=LAST_LINES)

        def copy_errors(stream: Any) -> None:
            for line in stream:
                last.append(line.rstrip("\n"))
                log.write(line)
                log.flush()

        errors = threading.Thread(target=copy_errors, args=(process.stderr,), daemon=True)
        errors.start()
        failed = ""
        for line in process.stdout:
            try:
                said = json.loads(line)
            except ValueError:
                said = {"note": line.rstrip("\n")}  # an FMU that prints
            if "total" in said:
                self._store.change(job.id, total=said["total"], done=said["done"])
            if "failed" in said:
                failed = said["failed"]
            text = said.get("note") or said.get("failed")
            if text:
                log.write(f"{text}\n")
                log.flush()
        errors.join(timeout=GRACE)
        return failed, [line for line in last if line.strip()]

    def _note_end(self, job: Job, code: int, failed: str, last: list[str]) -> None:
        now, state = time.time(), self._store.job(job.id).state
        if state == State.cancelling:
            self._store.change(job.id, state=State.cancelled, ended=now, message="cancelled")
        elif code == 0:
            self._store.change(job.id, state=State.done, ended=now, message="")
        elif self._closing.is_set():
            self._store.change(job.id, state=State.queued, message="the service was stopped")
        elif failed:
            self._store.change(job.id, state=State.failed, ended=now, message=failed)
        elif code in (INTERRUPTED, -signal.SIGINT) or (code < 0 and job.attempts + 1 < MOST_ATTEMPTS):
            self._store.change(job.id, state=State.queued, message=f"its process {ending(code)}")
        else:
            why = f"its process {ending(code)}" + (f": {last[-1]}" if last else "")
            self._store.change(job.id, state=State.failed, ended=now, message=why)

    def _stop(self, name: str | None) -> None:
        """End the process that runs, if it is that of the job named: first in good order, then at once."""
        with self._lock:
            if self._running is None or (name is not None and self._running[0] != name):
                return
            _, process = self._running
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
        try:
            process.wait(timeout=GRACE)
        except subprocess.TimeoutExpired:
            kill_group(process)


def kill_group(process: subprocess.Popen[str]) -> None:
    """Kill a process with all that it has started in its session."""
    if sys.platform == "win32":
        process.kill()
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
