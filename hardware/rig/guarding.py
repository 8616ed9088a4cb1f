"""The guardian of an output, as the driving program sees it: another process, which outlives this one."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from vibroimpact.fmus.errors import RigError
from vibroimpact.fmus.processes.process import Process
from vibroimpact.fmus.processes.python_child import ending

MODULE = "vibroimpact.hardware.rig.guardian"
READY_SECONDS = 30.0
"""Time in which a guardian must be ready, s; it imports NI's client."""
LEAVE_SECONDS = 5.0

READY, REST, TAKE_OVER = "ready", "rest", "take over"
"""The messages between program and guardian."""


@dataclass(frozen=True, slots=True)
class Order:
    """The output that a guardian guards."""

    terminal: str
    rate: float
    amplitude: float
    slew: float
    """Rate, amplitude and slew of the output and its limits: Hz, V, V/s."""
    session: str
    """Name of the task."""
    address: str
    """`host:port` of the server; empty: the driver of this machine."""
    attach: bool
    """Whether the task of another process can be attached to."""
    program: int
    """Id of the driving process."""
    descriptor: int
    capacity: int
    """Descriptor and capacity of the shared memory."""


class Guardian:
    """A started guardian, else RigError; it guards once `await_ready` has returned."""

    def __init__(self, order: Order) -> None:
        try:
            self._process = Process("-m", MODULE, errors="shared", passed=[order.descriptor])
        except OSError as error:
            raise RigError(f"guardian: cannot be started ({error.strerror}). Nothing was driven.") from None
        self._send(json.dumps(asdict(order)))

    def await_ready(self) -> None:
        """Wait until it guards; RigError if it does not."""
        answer = self._process.line(READY_SECONDS)
        if answer != READY:
            raise RigError(
                f"guardian: expected one that is ready, got {answer or self._end()}. Nothing was driven."
            )

    @property
    def has_ended(self) -> bool:
        """Whether its process has ended."""
        return self._process.poll() is not None

    def take_over(self, seconds: float) -> str:
        """Let it bring the output to rest; return an empty text, or the reason of its failure."""
        self._send(TAKE_OVER)
        answer = self._process.line(seconds)
        return "" if answer == REST else answer or f"the guardian did not answer ({self._end()})"

    def leave(self) -> None:
        """Let it end, since the output is at rest; no process remains."""
        self._send(REST)
        self._process.end(LEAVE_SECONDS)
        self._process.stdout.close()

    def _end(self) -> str:
        code = self._process.poll()
        return "no answer" if code is None else f"a process that {ending(code)}"

    def _send(self, text: str) -> None:
        self._process.say([f"{text}\n".encode()])
