"""A service in a process of its own, for tests that start, stop and kill it."""

from __future__ import annotations

import os
import re
import signal
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from harness import warm

from support.cluster import free_port, started_cluster
from support.command_line import ENTRY, ENVIRONMENT
from vibroimpact.service.client import RemoteJob, Service

SWEEP = """
[scene]
title = "short sweep"
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.1
[forcing]
amplitude = 0.5
angular_frequency = 1.0
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = {transient}
recorded_periods = 5
[sweep]
"forcing.angular_frequency" = {{ start = 0.8, stop = 1.2, points = {points}, path = "{path}" }}
"""


def sweep_text(points: int, transient: int, path: str = "independent") -> str:
    """Return a scene of `points` points, each after `transient` periods."""
    return SWEEP.format(points=points, transient=transient, path=path)


SHORT = sweep_text(40, 50)


class Served:
    """A service in a process of its own."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        self.log = folder.with_name(f"{folder.name}.log")
        self._start("--port", "0", *options)

    def _start(self, *options: str) -> None:
        with self.log.open("ab") as log:
            self.process = warm.start(
                ENTRY, "serve", "--data", self.folder, *options, stderr=log, env=os.environ | ENVIRONMENT
            )
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        found = re.search(r"http://\S+:\d+", said)
        assert found, said + self.log.read_text()
        self.url = found[0]

    def client(self) -> Service:
        return Service(self.url, folder=self.folder)

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()

    def restart(self) -> None:
        """Start the service again at the same address."""
        self._start("--port", self.url.rpartition(":")[2])

    def stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=20)


class Cluster:
    """A Dask scheduler with one worker, for the duration of a block, each time at the same address."""

    def __init__(self) -> None:
        self.address = f"tcp://127.0.0.1:{free_port()}"
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        self._stack.enter_context(started_cluster(self.address, workers=1))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def scene_file(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def until(job: RemoteJob, *states: str, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while job.refresh().status["state"] not in states:
        assert time.monotonic() < end, job.status
        time.sleep(0.05)
