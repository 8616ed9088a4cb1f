"""The second service of a virtual rig, for tests and teaching: its time, its terminals, the truth of its plant."""

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
    """Return values as a message."""
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


def _number(asked: dict[str, Any], name: str, low: float, high: float) -> float:
    """Return a number of a message that lies between two others, the second included."""
    value = asked.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low < value <= high:
        raise ValueError(f"{name}: expected a number > {low:g} and <= {high:g}, got {repr(value)[:60]}")
    return float(value)


class Controls:
    """Answers the calls of the control service on a board.

    Parameters
    ----------
    board : Board
    vanish : callable
        Ends the server, as if its machine were gone.
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
                "faults": board.analog.inputs.faults(board.name),
            }

    def pace(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Change lockstep or speed."""
        lockstep = asked.get("lockstep")
        if lockstep not in (None, True, False):
            raise ValueError(f"lockstep: expected true or false, got {lockstep!r}")
        speed = None if asked.get("speed") is None else _number(asked, "speed", 0.0, FASTEST)
        self._board.set_pace(lockstep=lockstep, speed=speed)
        return self.state({})

    def advance(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the time of the rig go on, in lockstep; it stops before a buffer runs empty or over."""
        self._board.let_go(_number(asked, "seconds", 0.0, 1e6))
        return self.state({})

    def pulse(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Put an edge on a terminal."""
        return {"started": self._board.pulse(str(asked.get("terminal", "")))}

    def lose(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the device be gone, as if its cable were pulled out."""
        self._board.lose(self._board.name)
        return {}

    # ---- faults ----

    def overrun(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the inputs that run have lost samples: the next read says so."""
        return {"failed": self._board.overrun()}

    def starve(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the outputs that run without regeneration have run empty."""
        return {"failed": self._board.starve()}

    def stick(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let an input keep a voltage: the next that it sees, or a given one."""
        number = self._input(asked)
        volts = None if asked.get("volts") is None else _number(asked, "volts", -1e3, 1e3)
        with self._board.changed:
            self._board.catch_up()
            self._board.analog.inputs.stuck[number] = volts
        return self.state({})

    def clip(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let an input end at a voltage, to both sides of 0."""
        number, volts = self._input(asked), _number(asked, "volts", 0.0, 1e3)
        with self._board.changed:
            self._board.catch_up()
            self._board.analog.inputs.clipped[number] = volts
        return self.state({})

    def clock_error(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Let the input clock go wrong."""
        self._board.set_clock_error(_number(asked, "ppm", -WORST_CLOCK, WORST_CLOCK))
        return self.state({})

    def mend(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Take stuck inputs, clipping and the error of the clock away."""
        self._board.mend()
        return self.state({})

    def vanish(self, asked: dict[str, Any]) -> dict[str, Any]:
        """End the server in the middle of all calls."""
        self._vanish()
        return {}

    def _input(self, asked: dict[str, Any]) -> int:
        terminal, device = str(asked.get("terminal", "")), self._board.name
        names = [f"{device}/ai{number}" for number in range(self._board.profile.inputs)]
        if terminal not in names:
            raise ValueError(f"terminal: expected {names[0]} to {names[-1]}, got {terminal[:60]!r}")
        return names.index(terminal)

    def truth(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Return the state of the plant now, SI units, and the voltages of the outputs."""
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

    def overrun(self) -> int:
        """Let the inputs that run have lost samples (-200279 at the next read); return how many did."""
        return int(self._call("Overrun")["failed"])

    def starve(self) -> int:
        """Let the outputs that run without regeneration have run empty (-200290); return how many did."""
        return int(self._call("Starve")["failed"])

    def stick(self, terminal: str, volts: float | None = None) -> None:
        """Let an input such as `Dev1/ai0` keep a voltage: what it sees next, or a given one."""
        self._call("Stick", terminal=terminal, volts=volts)

    def clip(self, terminal: str, volts: float) -> None:
        """Let an input end at a voltage, to both sides of 0, below its range."""
        self._call("Clip", terminal=terminal, volts=volts)

    def set_clock_error(self, ppm: float) -> None:
        """Let the input clock run too fast by so many ppm of true time, which the output clock keeps."""
        self._call("ClockError", ppm=ppm)

    def mend(self) -> None:
        """Take stuck inputs and clipping away; the clock error is that of the rig file again."""
        self._call("Mend")

    def vanish(self) -> None:
        """Let the server be gone, in the middle of all calls."""
        with suppress(UsageError):  # it may take its answer with it
            self._call("Vanish")

    def truth(self) -> dict[str, Any]:
        """Return the plant now: displacement (m), velocity (m/s), forces (N) of stops, exciter, on a wired load cell.

        `outputs` are in V; of a recording the channels are there, in V or their units.
        """
        return self._call("Truth")
