"""The target time of a rig: as in real time, slower or faster, or in lockstep with its programs."""

from __future__ import annotations

import time
from collections.abc import Collection

from vibroimpact.hardware.virtual_rig.plant import TICK
from vibroimpact.hardware.virtual_rig.tasks import Task

FAR_BEHIND = 0.1
"""Lateness above which the time of the rig is no longer made up, s."""
PATIENCE = 5.0
"""Maximum wait of a faster rig for an idle program, s of the wall; a read of NI's client waits longer."""


class Pace:
    """The time that a rig should have reached.

    Parameters
    ----------
    speed : float
        Seconds of the rig in a second of real time.

    Attributes
    ----------
    lockstep : bool
        Time advances only while a call waits for it, and stops before a buffer runs empty or overflows.
    speed : float
        Above 1, time also stops before a buffer runs empty or overflows. For an idle program it waits at most
        `patience`; then the buffer runs empty or overflows.
    patience : float
        Maximum wait for an idle program, s of the wall.
    slipped : float
        Total time by which the rig was late and that is not made up, s.
    requested : int
        Tick up to which waiting calls request time, in lockstep.
    waits_for : str
        The task for which time waits; empty: time does not wait.
    """

    def __init__(self, speed: float) -> None:
        self.lockstep, self.speed, self.slipped = False, speed, 0.0
        self.patience = PATIENCE
        self._stands: dict[str, tuple[int, float]] = {}
        self.go_on_from(0)

    def go_on_from(self, now: int) -> None:
        """Let time continue from a tick, now."""
        self._begin, self._origin = time.monotonic(), now
        self.requested, self.waits_for = now, ""

    def due(self, now: int, tasks: Collection[Task]) -> int:
        """Return the tick that time should have reached; `now` or less where time should not advance."""
        if self.lockstep:
            return min([self.requested, *(task.limit for task in tasks if task.ticking)])
        due = self._origin + int((time.monotonic() - self._begin) * self.speed / TICK)
        if self.speed <= 1.0:
            return due
        limit, self.waits_for = self._limit(now, due, tasks)
        if limit is None:
            return due
        # time that passes during a wait is not made up
        self._begin, self._origin = time.monotonic(), limit
        return limit

    def _limit(self, now: int, due: int, tasks: Collection[Task]) -> tuple[int | None, str]:
        """Return the first tick before `due` where time waits, and for which task."""
        found: tuple[int | None, str] = None, ""
        stood, self._stands = self._stands, {}
        wall = time.monotonic()
        for task in (each for each in tasks if each.ticking):
            limit = task.limit
            if limit > due:
                continue
            if limit <= now:
                position, since = stood.get(task.name, (task.position, wall))
                since = since if position == task.position else wall
                self._stands[task.name] = task.position, since
                if wall - since > self.patience:
                    continue
            if found[0] is None or limit < found[0]:
                found = max(limit, now), task.name
        return found

    def give_up(self, now: int, due: int) -> None:
        """Add the lateness of the rig to `slipped` where it is too large to be made up."""
        late = (due - now) * TICK / self.speed
        if late > FAR_BEHIND and not self.lockstep:
            self.slipped += late
            self.go_on_from(now)
