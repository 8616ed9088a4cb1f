"""Runs points in a child process that an FMU may crash or hang without taking the campaign with it.

The child is used again for every point; only after a crash or a missed deadline a new one is made. What the child
was doing is read from `breadcrumbs`. A hanging call is seen there at no cost. To see a call that crashes, every call
must be noted before it is made: that is done from the first crash on.

A point is repeated once, in a new process, where its loss may be no fault of its own: a crash in a process that has
run other points, or of which nobody knows the call; a hang in a call that puts an end to the point before. If it then
goes well, the result counts. What an FMU starts ends with the child (`supervisor`).
"""

from __future__ import annotations

import math
import os
import queue
import subprocess
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import IO, Any

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.python_child import ending, python_command
from vibroimpact.orchestrator.guard.breadcrumbs import Breadcrumbs
from vibroimpact.orchestrator.guard.pipe import Failure, Order, PointTask, receive, send
from vibroimpact.orchestrator.run import Runner, RunnerIdentity, open_runner
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.scene import Scene

#: Wall time that a guarded point may take where the scene names no deadline, s.
DEFAULT_DEADLINE = 300.0
#: What a child may take beyond the deadline to end the point by itself, s.
GRACE = 0.5
#: A process that can wait for a pipe itself saves the two switches to a thread that reads it.
WAITS_ON_PIPES = os.name == "posix"
#: Starting Python and loading the FMUs, s.
START_TIME = 60.0
#: What a child that is to end may take, s: longer than its supervisor takes to end all that an FMU has started.
END_TIME = 10.0
#: Calls that end the life of the point before.
AFTER_A_POINT = ("Reset", "FreeInstance", "Terminate")


@dataclass(frozen=True, slots=True)
class _Loss:
    """A point that took its process down or did not answer: its outcome, why, and the FMI call that was under way."""

    outcome: Outcome
    message: str
    function: str


