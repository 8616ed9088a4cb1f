"""The guardian of an output: a process that brings it to rest when the driving program cannot.

It is started before the output and ends with it. A program that shows no life for 2 s is ended. When the program is
dead, the guardian continues the program's own task, from the true next sample: it attaches to the task by its name. If
the driver runs inside the program, no other process can attach. The guardian then waits until the driver has freed the
device, and comes down from the last sample that should have been out.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import time
from collections.abc import Callable
from typing import Any

from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.guarding import READY, REST, TAKE_OVER, Order
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.memory import SharedSamples
from vibroimpact.hardware.rig.stream import STARVED, OutputStream, add_output, bring_to_rest

HANG_SECONDS = 2.0
"""Time without a sign of life, above which a program counts as hanging, s."""
LOOK = 0.05
"""Interval between two checks of the program, s; its end is noticed at once."""
CALL_SECONDS = 5.0
PROBE_SECONDS = 1.0
FREE_SECONDS = 3.0
"""Time in which the driver of a dead program frees the device, s."""
_QUIET = 0.03
"""Time without a new sample, above which the dead program's last write is over, s."""
_IGNORED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


class Watch:
    """Watches the driving program."""

    def __init__(self, order: Order, memory: SharedSamples, answers: Callable[[], bool]) -> None:
        self._order, self._memory, self._answers = order, memory, answers
        self._heard = b""

    def until_needed(self) -> str:
        """Return the reason for which the guardian is needed; empty if the output is at rest."""
        beat, since, looked = -1, 0.0, time.monotonic()
        while True:
            reason = self._program_end(LOOK)
            if reason is not None:
                return reason
            now = time.monotonic()
            late, looked = now - looked > 0.5 * HANG_SECONDS, now
            if (
                self._memory.beat != beat or late or not self._memory.driving
            ):  # `late`: this process itself was late
                beat, since = self._memory.beat, now
            elif now - since > HANG_SECONDS:
                if self._answers():
                    self.end_program()
                    return f"showed no life for {HANG_SECONDS:g} s and was ended"
                since = now

    def _program_end(self, seconds: float) -> str | None:
        """Return the meaning of the program's end or message; None if it continues."""
        if os.getppid() != self._order.program:
            return "has ended"
        if not select.select([0], [], [], seconds)[0]:
            return None
        part = os.read(0, 4096)
        if not part:
            return "has ended"
        self._heard += part
        words = self._heard.decode(errors="replace").split("\n")[:-1]
        return "" if REST in words else TAKE_OVER if TAKE_OVER in words else None

    def end_program(self) -> None:
        """End the program, which may be suspended, and wait for its end."""
        if os.getppid() != self._order.program:
            return
        with contextlib.suppress(ProcessLookupError):  # it may have ended by itself just now
            os.kill(self._order.program, signal.SIGKILL)
        end = time.monotonic() + FREE_SECONDS
        while os.getppid() == self._order.program and time.monotonic() < end:
            time.sleep(0.005)


