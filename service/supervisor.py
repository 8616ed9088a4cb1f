"""Supervisor of the queue: it runs one job at a time in a separate process, which may die, hang, or be cancelled.

Only the process of a job lives here. Its results are in its folder, whose parts are complete after any interruption;
its state is in the store. So a killed service continues after its restart.
"""

from __future__ import annotations

import errno
import json
import signal
import sqlite3
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from vibroimpact.fmus.processes.process import Process
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.service.job_process import INTERRUPTED, LATER, Work
from vibroimpact.service.problems import is_full, is_held, is_short, why_later
from vibroimpact.service.store import LOG, LOG_FILE, Job, State, Store

GRACE = 0.5
"""Time for a cancelled job to end in good order, s; then it and its workers are killed."""
MOST_ATTEMPTS = 5
"""Number of starts of a job whose process was killed from outside, if no new point was computed in between."""
IDLE = 0.2
"""Interval between two checks of an empty queue, s."""
PAUSE = 2.0
"""Time before a retry after a full disk or an absent scheduler, s."""
LONGEST_PAUSE = 30.0
"""Largest time between two attempts, s; the pause doubles while all jobs are hindered."""
LAST_LINES = 5
"""Number of last lines of a process's standard error that the report of a failure can use."""


class Supervisor:
    """Takes jobs from a store and runs them until it is closed.

    Workers of a Dask scheduler compute; without a scheduler, workers on this machine.
    """

    def __init__(self, store: Store, scheduler: str | None = None) -> None:
        self._store, self._scheduler = store, scheduler
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._running: tuple[str, Process] | None = None
        self._pause = 0.0
        self._thread = threading.Thread(target=self._work, name="supervisor", daemon=True)

    def start(self) -> None:
        """Requeue the jobs of a dead service, and begin."""
        self._store.remove_strays()
        self._store.requeue_running("the service was restarted")
        self._thread.start()

    def close(self) -> None:
        """End the running job, which waits for the next start, and stop."""
        self._closing.set()
        self._stop(None)
        self._thread.join()

    def cancel(self, name: str) -> bool:
        """Cancel a waiting or running job; return whether it was one."""
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
        was_cut_off = False
        while not self._closing.is_set():
            try:
                if was_cut_off:
                    self._store.requeue_running("the database could not be used")
                was_cut_off = False
                self._take()
            except sqlite3.Error as error:
                was_cut_off = True
                LOG.warning("the database cannot be used", extra={"why": str(error)})
                self._closing.wait(PAUSE)

    def _take(self) -> None:
        """Run the job that has waited longest, or wait for a job."""
        job = self._store.next_queued()
        if job is None:
            self._closing.wait(IDLE)
            return
        try:
            self._run(job)
        except OSError as error:
            if why := why_later(error):
                self._wait_out(f"{why}: {error}", job)
            else:  # the error concerns its folder; the queue goes on with the next job
                self._end(job, State.failed, f"its folder cannot be used: {error}")

    def _wait_out(self, why: str, job: Job) -> None:
        """Wait before the next attempt while all jobs are hindered; the reason is logged once."""
        if not self._pause:
            LOG.warning("jobs wait", extra={"job": job.id, "why": why})
        self._pause = min(max(2.0 * self._pause, PAUSE), LONGEST_PAUSE)
        self._closing.wait(self._pause)

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
        try:
            with JobLog(folder / LOG_FILE, job.id) as log:
                log.write(f"--- {time.strftime('%Y-%m-%d %H:%M:%S')} attempt {job.attempts + 1}")
                process = self._open(job, folder)
                self._pause = 0.0
                with process:  # closes its pipes
                    report = self._listen(job, process, log)
                    code = process.wait()
                    process.kill_session()  # ends workers that outlived it
        except OSError as error:
            if why := why_later(error):
                self._change(job, state=State.queued, message=f"{why}: {error}", attempts=job.attempts)
            with self._lock:
                self._running = None
            raise
        with self._lock:
            self._running = None
        self._note_end(job, code, report)

    def _open(self, job: Job, folder: Path) -> Process:
        work = Work(job.kind, job.workers, self._scheduler, job.options)
        folder, module = folder.absolute(), "vibroimpact.service.job_process"
        process = Process("-m", module, str(folder), work.written(), errors="kept")
        with self._lock:
            self._running = (job.id, process)
        if self._closing.is_set() or self._store.job(job.id).state == State.cancelling:
            self._stop(job.id)
        return process

    def _listen(self, job: Job, process: Process, log: JobLog) -> JobReport:
        """Read the messages of a process until it ends."""
        report = JobReport()

        def copy_errors() -> None:
            for line in process.lines_of_errors():
                report.last.append(line)
                log.write(line)

        errors = threading.Thread(target=copy_errors, daemon=True)
        try:
            errors.start()
        except RuntimeError as error:  # no further thread: the machine is short of memory or processes
            raise OSError(errno.ENOMEM, str(error)) from error
        for line in process.lines():
            content = _message_in(line)
            total, done = content.get("total"), content.get("done")
            if isinstance(total, int) and isinstance(done, int):
                report.total, report.done = total, done
                self._note_progress(job, report)
            report.failed = content.get("failed", report.failed)
            report.later = content.get("later", report.later)
            report.outcomes = content.get("outcomes", report.outcomes)
            text = content.get("note") or content.get("failed") or content.get("later")
            if text:
                log.write(text)
        errors.join(timeout=GRACE)
        return report

    def _note_progress(self, job: Job, report: JobReport) -> None:
        """Store the progress of a job; if the database is unavailable, a later update or the end of the job does."""
        try:
            self._store.change(job.id, total=report.total, done=report.done)
        except sqlite3.Error as error:
            if not _is_temporary(error):
                raise
            LOG.warning("its progress is not noted", extra={"job": job.id, "why": str(error)})

    def _note_end(self, job: Job, code: int, report: JobReport) -> None:
        if self._store.job(job.id).state == State.cancelling:
            self._end(job, State.cancelled, "cancelled", report)
        elif code == 0:
            self._end(job, State.done, "", report)
        elif self._closing.is_set():
            self._change(job, state=State.queued, message="the service was stopped")
        elif code == LATER:
            # the hindrance is not the fault of the job, and does not count as an attempt
            self._change(job, state=State.queued, message=report.later, attempts=job.attempts)
            self._closing.wait(PAUSE)
        elif report.failed:
            self._end(job, State.failed, report.failed, report)
        elif code < 0 and report.done > job.done:
            self._change(job, state=State.queued, message=f"its process {ending(code)}", attempts=0)
        elif code in (INTERRUPTED, -signal.SIGINT) or (code < 0 and job.attempts + 1 < MOST_ATTEMPTS):
            self._change(job, state=State.queued, message=f"its process {ending(code)}")
        else:
            last = [line for line in report.last if line.strip()]
            self._end(
                job, State.failed, f"its process {ending(code)}" + (f": {last[-1]}" if last else ""), report
            )

    def _end(self, job: Job, state: State, message: str, report: JobReport | None = None) -> None:
        known: dict[str, Any] = (
            {} if report is None else {"outcomes": json.dumps(_sum(job.outcomes, report.outcomes))}
        )
        if report is not None and report.total:
            known |= {"total": report.total, "done": report.done}
        self._change(job, state=state, ended=time.time(), message=message, **known)

    def _change(self, job: Job, **values: Any) -> None:
        """Store the new state of a job once the database is available; else the next start of the service does."""
        while True:
            try:
                self._store.change(job.id, **values)
            except sqlite3.Error as error:
                if not _is_temporary(error):
                    raise
                LOG.warning("its end is not noted yet", extra={"job": job.id, "why": str(error)})
                if self._closing.wait(PAUSE):
                    return
            else:
                return

    def _stop(self, name: str | None) -> None:
        """End the running process if it belongs to the named job: first in good order, then by force."""
        with self._lock:
            if self._running is None or (name is not None and self._running[0] != name):
                return
            _, process = self._running
        process.interrupt(GRACE)