class _Child:
    """A running child process; there is at most one answer on its way."""

    def __init__(self, order: Order) -> None:
        self._process = subprocess.Popen(
            python_command("-m", "vibroimpact.orchestrator.guard.supervisor"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches all processes of a terminal's session: it is the parent's
        )
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        if not WAITS_ON_PIPES:
            self._reader = threading.Thread(target=self._read, daemon=True)
            self._reader.start()
        self.say(order)

    def _read(self) -> None:
        assert self._process.stdout is not None
        while (answer := receive(self._process.stdout)) is not None:
            self._answers.put(answer)
        self._answers.put(None)

    def say(self, message: Any) -> None:
        """Send a message; a child that is gone shows in its answer."""
        assert self._process.stdin is not None
        try:
            send(self._process.stdin, message)
        except BrokenPipeError:
            return  # its output has ended too, which `answer` sees

    def answer(self, seconds: float) -> Any:
        """Return the next answer, None when the child is gone; raises TimeoutError."""
        if self._reader is None:
            assert self._process.stdout is not None
            if not wait([self._process.stdout.fileno()], seconds):
                raise TimeoutError
            return receive(self._process.stdout)
        try:
            return self._answers.get(timeout=seconds)
        except queue.Empty:
            raise TimeoutError from None

    def end(self, *, at_once: bool = False) -> int:
        """End the child, by force if it does not by itself; returns its exit code (negative: the signal)."""
        self._close(self._process.stdin)
        if at_once:
            self._process.terminate()
        try:
            code = self._process.wait(END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        if self._reader is not None:
            self._reader.join()
        self._close(self._process.stdout)
        return code

    @staticmethod
    def _close(pipe: IO[bytes] | None) -> None:
        assert pipe is not None
        try:
            pipe.close()
        except BrokenPipeError:
            return  # what was still to be sent has no reader any more


class GuardedRunner:
    """Runs points of a scene in a guarded child process, whose runner gets `execution`; the interface of any runner.

    Raises
    ------
    ComponentError
        The child cannot load the scene's components; its message says why.
    """

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        self._scene = scene
        self._wanted = execution
        self._folder = ScratchFolder("guard")
        self._child: _Child | None = None
        self._points = 0  # that the child has run
        self._noting = False
        try:
            identity = self._start()
        except BaseException:
            self._folder.cleanup()
            raise
        self.execution = identity.execution
        self.instruction_set = identity.instruction_set
        self.fmu_hashes = dict(identity.fmu_hashes)
        deadline = scene.execution.deadline
        self._deadline = DEFAULT_DEADLINE if deadline is None else deadline

    def _start(self) -> RunnerIdentity:
        path = Path(self._folder.name) / "notes"
        Breadcrumbs.create(path)
        self._notes = Breadcrumbs(path)
        self._notes.begin()
        self._child = _Child(Order(self._scene, self._wanted, str(path), self._noting))
        try:
            answer = self._child.answer(START_TIME)
        except TimeoutError:
            answer = Failure(self._what_happened(f"no answer within {START_TIME:g} s"))
        if isinstance(answer, RunnerIdentity):
            self._points = 0
            return answer
        code = self._end_child(at_once=answer is not None)
        if isinstance(answer, Failure):
            raise (ComponentFileError if answer.misuse else ComponentError)(answer.message)
        raise ComponentError(self._what_happened(f"the process {ending(code)}"))

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point; a crash or a missed deadline is its outcome.

        Raises
        ------
        ComponentError
            The point failed in the child, which lives on.
        """
        began = time.perf_counter()
        point = PointTask(dict(values), start)
        used = self._child is not None and self._points > 0
        found = self._attempt(point)
        if isinstance(found, _Loss):
            found = self._second_attempt(point, found, used=used)
        seconds = time.perf_counter() - began
        if isinstance(found, _Loss):
            return empty_record(self._scene, found.outcome, found.message, seconds)
        return replace(found, seconds=seconds)

    def _attempt(self, point: PointTask) -> RunRecord | _Loss:
        """Run a point in the child, or in a new one."""
        if self._child is None:
            self._start()
        assert self._child is not None
        self._points += 1
        self._notes.begin()
        self._child.say(point)
        try:
            answer = self._child.answer(self._deadline + GRACE)
        except TimeoutError:
            return self._lost(Outcome.timeout, f"no answer within {self._deadline:g} s")
        if answer is None:
            return self._lost(Outcome.crash, f"the process {ending(self._end_child())}")
        if isinstance(answer, Failure):
            raise ComponentError(answer.message)
        record: RunRecord = answer
        return record

    def _second_attempt(self, point: PointTask, loss: _Loss, *, used: bool) -> RunRecord | _Loss:
        """Repeat a lost point in a new process where that may help, or tell which call crashes."""
        if loss.outcome is Outcome.crash:
            helps = used or not self._noting
            self._noting = True
        else:
            # no call known: the process was stopped, perhaps by what the point before has left
            helps = used and (not loss.function or loss.function.endswith(AFTER_A_POINT))
        if not helps:
            return loss
        try:
            again = self._attempt(point)
        except ComponentError as error:
            raise ComponentError(f"{error} Before that, in another process: {loss.message}") from error
        if isinstance(again, _Loss) and again.outcome is not loss.outcome:
            return replace(again, message=f"{again.message}. In another process before: {loss.message}")
        if isinstance(again, _Loss):
            return again
        remark = f"repeated in a new process, where it went well; in the first: {loss.message}"
        return replace(again, message="; ".join(filter(None, (again.message, remark))))

    def _lost(self, outcome: Outcome, what: str) -> _Loss:
        """Give up a child that is gone or does not answer and say what it was doing."""
        if self._child is not None:  # first: it may still be writing what is read then
            self._end_child(at_once=True)
        known = self._noting or outcome is Outcome.timeout
        message = self._what_happened(what) if known else f"guard: {what}"
        return _Loss(outcome, message, self._notes.last_call()[1])

    def _end_child(self, *, at_once: bool = False) -> int:
        assert self._child is not None
        code = self._child.end(at_once=at_once)
        self._child = None
        return code

    def _what_happened(self, what: str) -> str:
        instance, function, at = self._notes.last_call()
        if not instance:
            return f"guard: expected an answer of the child process, got {what}."
        if math.isnan(at):
            # no run has begun: the file is what a user can do something about
            function = f"{function} of {self._file_of(instance) or instance}"
        lines = [
            line for line in self._notes.last_lines() if line
        ]  # one was perhaps cut off before its first letter
        logged = " | ".join(lines[-5:]) if lines else "nothing"
        when = "" if math.isnan(at) else f" at time {at:.17g}"
        return f"{instance}: {function}{when}: {what}; the component logged last: {logged}"

    def _file_of(self, instance: str) -> str:
        components = self._scene.general.components if self._scene.general is not None else ()
        return next((str(spec.fmu) for spec in components if spec.name == instance), "")

    def close(self) -> None:
        """End the child and remove its notes."""
        if self._child is not None:
            self._end_child()
        self._folder.cleanup()


def make_runner(scene: Scene, *, execution: str = "auto") -> Runner:
    """Return the runner of a scene, in a guarded child process where the scene asks for it.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    guarded = scene.general.guard if scene.general is not None else scene.execution.guard
    return GuardedRunner(scene, execution=execution) if guarded else open_runner(scene, execution)
