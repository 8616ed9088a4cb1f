"""The virtual device: tasks on one time base, the plant between their samples."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.pace import Pace
from vibroimpact.hardware.virtual_rig.plant import TICK, Floats, Plant, Ticks
from vibroimpact.hardware.virtual_rig.profiles import PROFILES
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.hardware.virtual_rig.tasks import INPUT, NEVER, OUTPUT, State, Task
from vibroimpact.orchestrator.run.record import ImpactLimitReached

FIRST_EDGE = 10_000
"""Ticks from the start of a task to the first edge of its clock."""
MOST_AT_ONCE = 20_000
"""Samples of one advance, so that a call never waits for long."""
PERIOD = 0.002
"""Between two advances while a clock runs, s."""


class Board:
    """A device with its tasks; all that touches it is done under its lock.

    Parameters
    ----------
    settings : RigSettings

    Attributes
    ----------
    pace : Pace
        Where its time should be.
    """

    def __init__(self, settings: RigSettings) -> None:
        self.settings = settings
        self.name, self.profile = settings.rig.name, PROFILES[settings.rig.device]
        self.plant = Plant(settings)
        self.tasks: dict[str, Task] = {}
        self.held = np.zeros(self.profile.outputs)
        lock = threading.RLock()
        self.changed = threading.Condition(lock)
        self._work = threading.Condition(lock)  # wakes the clock, which calls that wait do not
        self.pace = Pace(settings.rig.speed)
        self._closed = False
        self._lost: Refusal | None = None
        self._pump = threading.Thread(target=self._go_on, name="rig clock", daemon=True)
        self._pump.start()

    # ---- time ----

    def set_pace(self, *, lockstep: bool | None = None, speed: float | None = None) -> None:
        """Change how the time of the rig goes."""
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
        """Return the tick where the time of the rig should be."""
        return self.pace.due(self.plant.now, self.tasks.values())

    def catch_up(self) -> None:
        """Let the plant go on to where the time of the rig is."""
        if self._lost is not None:
            raise self._lost
        due = self._due()
        while self.plant.now < due:
            self.advance(min(due, self.plant.now + self._chunk()))
            self.changed.notify_all()

    def let_go(self, seconds: float) -> None:
        """Let time go on in lockstep, as if a call waited for it."""
        with self.changed:
            self.pace.wanted = max(self.pace.wanted, self.plant.now + round(seconds / TICK))
            self.catch_up()
            self.pace.wanted = self.plant.now

    def _chunk(self) -> int:
        """Return ticks of one advance."""
        rate = sum(task.rate * len(task.channels) for task in self.tasks.values() if task.ticking)
        return NEVER if rate == 0.0 else max(int(MOST_AT_ONCE / rate / TICK), 1000)

    def _go_on(self) -> None:
        """Keep time while a clock runs."""
        while True:
            with self.changed:
                if self._closed:
                    return
                busy = any(task.ticking for task in self.tasks.values())
                if busy and not self.pace.lockstep:
                    with suppress(Refusal):  # the tasks have it
                        self._one_chunk()
                self._work.wait(PERIOD if busy and not self.pace.lockstep else None)

    def _one_chunk(self) -> None:
        due, chunk = self._due(), self._chunk()
        if due > self.plant.now:
            self.advance(min(due, self.plant.now + chunk))
            self.changed.notify_all()
        self.pace.give_up(self.plant.now, due)

    def wait_for(self, holds: Callable[[], bool], wanted: Callable[[], int], timeout: float) -> bool:
        """Wait until something holds, at most so long (s; < 0: for ever); return whether it does.

        Parameters
        ----------
        holds : callable
        wanted : callable
            The tick at which it is expected to hold: where time goes to in lockstep.
        timeout : float
            Of the program; a rig slower than life gives it more.
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
                    self.pace.wanted = max(self.pace.wanted, wanted())
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
        """Let tasks and plant go on to a tick."""
        running = [task for task in self.tasks.values() if task.ticking]
        updates = {task.name: task.generated(target) for task in running if task.kind == OUTPUT}
        edges = {task.name: self._edges(task, target) for task in running if task.kind == INPUT}
        parts = [*(ticks for ticks, _, _ in updates.values()), *(ticks.ravel() for ticks in edges.values())]
        instants = np.unique(np.concatenate([*parts, [target]]))
        instants = instants[instants > self.plant.now].astype(np.int64)
        driven = self._driven(updates)
        befores = np.concatenate([[self.plant.now], instants[:-1]])
        try:
            seen = self.plant.advance(instants, driven(befores))
        except (ComponentError, UsageError, ImpactLimitReached) as error:
            raise self.lose(f"{self.name}, whose plant failed: {error}") from None
        for task in running:
            if task.kind == INPUT:
                ticks = edges[task.name]
                if ticks.size:
                    task.keep(self._codes(task, ticks, instants, seen, driven))
                self._told(task, task.count + ticks.shape[1])
        for task in running:
            if task.kind == OUTPUT:
                self._put_out(task, *updates[task.name])

    def lose(self, why: str) -> Refusal:
        """Let the device be gone, and with it all of its tasks; return what is said of it."""
        with self.changed:
            self._lost = Refusal(DAQmxErrors.DEV_CANNOT_BE_ACCESSED, why)
            for task in self.tasks.values():
                if task.state is State.running and not task.done:
                    task.finish(self._lost)
            self._wake()
        return self._lost

    @staticmethod
    def _edges(task: Task, target: int) -> Ticks:
        """Return the ticks of the samples up to a tick, shape (channel, sample)."""
        numbers = np.arange(task.count, task.edges_until(target))
        late = task.skew * np.arange(len(task.channels))[:, np.newaxis]
        found: Ticks = task.edge(numbers)[np.newaxis, :] + late
        return found

    def _driven(self, updates: dict[str, tuple[Ticks, Floats, bool]]) -> Callable[[Ticks], Floats]:
        """Return the voltage that drives the force, by tick."""
        number = self.settings.exciter.output
        ticks, values = np.empty(0, dtype=np.int64), np.empty(0)
        for name, (at, samples, _) in updates.items():
            for place, channel in enumerate(self.tasks[name].channels):
                if channel.number == number:
                    ticks, values = at, samples[place]
        levels = np.concatenate([[self.held[number]], values])
        return lambda asked: levels[np.searchsorted(ticks, asked, side="right")]

    def _codes(
        self,
        task: Task,
        ticks: Ticks,
        instants: Ticks,
        seen: dict[str, Floats],
        driven: Callable[[Ticks], Floats],
    ) -> NDArray[np.int16]:
        volts = np.zeros(ticks.shape)
        sensors = {sensor.input: sensor for sensor in self.settings.sensors}
        for place, channel in enumerate(task.channels):
            sensor = sensors.get(channel.number)
            if sensor is None:
                continue
            if sensor.quantity == "output":
                values = driven(ticks[place] - 1)
            else:
                values = seen[sensor.quantity][np.searchsorted(instants, ticks[place])]
            volts[place] = sensor.gain * values
        return self._converted(task, volts)

    @staticmethod
    def _converted(task: Task, volts: Floats) -> NDArray[np.int16]:
        highest = 2 ** (task.profile.bits - 1)
        return np.clip(np.rint(volts / task.steps), -highest, highest - 1).astype(np.int16)

    def _told(self, task: Task, count: int) -> None:
        task.tell(count)
        if task.needed is not None and task.count >= task.needed:
            task.finish()
        elif task.overrun:
            task.finish(Refusal(DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE, task.name))

    def _put_out(self, task: Task, ticks: Ticks, samples: Floats, starved: bool) -> None:
        if ticks.size:
            for place, channel in enumerate(task.channels):
                self.held[channel.number] = samples[place, -1]
        task.tell(task.count + ticks.size)
        if task.needed is not None and task.count >= task.needed:
            task.finish()
        elif starved:
            task.finish(Refusal(DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES, task.name))
        if task.done:
            self._end_followers(task)

    def _end_followers(self, task: Task) -> None:
        """End inputs whose clock was that of an output that has ended."""
        for other in self._followers(task, "SampleClock"):
            other.start = None

    def read_now(self, task: Task, count: int) -> NDArray[np.int16]:
        """Return samples of a task without a clock, one conversion after the other; shape (channel, sample)."""
        self.catch_up()
        step = round(1.0 / self.profile.conversion_rate / TICK)
        codes = np.empty((len(task.channels), count), dtype=np.int16)
        for number in range(count):
            if number:
                self.advance(self.plant.now + step)
                self.pace.wanted = max(self.pace.wanted, self.plant.now)
            now = np.full((len(task.channels), 1), self.plant.now, dtype=np.int64)
            seen = {name: np.array([value]) for name, value in self.plant.state.items()}
            level = self._driven({})
            codes[:, number] = self._codes(task, now, now[0], seen, level)[:, 0]
        return codes

    def put_now(self, task: Task, values: Floats) -> None:
        """Let outputs of a task without a clock have values from now on."""
        self.catch_up()
        for channel, value in zip(task.channels, values, strict=True):
            self.held[channel.number] = value

    # ---- states of tasks ----

    def reserve(self, task: Task) -> None:
        """Reserve what a task needs."""
        task.refuse_empty()
        if task.clock is not None:
            task.refuse_rate(task.clock.rate)  # channels may have come after the clock
        mine = self._resources(task)
        for other in self.tasks.values():
            if other is not task and other.state is not State.verified and mine & self._resources(other):
                raise Refusal(DAQmxErrors.PAL_RESOURCE_RESERVED, f"{task.name} by {other.name}")
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
            self.catch_up()
            task.begin()
            if task.clock is not None:
                task.rate = task.clock.rate
                self._arm(task)
            self._wake()

    def _arm(self, task: Task) -> None:
        """Start the clock of a task, if what it waits for is there."""
        assert task.clock is not None
        if self._is_clock_of_others(task):
            source = self._task_behind(task.clock.source, "SampleClock")
            if source is not None and source.ticking:
                task.rate = source.rate
                task.start = int(source.edge(source.count))
                self._set_off_by(task)
            return
        if task.trigger:
            return  # an edge that is over starts nothing
        task.start = self.plant.now + FIRST_EDGE
        self._set_off_by(task)

    def _is_clock_of_others(self, task: Task) -> bool:
        """Return whether a task has the clock of the other direction, for which it waits."""
        assert task.clock is not None
        other = "ao" if task.kind == INPUT else "ai"
        return task.clock.source.strip("/").lower() == f"{self.name}/{other}/SampleClock".lower()

    def _set_off_by(self, task: Task) -> None:
        """Start the tasks that wait for the clock or the trigger of one that has just started."""
        assert task.start is not None
        for other in self._followers(task, "StartTrigger"):
            if other.state is State.running and other.start is None and not other.done:
                other.start = task.start
        for other in self._followers(task, "SampleClock"):
            if other.state is State.running and other.start is None and not other.done:
                other.rate = task.rate
                other.start = task.start - round(other.count / (task.rate * TICK))  # it may go on

    def _followers(self, task: Task, signal: str) -> list[Task]:
        word = "ai" if task.kind == INPUT else "ao"
        wanted = f"{self.name}/{word}/{signal}".lower()
        found = []
        for other in self.tasks.values():
            source = other.trigger if signal == "StartTrigger" else other.clock.source if other.clock else ""
            if other is not task and source.strip("/").lower() == wanted:
                found.append(other)
        return found

    def _task_behind(self, terminal: str, signal: str) -> Task | None:
        """Return the running task whose clock or trigger a terminal is."""
        for task in self.tasks.values():
            word = "ai" if task.kind == INPUT else "ao"
            if (
                task.state is State.running
                and terminal.strip("/").lower() == f"{self.name}/{word}/{signal}".lower()
            ):
                return task
        return None

    def pulse(self, terminal: str) -> int:
        """Put an edge on a terminal; return how many tasks it has started."""
        with self.changed:
            self.catch_up()
            waiting = [
                task
                for task in self.tasks.values()
                if task.state is State.running
                and task.start is None
                and not task.done
                and task.trigger.strip("/").lower() == terminal.strip("/").lower()
            ]
            for task in waiting:
                task.start = self.plant.now + FIRST_EDGE
                self._set_off_by(task)
            self._wake()
            return len(waiting)

    def stop(self, task: Task) -> None:
        """Stop a task; an output holds its last value.

        Raises
        ------
        Refusal
            It had failed before: said once more.
        """
        with self.changed:
            self.catch_up()
            failure = task.failure if task.kind == OUTPUT else None
            for other in self._followers(task, "SampleClock"):
                other.start = None
            task.stop()
            task.failure = None
            self.changed.notify_all()
            if failure is not None:
                raise failure

    def remove(self, task: Task) -> None:
        """Forget a task; those who listen to it hear no more."""
        with self.changed:
            with suppress(Refusal):
                self.stop(task)
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