class Rescue:
    """Brings the output to rest in place of the program."""

    def __init__(self, order: Order, memory: SharedSamples) -> None:
        self._order, self._memory = order, memory
        self._limits = Limits(order.amplitude, order.slew)
        self._channel = None
        if order.address:
            self._channel = daqmx.with_deadline(daqmx.open_channel(order.address), CALL_SECONDS)

    def _options(self, session: str, **how: Any) -> Any:
        if self._channel is None:
            return None
        return daqmx.nidaqmx.GrpcSessionOptions(self._channel, session, **how)

    def answers(self) -> bool:
        """Return whether the server answers; the driver of this machine always does."""
        if self._channel is None:
            return True
        probe = daqmx.with_deadline(self._channel, PROBE_SECONDS)
        try:
            _ = daqmx.System.remote(daqmx.nidaqmx.GrpcSessionOptions(probe, "")).driver_version
        except daqmx.RpcError:
            return False
        except daqmx.DaqError:
            return True
        return True

    @property
    def is_needed(self) -> bool:
        """Whether the output was driven and is not at rest."""
        return bool(self._memory.driving)

    def come_to_rest(self) -> None:
        """Bring a driven output to 0 V; DaqError, RpcError, RigError if that fails."""
        if self._order.attach:
            self._by_attaching()
        elif self._memory.driving:
            self._by_a_task_of_its_own()

    def _by_attaching(self) -> None:
        attach = daqmx.nidaqmx.SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION
        session = self._order.session
        try:
            task = daqmx.nidaqmx.Task(
                session, grpc_options=self._options(session, initialization_behavior=attach)
            )
        except daqmx.DaqError as error:
            if error.error_code == daqmx.DAQmxErrors.INVALID_TASK and not self._memory.driving:
                return  # the program had cleared it
            raise
        try:
            if self._memory.driving:
                self._take_over(task)
        finally:
            task.close()

    def _take_over(self, task: Any) -> None:
        """Continue the program's task from the next sample."""
        order, memory = self._order, self._memory
        written = self._settled(task)
        held = memory.sample(written - 1)
        stream = OutputStream(task, order.rate, self._limits, memory, written, held)
        try:
            if task.is_task_done():
                return  # it was not started, or stopped at rest
            stream.finish(self._limits.fall(held, order.rate))
        except daqmx.DaqError as error:
            if error.error_code != STARVED:
                raise
            held = stream.held()
            stream.stop()
            bring_to_rest(task, order.rate, self._limits, memory, held)

    def _settled(self, task: Any) -> int:
        """Return the number of samples of the task, once the dead program's last write is over."""
        position, since = -1, time.monotonic()
        while True:
            now, before = time.monotonic(), position
            position = int(task.out_stream.curr_write_pos)
            if position != before:
                since = now
            room = int(task.out_stream.space_avail)
            if position >= self._memory.announced or (room > 0 and now - since > _QUIET):
                return position
            if now - since > CALL_SECONDS:
                return position
            time.sleep(0.002)

    def _by_a_task_of_its_own(self) -> None:
        order, memory = self._order, self._memory
        since = (time.monotonic_ns() - memory.generated_at) * 1e-9
        out = min(memory.generated + int(since * order.rate), memory.written)
        held = memory.sample(out - 1)
        end = time.monotonic() + FREE_SECONDS
        while True:
            with daqmx.nidaqmx.Task(grpc_options=self._options("")) as task:
                try:
                    add_output(task, order.terminal, order.rate, self._limits)
                    task.control(daqmx.constants.TaskMode.TASK_RESERVE)
                except daqmx.DaqError as error:
                    if error.error_code != daqmx.DAQmxErrors.PAL_RESOURCE_RESERVED or time.monotonic() > end:
                        raise
                else:
                    bring_to_rest(task, order.rate, self._limits, memory, held)
                    return
            time.sleep(0.02)


def _order() -> Order | None:
    """Return the program's order; None if the program has ended before."""
    text = b""
    while not text.endswith(b"\n"):
        part = os.read(0, 1)
        if not part:
            return None
        text += part
    return Order(**json.loads(text))


def _answer(text: str) -> None:
    try:
        os.write(1, f"{text}\n".encode())
    except OSError:
        return  # the program is gone


def guard() -> int:
    """Guard an output until it is at rest; return the exit code of the process."""
    for number in _IGNORED:
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    order = _order()
    if order is None:
        return 0
    memory = SharedSamples(order.capacity, order.descriptor)
    try:
        rescue = Rescue(order, memory)
        if not rescue.answers():
            raise RigError(f"grpc://{order.address} does not answer")
    except (UsageError, RigError) as error:
        _answer(str(error))
        return 1
    watch = Watch(order, memory, rescue.answers)
    _answer(READY)
    why = watch.until_needed()
    if not why:
        return 0
    if not order.attach:
        watch.end_program()
    return _rescued(order, rescue, why)


def _rescued(order: Order, rescue: Rescue, why: str) -> int:
    """Bring the output to rest and report it to the program or, if that has ended, to its terminal."""
    driven = rescue.is_needed
    try:
        rescue.come_to_rest()
        problem = ""
    except (daqmx.DaqError, daqmx.RpcError, RigError, UsageError) as error:
        problem = " ".join(str(error).split()).rstrip(".")
    _answer(problem or REST)
    if why != TAKE_OVER or not order.attach:
        program = f"The program that drove {order.terminal}"
        if problem:
            say(
                f"{program} {why}, and its guardian could not bring the output to rest: {problem}. Nobody knows what "
                "it puts out: switch the amplifier off.",
                err=True,
            )
        elif driven:
            say(f"{program} {why}: its guardian has brought the output to 0 V.", err=True)
    return 1 if problem else 0


if __name__ == "__main__":
    os._exit(guard())  # immediately: the program waits for it, and nothing needs cleaning up
