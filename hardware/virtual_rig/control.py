"""The second service of a virtual rig, for tests and teaching: its time, its terminals, the truth of its plant."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import grpc
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.plant import TICK

SERVICE = "vibroimpact.rig.Control"
FASTEST = 1000.0


def encoded(values: dict[str, Any]) -> bytes:
    """Return values as a message."""
    return json.dumps(values).encode()


def decoded(message: bytes) -> dict[str, Any]:
    """Return the values of a message."""
    values = json.loads(message)
    if not isinstance(values, dict):
        raise ValueError("expected an object")
    return values


class Controls:
    """Answers the calls of the control service on a board."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self.calls: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "State": self.state,
            "Pace": self.pace,
            "Advance": self.advance,
            "Pulse": self.pulse,
            "Truth": self.truth,
            "Lose": self.lose,
        }

    def state(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Return where the time of the rig is, and which tasks there are."""
        board = self._board
        with board.changed:
            tasks = {task.name: task.state.value for task in board.tasks.values()}
            return {
                "time": board.plant.now * TICK,
                "lockstep": board.pace.lockstep,
                "speed": board.pace.speed,
                "slipped": board.pace.slipped,
                "waits_for": board.pace.waits_for,
                "tasks": tasks,
                "rig": board.settings.source,
            }

    def pace(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Change lockstep or speed."""
        lockstep, speed = asked.get("lockstep"), asked.get("speed")
        if lockstep not in (None, True, False):
            raise ValueError(f"lockstep: expected true or false, got {lockstep!r}")
        if speed is not None and not (isinstance(speed, int | float) and 0.0 < speed <= FASTEST):
            raise ValueError(f"speed: expected a number > 0 and <= {FASTEST:g}, got {speed!r}")
        self._board.set_pace(lockstep=lockstep, speed=speed)
        return self.state({})

    def advance(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the time of the rig go on, in lockstep; it stops before a buffer runs empty or over."""
        seconds = asked.get("seconds")
        if not isinstance(seconds, int | float) or not 0.0 < seconds <= 1e6:
            raise ValueError(f"seconds: expected a number > 0 and <= 1e6, got {seconds!r}")
        self._board.let_go(seconds)
        return self.state({})

    def pulse(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Put an edge on a terminal."""
        return {"started": self._board.pulse(str(asked.get("terminal", "")))}

    def lose(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the device be gone, as if its cable were pulled out."""
        self._board.lose(self._board.name)
        return {}

    def truth(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Return the state of the plant now, SI units, and the voltages of the outputs."""
        board = self._board
        with board.changed:
            board.catch_up()
            return {"time": board.plant.now * TICK, **board.plant.state, "outputs": board.held.tolist()}


class RigControl:
    """The client of the control service.

    Parameters
    ----------
    channel : grpc.Channel

    Examples
    --------
    >>> RigControl(channel).pace(lockstep=True)["lockstep"]    # doctest: +SKIP
    True
    """

    def __init__(self, channel: Any) -> None:
        self._channel = channel

    def _call(self, method: str, **values: Any) -> dict[str, Any]:
        call = self._channel.unary_unary(
            f"/{SERVICE}/{method}", request_serializer=encoded, response_deserializer=decoded
        )
        try:
            answer: dict[str, Any] = call(values)
        except grpc.RpcError as error:
            raise UsageError(f"rig: {error.details()}.") from None
        return answer

    def state(self) -> dict[str, Any]:
        """Return the time of the rig (s), its pace and its tasks."""
        return self._call("State")

    def pace(self, *, lockstep: bool | None = None, speed: float | None = None) -> dict[str, Any]:
        """Change how the time of the rig goes; return its state."""
        return self._call("Pace", lockstep=lockstep, speed=speed)

    def advance(self, seconds: float) -> dict[str, Any]:
        """Let time go on in lockstep, by at most so many seconds; return the state."""
        return self._call("Advance", seconds=seconds)

    def pulse(self, terminal: str) -> int:
        """Put an edge on a terminal such as `/Dev1/PFI0`; return how many tasks it has started."""
        return int(self._call("Pulse", terminal=terminal)["started"])

    def lose(self) -> None:
        """Let the device be gone until the rig is served anew."""
        self._call("Lose")

    def truth(self) -> dict[str, Any]:
        """Return displacement (m), velocity (m/s), contact force (N) of the plant and `outputs` (V) now."""
        return self._call("Truth")