@dataclass(slots=True)
class JobReport:
    """Messages of a process about its job: progress, reason of failure or waiting, outcomes of points, last lines."""

    total: int = 0
    done: int = 0
    failed: str = ""
    later: str = ""
    outcomes: dict[str, int] = field(default_factory=dict)
    last: deque[str] = field(default_factory=lambda: deque(maxlen=LAST_LINES))


class JobLog:
    """The log of a job, in whole lines; lines that do not fit on a full disk are lost, and the loss is logged."""

    def __init__(self, path: Path, job: str) -> None:
        self._file = path.open("ab", buffering=0)
        self._job = job

    def __enter__(self) -> Self:
        """Return the log itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def write(self, line: str) -> None:
        """Write a line."""
        try:
            self._file.write(f"{line}\n".encode())
        except OSError as error:
            LOG.warning("a line of its log is lost", extra={"job": self._job, "why": str(error)})


def _is_temporary(error: sqlite3.Error) -> bool:
    """Return whether an error of the database may pass by itself."""
    return is_full(error) or is_held(error) or is_short(error)


def _message_in(line: str) -> dict[str, Any]:
    """Return the message in a line of a process; a line that is no JSON object is a remark, of an FMU that prints."""
    try:
        content = json.loads(line)
    except ValueError:
        content = None
    return content if isinstance(content, dict) else {"note": line}


def _sum(first: Mapping[str, int], second: Mapping[str, int]) -> dict[str, int]:
    return dict(Counter(first) + Counter(second))
