"""The figure of a running sweep, drawn by a process of its own: drawing would delay the output."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

from vibroimpact.analysis import figures, open_dataset
from vibroimpact.analysis.dataset.outputs import writing
from vibroimpact.fmus.processes.process import Process

FILE = "live.png"
SECONDS = 5.0
"""Time between two drawings, s."""
KIND = "bifurcation"
_COMMANDS = "vibroimpact.orchestrator.commands.cli"


class LiveFigure:
    """The figure in the folder of a sweep."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._drawn = time.monotonic()
        self._process: Process | None = None

    def follow(self) -> None:
        """Draw the present contents of the folder, if some seconds have passed since the last drawing."""
        if time.monotonic() - self._drawn >= SECONDS and (
            self._process is None or self._process.poll() is not None
        ):
            self._start()

    def finish(self) -> None:
        """Draw the final contents of the folder, when no output waits any more."""
        self.close()
        with open_dataset(self._folder) as dataset, writing(self._folder / FILE):
            figures.save(figures.draw(dataset, KIND), self._folder / FILE)

    def close(self) -> None:
        """End a drawing under way."""
        if self._process is not None:
            with self._process:
                self._process.kill_session()
            self._process = None

    def _start(self) -> None:
        self.close()
        self._drawn = time.monotonic()
        folder, figure = str(self._folder), str(self._folder / FILE)
        # the last drawing reports errors
        self._process = Process("-m", _COMMANDS, "plot", folder, "-o", figure, "--kind", KIND)
        with suppress(OSError, AttributeError):  # on systems without priorities
            os.setpriority(os.PRIO_PROCESS, self._process.pid, 10)
