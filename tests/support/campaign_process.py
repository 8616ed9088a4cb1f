"""A campaign as a user starts it: a process of its own, in a session of its own, that can be killed."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import psutil
from harness import warm

from support.places import TESTS

BUSY = f"import sys; sys.path.insert(0, {str(TESTS)!r}); from support.busy_command import main; main()"
"""The command line with a point runner from `busy_runner`, which is the first argument."""
WAIT_SECONDS = 180.0
"""Ten times the duration of a campaign of these tests, s: other tests may keep the processors busy."""


def workers_of(command: int) -> list[psutil.Process]:
    """Return the living worker processes of a campaign: forked from one process, or started one by one."""
    forked = [
        worker
        for server in fork_servers_of(command)
        for worker in _children(server.pid, "multiprocessing.forkserver")
    ]
    return forked + _children(command, "multiprocessing.spawn")


def fork_servers_of(command: int) -> list[psutil.Process]:
    """Return the living fork servers of a campaign's workers: one, or none yet."""
    return _children(command, "multiprocessing.forkserver")


def _children(parent: int, kind: str) -> list[psutil.Process]:
    try:
        children = psutil.Process(parent).children()
    except psutil.NoSuchProcess:
        return []
    return [child for child in children if kind in _living_command(child)]


def _living_command(process: psutil.Process) -> str:
    """Return the command line of a process; nothing if the process has ended."""
    try:
        return "" if process.status() == psutil.STATUS_ZOMBIE else " ".join(process.cmdline())
    except psutil.NoSuchProcess:
        return ""


class CampaignProcess:
    """`vibroimpact campaign SCENE -o FOLDER` with a runner from `busy_runner`."""

    def __init__(
        self, scene: Path, folder: Path, *options: str, runner: str = "BusyRunner", **environment: str
    ) -> None:
        self.folder = folder
        words = (runner, "campaign", scene, "-o", folder, *options)
        self.process = warm.start(BUSY, *words, start_new_session=True, env=os.environ | environment)

    def members(self) -> list[psutil.Process]:
        """Return the living processes of the session."""
        found = []
        for process in psutil.process_iter():
            try:
                if os.getsid(process.pid) == self.process.pid and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
            except (ProcessLookupError, psutil.NoSuchProcess):
                continue
        return found

    def workers(self) -> list[psutil.Process]:
        """Return the worker processes."""
        return workers_of(self.process.pid)

    def parts(self) -> list[Path]:
        """Return the complete parts."""
        return sorted((self.folder / "parts").glob("branch-*.nc"))

    def wait_for_parts(self, count: int) -> None:
        """Wait for a number of parts."""
        wait_until(lambda: len(self.parts()) >= count or self.process.poll() is not None)
        assert self.process.poll() is None, self.process.communicate()

    def end(self) -> tuple[int, str, str]:
        """Wait for the end; return exit code, standard output and standard error."""
        out, err = self.process.communicate(timeout=WAIT_SECONDS)
        return self.process.returncode, out, err

    def assert_nothing_lives(self) -> None:
        """Assert that no process of the session outlives the command by more than moments."""
        wait_until(lambda: not self.members(), seconds=5.0)
        assert not self.members()


def wait_until(condition: Callable[[], bool], seconds: float = WAIT_SECONDS) -> None:
    """Wait until a condition holds, or the time is over."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)


def run_campaign_process(
    scene: Path, folder: Path, *options: str, runner: str = "BusyRunner"
) -> tuple[int, str, str]:
    """Run a campaign to its end; return exit code, standard output and standard error."""
    campaign = CampaignProcess(scene, folder, *options, runner=runner)
    ended = campaign.end()
    campaign.assert_nothing_lives()
    return ended
