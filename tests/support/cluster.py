"""A Dask scheduler with workers, started as by another command.

The fixture `cluster` lasts for the whole session, for campaigns that neither start nor lose workers.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from harness import warm

from support.places import TESTS

ADDRESS = pytest.StashKey[str]()
DASK = "from dask.cli import run_cli; run_cli()"


def free_port() -> int:
    """Return a free port."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@contextmanager
def started_cluster(address: str = "", *options: str, workers: int = 2) -> Iterator[str]:
    """Start a scheduler and workers, at a free port by default; yield the address."""
    address = address or f"tcp://127.0.0.1:{free_port()}"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), *filter(None, sys.path)])}
    place = ("--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    # the scheduler ends by itself if the tests are killed
    commands = [("scheduler", *place, "--no-dashboard", "--idle-timeout", "1 hour", *options)]
    commands += [("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", *options)] * workers
    processes = [
        warm.start(DASK, *command, env=environment, stdout=warm.DEVNULL, stderr=warm.DEVNULL)
        for command in commands
    ]
    try:
        yield address
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> Iterator[None]:
    """Keep one cluster for all tests that need it; it starts before the tests' workers are forked."""
    with ExitStack() as stack:
        if not session.config.option.collectonly and any(
            "cluster" in _fixtures(item) for item in session.items
        ):
            warm.wait_for_server()
            session.config.stash[ADDRESS] = stack.enter_context(started_cluster())
        return (yield)


def _fixtures(item: pytest.Item) -> list[str]:
    return getattr(item, "fixturenames", [])


@pytest.fixture(scope="session")
def cluster(pytestconfig: pytest.Config) -> str:
    """Return the address of a scheduler with two workers that last for the session."""
    return pytestconfig.stash[ADDRESS]
