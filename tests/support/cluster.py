"""A Dask scheduler with workers, as another command would start them."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from harness import warm

from support.places import TESTS

DASK = "from dask.cli import run_cli; run_cli()"


def free_port() -> int:
    """Return a port at which nobody listens."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@contextmanager
def started_cluster(address: str = "", *options: str, workers: int = 2) -> Iterator[str]:
    """Start a scheduler and workers, at a port that is free by default; yield the address."""
    address = address or f"tcp://127.0.0.1:{free_port()}"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), *filter(None, sys.path)])}
    place = ("--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    commands = [("scheduler", *place, "--no-dashboard", *options)]
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
