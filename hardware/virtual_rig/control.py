"""The control service of a virtual rig, for tests and teaching: its time, its terminals, the true state of its
plant."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import grpc
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.plant import TICK
from vibroimpact.hardware.virtual_rig.settings import WORST_CLOCK

SERVICE = "vibroimpact.rig.Control"
FASTEST = 1000.0


def encoded(values: dict[str, Any]) -> bytes:
    """Return values encoded as a message."""
    return json.dumps(values).encode()


def decoded(message: bytes) -> dict[str, Any]:
    """Return the values of a message."""
    try:
        values = json.loads(message)
    except RecursionError:
        raise ValueError("expected an object, got one too deep") from None
    if not isinstance(values, dict):
        raise ValueError("expected an object")
    return values


def _number(request: dict[str, Any], name: str, low: float, high: float) -> float:
    """Return a number of a message that is > `low` and <= `high`."""
    value = request.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low < value <= high:
        raise ValueError(f"{name}: expected a number > {low:g} and <= {high:g}, got {repr(value)[:60]}")
    return float(value)


class Controls:
    """Answers the calls of the control service on a board.

    Parameters
    ----------
    board : Board
    vanish : callable
        Ends the server, as if its machine had failed.
    """

    def __init__(self, board: Board, vanish: Callable[[], None]) -> None:
        self._board, self._vanish = board, vanish
        self.calls: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "State": self.state,
            "Pace": self.pace,
            "Advance": self.advance,
            "Pulse": self.pulse,
            "Truth": self.truth,
            "Lose": self.lose,
            "Overrun": self.overrun,
            "Starve": self.starve,
            "Stick": self.stick,
            "Clip": self.clip,
            "ClockError": self.clock_error,
            "Mend": self.mend,
            "Vanish": self.vanish,
        }

    def state(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the time of the rig, its pace and its tasks."""
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
                "faults": board.analog.inputs.faults(board.name),
            }

    def pace(self, request: dict[str, Any]) -> dict[str, Any]:
        """Change lockstep or speed."""
        lockstep = request.get("lockstep")
        if lockstep not in (None, True, False):
            raise ValueError(f"lockstep: expected true or false, got {lockstep!r}")
        speed = None if request.get("speed") is None else _number(request, "speed", 0.0, FASTEST)
        self._board.set_pace(lockstep=lockstep, speed=speed)
        return self.state({})

    def advance(self, request: dict[str, Any]) -> dict[str, Any]:
        """Let the time of the rig advance in lockstep; it stops before a buffer runs empty or overflows."""
        self._board.let_go(_number(request, "seconds", 0.0, 1e6))
        return self.state({})

    def pulse(self, request: dict[str, Any]) -> dict[str, Any]:
        """Put an edge on a terminal."""
        return {"started": self._board.pulse(str(request.get("terminal", "")))}

    def lose(self, request: dict[str, Any]) -> dict[str, Any]:
        """Make the device inaccessible, as if its cable were pulled out."""
        self._board.lose(self._board.name)
        return {}

    # ---- faults ----

    def overrun(self, request: dict[str, Any]) -> dict[str, Any]:
        """Make the running inputs lose samples: the next read raises the error."""
        return {"failed": self._board.overrun()}

    def starve(self, request: dict[str, Any]) -> dict[str, Any]:
        """Make the running outputs without regeneration run empty."""
        return {"failed": self._board.starve()}

    def stick(self, request: dict[str, Any]) -> dict[str, Any]:
        """Make an input keep a voltage: the next sampled value, or a given one."""
        number = self._input(request)
        volts = None if request.get("volts") is None else _number(request, "volts", -1e3, 1e3)
        with self._board.changed:
            self._board.catch_up()
            self._board.analog.inputs.stuck[number] = volts
        return self.state({})

    def clip(self, request: dict[str, Any]) -> dict[str, Any]:
        """Make an input saturate at a voltage of either sign."""
        number, volts = self._input(request), _number(request, "volts", 0.0, 1e3)
        with self._board.changed:
            self._board.catch_up()
            self._board.analog.inputs.clipped[number] = volts
        return self.state({})

    def clock_error(self, request: dict[str, Any]) -> dict[str, Any]:
        """Set the error of the input clock."""
        self._board.set_clock_error(_number(request, "ppm", -WORST_CLOCK, WORST_CLOCK))
        return self.state({})

    def mend(self, request: dict[str, Any]) -> dict[str, Any]:
        """Clear stuck inputs, clipping and the error of the clock."""
        self._board.mend()
        return self.state({})

    def vanish(self, request: dict[str, Any]) -> dict[str, Any]:
        """End the server in the middle of all calls."""
        self._vanish()
        return {}

    def _input(self, request: dict[str, Any]) -> int:
        terminal, device = str(request.get("terminal", "")), self._board.name
        names = [f"{device}/ai{number}" for number in range(self._board.profile.inputs)]
        if terminal not in names:
            raise ValueError(f"terminal: expected {names[0]} to {names[-1]}, got {terminal[:60]!r}")
        return names.index(terminal)

    def truth(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the present state of the plant, SI units, and the voltages of the outputs."""
        board = self._board
        with board.changed:
            board.catch_up()
            return {
                "time": board.plant.now * TICK,
                **board.plant.truth(board.analog.driving),
                "outputs": board.analog.held.tolist(),
            }


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
        """Change the pace of the rig; return its state."""
        return self._call("Pace", lockstep=lockstep, speed=speed)

    def advance(self, seconds: float) -> dict[str, Any]:
        """Let time advance in lockstep by at most the given number of seconds; return the state."""
        return self._call("Advance", seconds=seconds)

    def pulse(self, terminal: str) -> int:
        """Put an edge on a terminal such as `/Dev1/PFI0`; return the number of tasks started."""
        return int(self._call("Pulse", terminal=terminal)["started"])

    def lose(self) -> None:
        """Make the device inaccessible until the rig is served anew."""
        self._call("Lose")

    def overrun(self) -> int:
        """Make the running inputs lose samples (-200279 at the next read); return the number of tasks."""
        return int(self._call("Overrun")["failed"])

    def starve(self) -> int:
        """Make the running outputs without regeneration run empty (-200290); return the number of tasks."""
        return int(self._call("Starve")["failed"])

    def stick(self, terminal: str, volts: float | None = None) -> None:
        """Make an input such as `Dev1/ai0` keep a voltage: the next sampled value, or a given one."""
        self._call("Stick", terminal=terminal, volts=volts)

    def clip(self, terminal: str, volts: float) -> None:
        """Make an input saturate at a voltage of either sign, below its range."""
        self._call("Clip", terminal=terminal, volts=volts)

    def set_clock_error(self, ppm: float) -> None:
        """Set the error of the input clock, ppm of true time, which the output clock keeps; > 0: too fast."""
        self._call("ClockError", ppm=ppm)

    def mend(self) -> None:
        """Clear stuck inputs and clipping; the clock error returns to that of the rig file."""
        self._call("Mend")

    def vanish(self) -> None:
        """End the server in the middle of all calls."""
        with suppress(UsageError):  # the server may end before it answers
            self._call("Vanish")

    def truth(self) -> dict[str, Any]:
        """Return the present plant: displacement (m), velocity (m/s), forces (N) of stops, exciter, a wired load cell.

        `outputs` are in V; a recording gives its channels, in V or in their units.
        """
        return self._call("Truth")
