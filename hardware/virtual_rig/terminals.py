"""The terminals of a device: shared clocks, and the edges that start tasks."""

from __future__ import annotations

from vibroimpact.hardware.virtual_rig.tasks import INPUT, State, Task

FIRST_EDGE = 10_000
"""Ticks from the start of a task to the first edge of its clock."""


class Terminals:
    """Starts the tasks of a device, given by their names, by the clocks and triggers of others."""

    def __init__(self, device: str, tasks: dict[str, Task]) -> None:
        self._device, self._tasks = device, tasks

    def _is(self, text: str, word: str, signal: str) -> bool:
        return text.strip("/").lower() == f"{self._device}/{word}/{signal}".lower()

    def has_clock_of_others(self, task: Task) -> bool:
        """Return whether a task shares the clock of the other direction, for which it waits."""
        other = "ao" if task.kind == INPUT else "ai"
        return task.clock is not None and self._is(task.clock.source, other, "SampleClock")

    def followers(self, task: Task, signal: str) -> list[Task]:
        """Return the other tasks whose `SampleClock` or `StartTrigger` is that of a task."""
        word = "ai" if task.kind == INPUT else "ao"
        found = []
        for other in self._tasks.values():
            source = other.trigger if signal == "StartTrigger" else other.clock.source if other.clock else ""
            if other is not task and self._is(source, word, signal):
                found.append(other)
        return found

    def arm(self, task: Task, now: int, rate: float) -> None:
        """Start the clock of a running task, if it waits for nothing more."""
        task.rate = rate
        task.triggered = not task.trigger  # an earlier edge starts nothing
        self._try(task, now)

    def _try(self, task: Task, now: int) -> None:
        if not task.triggered:
            return
        if not self.has_clock_of_others(task):
            task.start = now + FIRST_EDGE
            self._set_off_by(task)
            return
        for source in self._tasks.values():
            if source.ticking and task in self.followers(source, "SampleClock"):
                task.follow(source)
                self._set_off_by(task)

    def _set_off_by(self, task: Task) -> None:
        """Start the tasks that wait for the clock or the trigger of a task that has just started."""
        for other in filter(_waits, self.followers(task, "StartTrigger")):
            other.triggered = True
            if not self.has_clock_of_others(other):
                other.start = task.start
                self._set_off_by(other)
        for other in filter(_waits, self.followers(task, "SampleClock")):
            if other.triggered:
                other.follow(task)
                self._set_off_by(other)

    def end_followers(self, task: Task) -> None:
        """Let the tasks that share the clock of an ended task wait for it."""
        for other in self.followers(task, "SampleClock"):
            other.start = None

    def retune_followers(self, task: Task) -> None:
        """Let the tasks that share the clock of a task continue at its rate."""
        for other in self.followers(task, "SampleClock"):
            if other.ticking:
                other.retune(task.rate)

    def pulse(self, terminal: str, now: int) -> int:
        """Put an edge on a terminal; return the number of tasks started."""
        waiting = [
            task
            for task in self._tasks.values()
            if _waits(task) and task.trigger.strip("/").lower() == terminal.strip("/").lower()
        ]
        for task in waiting:
            task.triggered = True
            self._try(task, now)
        return len(waiting)


def _waits(task: Task) -> bool:
    return task.state is State.running and task.start is None and not task.done
