"""The virtual device: tasks on one time base, and the plant that advances between their samples."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.checks import refuse_outside_clock, verify
from vibroimpact.hardware.virtual_rig.pace import Pace
from vibroimpact.hardware.virtual_rig.plant import TICK, Floats
from vibroimpact.hardware.virtual_rig.profiles import PROFILES
from vibroimpact.hardware.virtual_rig.refusal import STOPPED_BEFORE_DONE, Refusal
from vibroimpact.hardware.virtual_rig.sampling import Sampling
from vibroimpact.hardware.virtual_rig.scene_plant import opened_plant
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.hardware.virtual_rig.tasks import INPUT, NEVER, OUTPUT, State, Task
from vibroimpact.hardware.virtual_rig.terminals import Terminals
from vibroimpact.orchestrator.run.record import ImpactLimitReached

MOST_ON_DEMAND = 1_000
"""Maximum samples per channel of a call without a sample clock, which holds the rig meanwhile."""
MOST_AT_ONCE = 20_000
"""Maximum samples of one advance, so that no call waits for long."""
PERIOD = 0.004
"""Interval between two advances while a clock runs, s."""


class Board:
    """A device with its tasks; every access is made under its lock.

    `pace` gives the time that it should have reached, `analog` its outputs and inputs. Its time was 0 at `served_at`,
    s since 1970.
    """

    def __init__(self, settings: RigSettings) -> None:
        self.settings = settings
        self.name, self.profile = settings.rig.name, PROFILES[settings.rig.device]
        self.plant = opened_plant(settings)
        self.tasks: dict[str, Task] = {}
        self._terminals = Terminals(self.name, self.tasks)
        self.analog = Sampling(settings, self.profile, self.plant)
        lock = threading.RLock()
        self.changed = threading.Condition(lock)
        self._work = threading.Condition(lock)  # wakes the clock; waiting calls do not
        self.served_at = time.time()
        self.pace = Pace(settings.rig.speed)
        self._closed = False
        self._lost: Refusal | None = None
        self._pump = threading.Thread(target=self._go_on, name="rig clock", daemon=True)
        self._pump.start()

    # ---- time ----

    def set_pace(self, *, lockstep: bool | None = None, speed: float | None = None) -> None:
        """Change the pace of the rig."""
        with self.changed:
            self.catch_up()
            self.pace.lockstep = self.pace.lockstep if lockstep is None else lockstep
            self.pace.speed = self.pace.speed if speed is None else speed
            self.pace.go_on_from(self.plant.now)
            self._wake()

    def _wake(self) -> None:
        self.changed.notify_all()
        self._work.notify_all()

    def _due(self) -> int:
        """Return the tick that the rig should have reached."""
        return self.pace.due(self.plant.now, self.tasks.values())

    def catch_up(self) -> None:
        """Advance the plant to the present time of the rig."""
        if self._lost is not None:
            raise self._lost
        due = self._due()
        while self.plant.now < due:
            self.advance(min(due, self.plant.now + self._chunk()))
            self.changed.notify_all()

    def let_go(self, seconds: float) -> None:
        """Let time advance in lockstep, as if a call waited for it."""
        with self.changed:
            self.pace.requested = max(self.pace.requested, self.plant.now + round(seconds / TICK))
            self.catch_up()
            self.pace.requested = self.plant.now

    def _chunk(self) -> int:
        """Return the ticks of one advance."""
        rate = sum(task.rate * len(task.channels) for task in self.tasks.values() if task.ticking)
        steps = rate + self.plant.fineness / 10.0
        return NEVER if rate == 0.0 else max(int(MOST_AT_ONCE / steps / TICK), 1000)

    def _go_on(self) -> None:
        """Keep time while a clock runs."""
        while True:
            with self.changed:
                if self._closed:
                    return
                busy = any(task.ticking for task in self.tasks.values())
                if busy and not self.pace.lockstep:
                    with suppress(Refusal):  # the tasks hold the failure
                        self._one_chunk()
                self._work.wait(PERIOD if busy and not self.pace.lockstep else None)

    def _one_chunk(self) -> None:
        due, chunk = self._due(), self._chunk()
        if due > self.plant.now:
            self.advance(min(due, self.plant.now + chunk))
            self.changed.notify_all()
        self.pace.give_up(self.plant.now, due)

    def wait_for(self, holds: Callable[[], bool], requested: Callable[[], int], timeout: float) -> bool:
        """Wait until a condition holds, for at most `timeout` (s; < 0: no limit); return whether it holds.

        In lockstep, time advances to the `requested` tick, at which the condition is expected to hold. A rig slower
        than real time extends the program's timeout accordingly.
        """
        wall = timeout / min(self.pace.speed, 1.0) if not self.pace.lockstep else timeout
        end = np.inf if timeout < 0 else time.monotonic() + wall
        with self.changed:
            self.catch_up()
            while not holds():
                if self._closed:
                    raise Refusal(DAQmxErrors.DEV_CANNOT_BE_ACCESSED, self.name)
                if self.pace.lockstep:
                    before = self.plant.now
                    self.pace.requested = max(self.pace.requested, requested())
                    self.catch_up()
                    if self.plant.now > before:
                        continue
                left = end - time.monotonic()
                if left <= 0.0:
                    return False
                self.changed.wait(min(left, 0.05))
            return True

    # ---- samples ----

    def advance(self, target: int) -> None:
        """Advance tasks and plant to a tick."""
        running = [task for task in self.tasks.values() if task.ticking]
        try:
            starved = self.analog.advance(running, target)
        except (ComponentError, UsageError, ImpactLimitReached) as error:
            raise self.lose(f"{self.name}, whose plant failed: {error}") from None
        for task in running:
            self._end(task, task.name in starved)

    def _end(self, task: Task, starved: bool) -> None:
        """End a task that has all of its samples, or has lost samples."""
        if task.needed is not None and task.count >= task.needed:
            task.finish()
        elif starved:
            task.finish(Refusal(DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES, task.name))
        elif task.kind == INPUT and task.overrun:
            task.finish(Refusal(DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE, task.name))
        if task.done:
            self._terminals.end_followers(task)

    def lose(self, why: str) -> Refusal:
        """Make the device inaccessible and fail all its tasks; return the error that later calls raise."""
        with self.changed:
            self._lost = Refusal(DAQmxErrors.DEV_CANNOT_BE_ACCESSED, why)
            for task in self.tasks.values():
                if task.state is State.running and not task.done:
                    task.finish(self._lost)
            self._wake()
        return self._lost

    def read_now(self, task: Task, count: int) -> NDArray[np.int16]:
        """Return samples of a task without a clock, converted one after the other; shape (channel, sample)."""
        self._refuse_many(count)
        self.catch_up()
        step = round(1.0 / self.profile.conversion_rate / TICK)
        codes = np.empty((len(task.channels), count), dtype=np.int16)
        for number in range(count):
            if number:
                self.advance(self.plant.now + step)
                self.pace.requested = max(self.pace.requested, self.plant.now)
            codes[:, number] = self.analog.now(task.channels)
        return codes

    def put_now(self, task: Task, samples: Floats) -> None:
        """Apply output values of a task without a clock, shape (channel, sample), one after the other."""
        self._refuse_many(samples.shape[1])
        self.catch_up()
        step = round(1.0 / self.profile.output_rate / TICK)
        for number in range(samples.shape[1]):
            if number:
                self.advance(self.plant.now + step)
                self.pace.requested = max(self.pace.requested, self.plant.now)
            self.analog.held[[channel.number for channel in task.channels]] = samples[:, number]

    @staticmethod
    def _refuse_many(count: int) -> None:
        if count > MOST_ON_DEMAND:
            raise Refusal(
                DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT,
                f"{count} samples without a sample clock; expected at most {MOST_ON_DEMAND}",
            )

    # ---- faults ----

    def overrun(self) -> int:
        """Make running inputs lose samples, as if they were read too late; return the number of inputs."""
        return self._fail(INPUT, DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE)

    def starve(self) -> int:
        """Make running outputs without regeneration run empty; return the number of outputs."""
        return self._fail(OUTPUT, DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES)

    def _fail(self, kind: int, error: DAQmxErrors) -> int:
        with self.changed:
            self.catch_up()
            found = [
                task
                for task in self.tasks.values()
                if task.kind == kind and task.ticking and (kind == INPUT or not task.regenerates)
            ]
            for task in found:
                task.finish(Refusal(error, task.name))
                self._terminals.end_followers(task)
            self._wake()
            return len(found)

    def set_clock_error(self, error: float) -> None:
        """Set the error of the input clock, ppm, from its next edge on."""
        with self.changed:
            self.catch_up()
            self.analog.inputs.clock_error = error
            for task in self.tasks.values():
                if task.ticking and task.kind == INPUT and not self._terminals.has_clock_of_others(task):
                    task.retune(self._true_rate(task))
                    self._terminals.retune_followers(task)

    def mend(self) -> None:
        """Clear all faults; a device that was lost stays lost."""
        with self.changed:
            self.analog.inputs.mend()
            self.set_clock_error(self.analog.inputs.clock_error)

    def _true_rate(self, task: Task) -> float:
        """Return the true rate of a task's clock, Hz."""
        assert task.clock is not None
        error = self.analog.inputs.clock_error if task.kind == INPUT else 0.0
        return task.clock_rate * (1.0 + 1e-6 * error)

    # ---- states of tasks ----

    def reserve(self, task: Task) -> None:
        """Reserve the resources of a task."""
        verify(task)  # channels may have been added after the clock
        mine = self._resources(task)
        for other in self.tasks.values():
            if other is not task and other.state is not State.verified and mine & self._resources(other):
                raise Refusal(DAQmxErrors.PAL_RESOURCE_RESERVED, f"{task.name} by {other.holder}")
        if task.state is State.verified:
            task.state = State.reserved

    @staticmethod
    def _resources(task: Task) -> set[str]:
        if task.kind == INPUT:
            return {"inputs"}
        clock = {"output clock"} if task.clock is not None else set()
        return clock | {f"output {channel.number}" for channel in task.channels}

    def start(self, task: Task) -> None:
        """Start a task."""
        with self.changed:
            task.refuse_running()
            if task.kind == OUTPUT and task.clock is not None and task.position == 0:
                raise Refusal(DAQmxErrors.OUTPUT_BUFFER_EMPTY, task.name)
            self.reserve(task)
            refuse_outside_clock(task)
            self.catch_up()
            task.begin()
            if task.clock is not None:
                self._terminals.arm(task, self.plant.now, self._true_rate(task))
            self._wake()

    def pulse(self, terminal: str) -> int:
        """Put an edge on a terminal; return the number of tasks started."""
        with self.changed:
            self.catch_up()
            started = self._terminals.pulse(terminal, self.plant.now)
            self._wake()
            return started

    def stop(self, task: Task) -> int:
        """Stop a task; an output holds its last value.

        The status returned is a warning where a finite task is not done. A task that has failed before raises its
        Refusal again.
        """
        with self.changed:
            self.catch_up()
            failure = task.failure if task.kind == OUTPUT else None
            early = task.state is State.running and task.needed is not None and not task.done
            self.abort(task)
            if failure is not None:
                raise failure
            return STOPPED_BEFORE_DONE if early else 0

    def abort(self, task: Task) -> None:
        """Stop a task regardless of its failure; an output holds its last value."""
        with self.changed:
            self.catch_up()
            self._terminals.end_followers(task)
            task.stop()
            task.failure = None
            self.changed.notify_all()

    def reset(self) -> None:
        """Release all resources of tasks and forget their failures; outputs go to 0."""
        with self.changed:
            for task in self.tasks.values():
                task.kept = False
                self.abort(task)
            self.analog.held[:] = 0.0

    def remove(self, task: Task) -> None:
        """Delete a task and end its event streams."""
        with self.changed:
            with suppress(Refusal):
                self.abort(task)
            for stream in (task.every, task.ended):
                if stream is not None:
                    stream.heard.put(None)
            self.tasks.pop(task.name, None)

    def close(self) -> None:
        """Stop everything and free the plant."""
        with self.changed:
            self._closed = True
            for task in list(self.tasks.values()):
                self.remove(task)
            self.lose(f"{self.name} is no longer served")
        self._pump.join()
        with self.changed:
            self.plant.close()
