"""Common base of all answers to NI's calls: the task of a call, and waits that end when the client gives up."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import Task

BY_SCAN = 1
"""Sample layout: interleaved by scan, not by channel."""
_FOR_EVER = -1.0


class Answers:
    """A board and its tasks; `caller.active` says whether the client of the call that a thread answers still waits."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self.caller = threading.local()

    def _task(self, request: Any) -> Task:
        name = request.task.name
        if name not in self._board.tasks:
            raise Refusal(DAQmxErrors.INVALID_TASK, repr(name[:60]))
        return self._board.tasks[name]

    def _wait_for(self, holds: Callable[[], bool], requested: Callable[[], int], timeout: float) -> bool:
        """Wait until a condition holds, as `Board.wait_for`, or until the client has given up."""
        active: Callable[[], bool] = getattr(self.caller, "active", lambda: True)
        found = self._board.wait_for(lambda: holds() or not active(), requested, timeout)
        if not active():
            raise Refusal(DAQmxErrors.TIMEOUT_EXCEEDED, "the program does not wait any more")
        return found

    @staticmethod
    def _timeout(seconds: float) -> float:
        """Return the timeout of a call, s; -1: no timeout."""
        if not (seconds == _FOR_EVER or 0.0 <= seconds <= np.inf):
            raise Refusal(DAQmxErrors.INVALID_TIMEOUT_VAL, f"{seconds:g} s")
        return seconds

    def _tick_of(self, task: Task, number: int) -> int:
        """Return the tick at which all channels have a sample; the present tick before the task starts."""
        if task.start is None:
            return self._board.plant.now
        return int(task.edge(number)) + task.skew * (len(task.channels) - 1)
