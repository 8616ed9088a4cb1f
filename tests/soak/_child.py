"""The parent's side of a child process: hands it one case at a time, and replaces it if it dies or hangs."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import IO

import psutil
from harness import warm
from support.places import TESTS

from soak._kinds import Kind

WALL_PER_PROCESSOR_TIME = 5.0
"""Wall time of a case over its processor time, at most: other programs share the machine."""
CASES = "import sys; from soak._case import serve; serve(sys.argv[1])"
START_SECONDS = 60.0
"""Processor time for starting Python and importing the package, added to the limit of a child's first case."""


class Child:
    """A process that tries cases, and its current case.

    Attributes
    ----------
    at : (Kind, int, int) or None
        Kind, number and seed of the case under way.
    """

    def __init__(self, package: str) -> None:
        self.package = package
        self.at: tuple[Kind, int, int] | None = None
        self._start()

    def _start(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="vibroimpact-soak-"))
        # cached facts about random files must not fill the user's own cache
        own = {"TMPDIR": str(self._folder), "VIBROIMPACT_CACHE": str(self._folder / "cache")}
        path = os.pathsep.join(filter(None, [str(TESTS), *(entry for entry in sys.path if entry)]))
        self._process = warm.start(
            CASES,
            self.package,
            cwd=self._folder,
            env=os.environ | own | {"PYTHONPATH": path},
            stdin=subprocess.PIPE,
            stderr=None,
            start_new_session=True,
        )
        self._facts = psutil.Process(self._process.pid)
        self._allowance = START_SECONDS
        self._kind, self._handed = "", 0

    @property
    def answers(self) -> IO[str]:
        """The stream of answers; it is readable too when the process has died."""
        assert self._process.stdout is not None
        return self._process.stdout

    def hand(self, kind: Kind, case: int, seed: int) -> None:
        """Give the process a case; a case of another kind starts a new process."""
        if self._kind not in ("", kind.name):
            self._replace()
        self._kind, self._handed = kind.name, self._handed + 1
        assert self._process.stdin is not None
        self.at = (kind, case, seed)
        self._began, self._used = time.monotonic(), self._processor_time()
        try:
            self._process.stdin.write(json.dumps([kind.name, seed]) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has died since; reading its answer reports the death

    def answer(self) -> tuple[float, str | None]:
        """Read processor time and problem of the case, or report how the process died."""
        line = self.answers.readline()
        if line:
            self._allowance = 0.0
            seconds, problem = json.loads(line)
            return float(seconds), problem
        seconds = time.monotonic() - self._began
        status = self._process.wait()
        said = f"{self._last_words() or 'it said nothing'} (its case {self._handed})"
        self._replace()
        return seconds, f"the process died: {_named(status)}; {said}"

    def overdue(self) -> tuple[float, str] | None:
        """Return time and problem of a case that has used up its time; the process is replaced."""
        if self.at is None:
            return None
        limit = self.at[0].seconds + self._allowance
        wall, used = time.monotonic() - self._began, self._processor_time() - self._used
        if used <= limit and wall <= WALL_PER_PROCESSOR_TIME * limit:
            return None
        where = self._place_of_hang()
        self._replace()
        return used, f"no answer after {used:.0f} s of processor time ({wall:.0f} s of wall time); {where}"

    def close(self) -> None:
        """End the process and its children, and remove its folder."""
        _kill(self._process)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                _close(pipe)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _replace(self) -> None:
        self.close()
        self._start()

    def _processor_time(self) -> float:
        try:
            used = self._facts.cpu_times()
        except psutil.Error:
            return 0.0
        return used.user + used.system + used.children_user + used.children_system

    def _place_of_hang(self) -> str:
        if hasattr(signal, "SIGUSR1"):
            self._process.send_signal(signal.SIGUSR1)
            time.sleep(0.5)
        places = re.findall(r'File "([^"]*)", line (\d+) in (\S+)', self._log())
        if not places:
            return "where is not known"
        return "in " + " < ".join(
            f"{Path(name).name}:{line} ({function})" for name, line, function in places[:4]
        )

    def _last_words(self) -> str:
        fatal = re.search(r"^Fatal Python error: .*$", self._log(), re.MULTILINE)
        lines = self._log().strip().splitlines()
        words = fatal.group() if fatal else "".join(lines[-1:])
        places = re.findall(r'File "([^"]*)", line (\d+) in (\S+)', self._log())[:1]
        return words + "".join(
            f" in {Path(name).name}:{line} ({function})" for name, line, function in places
        )

    def _log(self) -> str:
        try:
            return (self._folder / "log").read_text(encoding="utf-8", errors="replace")[:100_000]
        except OSError:
            return ""


def _named(status: int) -> str:
    return signal.Signals(-status).name if status < 0 else f"exit code {status}"


def _kill(process: warm.Program) -> None:
    if sys.platform == "win32":
        process.kill()
        return
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return  # all of them have ended


def _close(pipe: IO[str]) -> None:
    try:
        pipe.close()
    except BrokenPipeError:
        return  # nobody listens to the remaining output
