"""Runs points in a child process that an FMU may crash or hang without ending the campaign.

One child runs all points; only a crash or a missed deadline needs a new child. Announced points run in batches, as
waking two processes for each costs more than all else. `breadcrumbs` shows the last call of a child. A hanging call is
seen there at no cost. To see a call that crashes, every call must be noted before it is made; this starts after the
first crash.

A point is repeated once, in a new process, if its loss may be no fault of its own. This holds for a crash with an
unknown call, or in a process that has run other points. It also holds for a hang in a call that ends the previous
point. If the repetition succeeds, its result counts. Processes that an FMU has started end with the child
(`supervisor`).
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import shown_name
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.orchestrator.guard.breadcrumbs import Breadcrumbs
from vibroimpact.orchestrator.guard.pipe import BATCH_TIME, MOST_POINTS, Failure, Order, PointTask
from vibroimpact.orchestrator.guard.point_process import HAS_BELL, PointProcess
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.points import PointColumns, State
from vibroimpact.orchestrator.run.runner import Rows, Runner, RunnerIdentity
from vibroimpact.orchestrator.scene import Scene

#: Longest wall time of a guarded point in a scene without a deadline, s.
DEFAULT_DEADLINE = 300.0
#: Time beyond the deadline in which a child may end the point by itself, s.
GRACE = 0.5
#: Points announced together; a batch is a small part of them.
ANNOUNCED = 16 * MOST_POINTS
#: Longest time to start Python and load the FMUs, s.
START_TIME = 60.0
#: Calls that end the previous point.
AFTER_A_POINT = ("Reset", "FreeInstance", "Terminate")


@dataclass(frozen=True, slots=True)
class _Loss:
    """A point that took its process down or did not answer.

    `function`: the FMI call under way; `used`: its process had run other points; `seconds`: the time it cost.
    """

    outcome: Outcome
    message: str
    function: str
    used: bool
    seconds: float


class GuardedRunner(Runner):
    """Runs points of a scene in a guarded child process, whose runner gets `execution`.

    Raises
    ------
    ComponentError
        The child cannot load the scene's components, for the reason in the message.
    """

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        self.scene = scene
        self._execution = execution
        self._folder = ScratchFolder("guard")
        self._child: PointProcess | None = None
        self._points = 0  # number of points that the child has run
        self._announced: deque[PointTask] = deque()
        self._ready: deque[tuple[PointTask, RunRecord | Failure | _Loss]] = deque()
        self._batch_size = 1
        self._noting = False
        try:
            identity = self._start()
        except BaseException:
            self._folder.cleanup()
            raise
        self.execution = identity.execution
        self.instruction_set = identity.instruction_set
        self.fmu_hashes = dict(identity.fmu_hashes)
        self.engine = identity.engine
        deadline = scene.execution.deadline
        self._deadline = DEFAULT_DEADLINE if deadline is None else deadline

    def _start(self) -> RunnerIdentity:
        path = Path(self._folder.name) / "notes"
        Breadcrumbs.create(path)
        self._notes = Breadcrumbs(path)
        self._notes.begin()
        self._child = PointProcess(Order(self.scene, self._execution, str(path), self._noting))
        try:
            (answer,), _ = self._child.answers(START_TIME)
        except TimeoutError:
            answer = Failure(self._what_happened(f"no answer within {START_TIME:g} s"))
        if isinstance(answer, RunnerIdentity):
            self._points = 0
            return answer
        code, _ = self._end_child(at_once=answer is not None)
        if isinstance(answer, Failure):
            raise (ComponentFileError if answer.misuse else ComponentError)(answer.message)
        raise ComponentError(self._what_happened(f"the process {ending(code)}"))

    def rows(self, points: PointColumns, start: State | None = None, deadline: float = math.inf) -> Rows:
        """Run independent points in batches: see `Runner.rows`."""
        if start is not None or not points.are_independent:
            return super().rows(points, start, deadline)
        records: list[RunRecord] = []
        for first in range(0, len(points), ANNOUNCED):
            places = list(points.chosen(slice(first, first + ANNOUNCED)).places())
            self.announce([(place.point.values, place.start) for place in places])
            found, _ = self.rows_one_by_one(places, None, deadline)
            records += found
            if len(found) < len(places) or time.perf_counter() > deadline:
                break
        return records, None

    def announce(self, points: Sequence[PointTask]) -> None:
        """Announce the next points of `run`; the same objects must be given to it."""
        self._announced = deque(points if HAS_BELL else ())

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point, and some of the points announced after it; a crash or a missed deadline is its outcome.

        Raises
        ------
        ComponentError
            The point failed in the child, which lives on.
        """
        point = (values, start)
        if not self._ready or not _are_same(self._ready[0][0], point):
            batch = self._batch_from(point)
            self._ready = deque(zip(batch, self._attempt(batch), strict=False))
        _, found = self._ready.popleft()
        if self._announced:
            self._announced.popleft()
        if isinstance(found, _Loss):
            found = self._second_attempt(point, found)
        if isinstance(found, Failure):
            raise ComponentError(found.message)
        if isinstance(found, _Loss):
            return empty_record(self.scene, found.outcome, found.message, found.seconds)
        return found

    def _batch_from(self, point: PointTask) -> list[PointTask]:
        """Return a point with the points announced after it that fit into the time of a batch."""
        if not self._announced or not _are_same(self._announced[0], point):
            self._announced.clear()
            return [point]
        return list(islice(self._announced, self._batch_size))

    def _attempt(self, batch: Sequence[PointTask]) -> list[RunRecord | Failure | _Loss]:
        """Run points in the child, or in a new one; returns their results up to a loss or the end of a batch."""
        if self._child is None:
            self._start()
        assert self._child is not None
        began, used = time.perf_counter(), self._points > 0
        self._notes.begin()
        self._child.say(tuple((dict(values), start) for values, start in batch))
        try:
            found, loss = self._answers_to(batch)
        except BaseException:  # Ctrl-C: nobody waits for the next answers
            self._end_child(at_once=True)
            raise
        seconds = time.perf_counter() - began
        self._points += len(found)
        self._batch_size = max(1, min(MOST_POINTS, int(BATCH_TIME * len(found) / seconds)))
        if loss is not None and len(found) < len(batch):
            seconds -= sum(record.seconds for record in found if isinstance(record, RunRecord))
            found.append(replace(loss, used=used or len(found) > 0, seconds=seconds))
        return found

    def _answers_to(self, batch: Sequence[PointTask]) -> tuple[list[Any], _Loss | None]:
        """Wait for the answers to a batch; returns them, and the loss if the child was lost."""
        assert self._child is not None
        # the last of several points starts before BATCH_TIME is over
        most = self._deadline + GRACE + (BATCH_TIME if len(batch) > 1 else 0.0)
        found, last = [], False
        try:
            while not last:
                answers, last = self._child.answers(most)
                found += answers
        except TimeoutError:
            _, unread = self._end_child(at_once=True)  # first: the child may still be writing
            return found + unread, self._lost(Outcome.timeout, f"no answer within {self._deadline:g} s")
        if found[-1] is not None:
            return found, None
        code, unread = self._end_child()
        return found[:-1] + unread, self._lost(Outcome.crash, f"the process {ending(code)}")

    def _second_attempt(self, point: PointTask, loss: _Loss) -> RunRecord | Failure | _Loss:
        """Repeat a lost point in a new process if that may help, or to find the call that crashes."""
        if loss.outcome is Outcome.crash:
            helps = loss.used or not self._noting
            self._noting = True
        else:
            # unknown call: the process was stopped, perhaps by an effect of the previous point
            helps = loss.used and (not loss.function or loss.function.endswith(AFTER_A_POINT))
        if not helps:
            return loss
        (again,) = self._attempt([point])
        if isinstance(again, Failure):
            return Failure(f"{again.message} Before that, in another process: {loss.message}")
        seconds = loss.seconds + again.seconds
        if isinstance(again, _Loss):
            differs = again.outcome is not loss.outcome
            before = f". In another process before: {loss.message}" if differs else ""
            return replace(again, message=again.message + before, seconds=seconds)
        remark = f"repeated in a new process, where it went well; in the first: {loss.message}"
        return replace(again, message="; ".join(filter(None, (again.message, remark))), seconds=seconds)

    def _lost(self, outcome: Outcome, what: str) -> _Loss:
        """Return the loss of a child that is gone or did not answer, with its last call."""
        known = self._noting or outcome is Outcome.timeout
        message = self._what_happened(what) if known else f"guard: {what}"
        return _Loss(outcome, message, self._notes.last_call()[1], used=False, seconds=0.0)

    def _end_child(self, *, at_once: bool = False) -> tuple[int, list[Any]]:
        assert self._child is not None
        child, self._child = self._child, None
        return child.end(at_once=at_once)

    def _what_happened(self, what: str) -> str:
        instance, function, at = self._notes.last_call()
        if not instance:
            return f"guard: expected an answer of the child process, got {what}."
        if math.isnan(at):
            # before any run: a user can act on the file
            function = f"{function} of {self._file_of(instance) or instance}"
        lines = [
            line for line in self._notes.last_lines() if line
        ]  # a line may be cut off before its first letter
        logged = " | ".join(lines[-5:]) if lines else "nothing"
        when = "" if math.isnan(at) else f" at time {at:.17g}"
        return f"{instance}: {function}{when}: {what}; the component logged last: {logged}"

    def _file_of(self, instance: str) -> str:
        return next((shown_name(spec.fmu) for spec in self.scene.components if spec.name == instance), "")

    def close(self) -> None:
        """End the child and remove its notes."""
        if self._child is not None:
            self._end_child()
        self._folder.cleanup()


def _are_same(one: PointTask, other: PointTask) -> bool:
    """Whether two points are the same object: equal values may differ in the sign of a zero."""
    return one[0] is other[0] and one[1] == other[1]
