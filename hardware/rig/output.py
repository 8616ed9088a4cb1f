"""Drive an analog output: one thread owns its task, and it always comes to rest.

The buffer of the device holds 0.3 s: so long after `stop` the voltage begins to fade, from the true next sample. It
regenerates no sample: if a program stops writing, a constant voltage remains at worst. A guardian (`guardian.py`)
takes over when this process no longer can.
"""

from __future__ import annotations

import os
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any

from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.course import FADE, Course
from vibroimpact.hardware.rig.guarding import Guardian, Order
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.memory import SharedSamples
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.rig.stream import STARVED, OutputStream, add_output, bring_to_rest, buffer_length
from vibroimpact.hardware.rig.waveforms import Waveform

SHUTDOWN = 10.0
"""Time from a stop to rest, s, besides fade and fall; later the guardian takes over."""
CALL_SECONDS = 10.0
"""Time of a call, s, after which the server counts as dead."""
NOBODY_KNOWS = "Nobody knows what it puts out: switch the amplifier off"
LEAST_RATE = 100.0
"""Lowest rate, Hz; below it a buffer, which has at least 16 samples, holds more than 0.3 s."""
_RATE_ROUNDING = 1e-9


def start_trigger(terminal: str) -> str:
    """Return the terminal of the start of an output.

    Raises
    ------
    UsageError
        The terminal is no output.

    Examples
    --------
    >>> start_trigger("Dev1/ao0")
    '/Dev1/ao/StartTrigger'
    """
    device, _, channel = terminal.strip("/").partition("/")
    if not device or not channel or any(mark in channel for mark in ",:"):
        raise UsageError(f"--output: expected an output such as Dev1/ao0, got {terminal[:60]!r}.")
    return f"/{device}/ao/StartTrigger"


class Output:
    """A driving output; a context manager, whose end stops it.

    Parameters
    ----------
    rig : Rig
    terminal : str
        Terminal, such as `Dev1/ao0`.
    rate : float
        Samples per second; the clock of the device must reach it exactly.
    waveform : Waveform
    limits : Limits
    guarded : bool
        A guardian is ready before the output starts.
    attach : bool or None
        Whether the guardian can attach to the task; None: only with a server.
    arm : callable, optional
        Called when all is ready, just before the output starts: it arms the inputs on `trigger`.

    Attributes
    ----------
    trigger : str
        Terminal of its start: inputs armed on it sample at the same instants, number by number. An input wired to the
        output reads at each instant the voltage of the previous number, which is just being replaced.
    generated : int
        Samples that are out.

    Raises
    ------
    UsageError
        The terminal is no output, or the rate is too low to come to rest soon.

    Examples
    --------
    >>> with opened_rig("local") as rig, Output(rig, "Dev1/ao0", 10_000.0, sine, Limits()) as output:  # doctest: +SKIP
    ...     output.start()
    ...     time.sleep(2.0)
    """

    def __init__(
        self,
        rig: Rig,
        terminal: str,
        rate: float,
        waveform: Waveform,
        limits: Limits,
        *,
        guarded: bool = True,
        attach: bool | None = None,
        arm: Callable[[], None] | None = None,
    ) -> None:
        self.trigger = start_trigger(terminal)
        if guarded and rig.channel is not None and not rig.address:
            raise UsageError("output: expected a rig with an address, which its guardian needs, got none.")
        if not rate >= LEAST_RATE:
            raise UsageError(
                f"--rate: expected at least {LEAST_RATE:g} Hz, so that the output comes to rest soon, got {rate!r}."
            )
        self._rig, self._terminal, self._rate = rig, terminal.strip("/"), rate
        self._waveform, self._limits, self._guarded = waveform, limits, guarded
        self._attach = rig.channel is not None if attach is None else attach
        self._arm = arm
        self.generated = 0
        self._stopping = self._started = False
        self._stopped_at: float | None = None
        self._ready, self._over = threading.Event(), threading.Event()
        self._failure: BaseException | None = None
        self._guardian: Guardian | None = None
        self._stream: OutputStream | None = None
        # it outlives the main thread, and ensures that the output comes to rest
        self._thread = threading.Thread(target=self._run, name="rig output", daemon=False)

    def __enter__(self) -> Output:
        """Return itself; `start` drives."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Bring it to rest; a failure of this is raised even after another error."""
        self.stop()
        if self._thread.ident is not None and not self._over.is_set():
            self.wait()
        else:
            self._raise_failure()

    def start(self) -> None:
        """Fill the buffer, wait for the guardian, and start; inputs on `trigger` are armed before.

        Raises
        ------
        UsageError, RigError, DaqError, RpcError
            Nothing was driven.
        """
        self._thread.start()
        self._ready.wait()
        if not self._started:
            self._thread.join()
            self._raise_failure()

    def stop(self) -> None:
        """Set the stop flag: the output fades, falls to 0 and ends. A signal handler may call it."""
        self._stopping = True

    def poll(self, seconds: float) -> bool:
        """Wait up to `seconds` for its end; return whether it is over.

        Raises
        ------
        RigError
            It was stopped and did not come to rest in time; the message has the guardian's result.
        """
        if self._over.wait(seconds):
            return True
        if self._stopping:
            now = time.monotonic()
            self._stopped_at = now if self._stopped_at is None else self._stopped_at
            if now - self._stopped_at > self._longest_shutdown:
                self._hand_over(f"did not come to rest within {self._longest_shutdown:g} s")
        return False

    def wait(self, deadline: float | None = None) -> None:
        """Wait until it is over and at 0 V.

        Parameters
        ----------
        deadline : float or None
            s, after which the guardian takes over. None: none until a stop; then 10 s, the fade and the fall.

        Raises
        ------
        UsageError, RigError, DaqError
            The failure, after the output is at rest, or the reason why it is not.
        """
        end = None if deadline is None else time.monotonic() + deadline
        while not self.poll(0.1 if end is None else min(max(end - time.monotonic(), 0.0), 0.1)):
            if end is not None and time.monotonic() >= end:
                self._hand_over(f"was not over within {deadline:g} s")
        self._thread.join()
        self._raise_failure()

    @property
    def has_driven(self) -> bool:
        """Whether it was started; an output stopped earlier drives nothing."""
        return self._started

    @property
    def _longest_shutdown(self) -> float:
        fall = self._limits.fall(self._limits.amplitude, self._rate).samples / self._rate
        return SHUTDOWN + FADE + fall

    def _raise_failure(self) -> None:
        """Raise the failure, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _hand_over(self, why: str) -> None:
        """Leave the output to the guardian, and report its result."""
        if self._stream is not None:
            self._stream.abandon()
        raise RigError(f"{self._terminal} {why}{self._taken_over()}.")

    def _taken_over(self) -> str:
        if self._guardian is None:
            return f". {NOBODY_KNOWS}"
        problem = self._guardian.take_over(self._longest_shutdown)
        return f"; {problem}. {NOBODY_KNOWS}" if problem else "; its guardian has brought it to 0 V"

    # ---- in the thread that owns the task ----

    def _run(self) -> None:
        try:
            self._drive()
        except BaseException as error:  # raised again by start and wait
            self._failure = error
        finally:
            if self._guardian is not None:
                self._guardian.leave()
            self._over.set()
            self._ready.set()

    def _drive(self) -> None:
        length = buffer_length(self._rate)
        try:
            memory = SharedSamples(4 * length)
        except OSError as error:
            raise RigError(
                f"output: expected memory to share with the guardian, got none ({error.strerror})."
            ) from None
        session = f"vibroimpact-output-{uuid.uuid4().hex[:12]}"
        try:
            task = daqmx.nidaqmx.Task(session, grpc_options=self._options(session))
            try:
                if self._guarded:
                    self._guardian = Guardian(self._order(session, memory, 4 * length))
                add_output(task, self._terminal, self._rate, self._limits)
                self._refuse_other_rate(task.timing.samp_clk_rate)
                self._drive_task(OutputStream(task, self._rate, self._limits, memory), memory, length)
            except BaseException:
                with suppress(
                    daqmx.DaqError, daqmx.RpcError, ValueError
                ):  # the first error is the relevant one
                    task.close()
                raise
            task.close()
        finally:
            memory.close()

    def _options(self, session: str) -> Any:
        if self._rig.channel is None:
            return None
        return daqmx.nidaqmx.GrpcSessionOptions(daqmx.with_deadline(self._rig.channel, CALL_SECONDS), session)

    def _order(self, session: str, memory: SharedSamples, capacity: int) -> Order:
        return Order(
            terminal=self._terminal,
            rate=self._rate,
            amplitude=self._limits.amplitude,
            slew=self._limits.slew,
            session=session,
            address=self._rig.address,
            attach=self._attach,
            program=os.getpid(),
            descriptor=memory.descriptor,
            capacity=capacity,
        )

    def _refuse_other_rate(self, rate: float) -> None:
        if abs(rate - self._rate) > _RATE_ROUNDING * self._rate:
            raise UsageError(
                f"--rate: expected a rate that the clock of {self._terminal} has, got {self._rate!r}. Use {rate!r}."
            )

    def _drive_task(self, stream: OutputStream, memory: SharedSamples, length: int) -> None:
        course = Course(self._waveform, self._limits, self._rate)
        first = course.block(length)
        if course.failure is not None:
            raise course.failure
        stream.send(first)
        if self._guardian is not None:
            self._guardian.await_ready()
        if self._stopping:
            return
        if self._arm is not None:
            self._arm()
        self._stream = stream
        try:
            stream.start()
            self._started = True
            self._ready.set()
            self._follow(course, stream)
        except daqmx.DaqError as error:
            if not self._started:
                raise
            if error.error_code != STARVED:
                raise self._lost(error) from None
            self._recover(stream, memory)
        except Exception as error:  # the guardian tries the steps that this thread no longer can
            raise self._lost(error) from None
        memory.driving = 0
        if self._is_unguarded:
            raise RigError(f"guardian: its process has gone, so {self._terminal} was brought to 0 V.")
        if course.failure is not None:
            raise course.failure

    @property
    def _is_unguarded(self) -> bool:
        return self._guardian is not None and self._guardian.has_ended

    def _follow(self, course: Course, stream: OutputStream) -> None:
        """Send the samples of the course until it is at rest."""
        main = threading.main_thread()
        while course.rest is None or stream.generated < course.rest:
            if self._stopping or self._is_unguarded or not main.is_alive():
                course.stop()
            stream.send(course.block(stream.piece))
            self.generated = stream.generated
        stream.stop()

    def _recover(self, stream: OutputStream, memory: SharedSamples) -> None:
        """Bring a starved output, which holds its last sample, to rest."""
        held, number = stream.held(), stream.written
        stream.stop()
        try:
            bring_to_rest(stream.task, self._rate, self._limits, memory, held)
        except (daqmx.DaqError, daqmx.RpcError, RigError) as error:
            raise self._lost(error) from None
        raise RigError(
            f"{self._terminal} ran out of samples at number {number}, since this program was too slow, and held "
            f"{held:.4g} V; it was brought to 0 V."
        )

    def _lost(self, error: Exception) -> RigError:
        text = " ".join(str(error).split()).rstrip(".")
        return RigError(f"{self._terminal}: {text}{self._taken_over()}.")
