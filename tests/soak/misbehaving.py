"""Misbehaving FMUs: any fault in any call, in a guarded run between innocent points, and lies about every flag."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil  # type: ignore[import-untyped, unused-ignore]
from support import fmu_factory

from soak import _lies
from soak._copied_guards import copied_guards
from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.guard import guarded as guard
from vibroimpact.orchestrator.run import Runner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

CASES = 15_000
SAMPLE = 3
SECONDS = 30.0

#: Numbers of faults and places in the model descriptions of Faulty; the event fault exists only in FMI 3.0.
FAULTS, PLACES, ENDLESS_EVENTS, HANGS = range(1, 31), 11, 13, (4, 30)
#: A million lines, or a new process in each call, take about as long as the deadline on a busy machine.
FLOODS = (5, 6, 21, 22)
#: Faults with a late effect: a damaged heap, closed files, a killed parent.
AT_A_DISTANCE = (26, 28, 29)
MARK = "VIBROIMPACT_SOAK_MARK"
DEADLINE = 1.0
SCENE = """
[scene]
units = "SI"
[component.culprit]
fmu = "Faulty.fmi{major}.fmu"
parameters = {{ fault_time = {time}, fault_place = {place}, fault_after = {after}, says_early = {early} }}
[component.bystander]
fmu = "Faulty.fmi2.fmu"
[record]
recorded_time = 0.5
variables = ["culprit.y", "bystander.y"]
rate = 20
[sweep]
"culprit.fault" = {{ values = [0] }}
"culprit.u" = {{ values = [1.0] }}
[execution]
macro_step = 0.1
deadline = {deadline}
"""


def check(seed: int) -> str | None:
    """Return the problem of a lying or misbehaving FMU; None without one. Of three cases two are lies."""
    if seed % 3:
        return _lies.told(seed)
    draw = random.Random(seed)
    fmi = draw.choice(("2.0", "3.0"))
    fault = draw.choice([f for f in FAULTS if (fmi, f) != ("2.0", ENDLESS_EVENTS)])
    if fmi == "3.0":
        fmu_factory.faulty(Path.cwd(), "3.0")
    fmu_factory.faulty(Path.cwd(), "2.0")
    text = SCENE.format(
        major=fmi[0],
        time=draw.uniform(0.0, 0.6),
        place=draw.choice([0, draw.randrange(PLACES)]),
        after=draw.choice([0, 0, draw.randrange(12)]),
        early=draw.randrange(2),
        deadline=DEADLINE,
    )
    variable = draw.choice([""] * 9 + ["VIBROIMPACT_FAULTY_LOAD", "VIBROIMPACT_FAULTY_INSTANTIATE"])
    values = {MARK: f"{os.getpid()} {seed}"} | ({variable: str(fault)} if variable else {})
    with copied_guards(), _environment(values, fault):
        problem = _loaded(text) if variable else _tried(text, [0, fault, 0])
        return problem or _left_behind(values[MARK])


@contextmanager
def _environment(values: dict[str, str], fault: int) -> Iterator[None]:
    patience = guard.START_TIME
    guard.START_TIME = 5.0 if fault in HANGS and len(values) > 1 else patience
    os.environ.update(values)
    try:
        yield
    finally:
        guard.START_TIME = patience
        for name in values:
            del os.environ[name]


def _loaded(text: str) -> str | None:
    """Return the problem of a fault while loading: a good error names the file of a component."""
    try:
        runner = open_scene(parse_scene(text, str(Path.cwd() / "scene.toml")))
    except ComponentError as error:
        named = str(error).startswith(("culprit: ", "bystander: ")) and ".fmu" in str(error)
        return None if named else f"loading: not named: {error}"
    try:
        runner.run({"culprit.fault": 0.0, "culprit.u": 1.0})
    except ComponentError as error:
        return None if "culprit" in str(error) or "bystander" in str(error) else f"run: not named: {error}"
    finally:
        runner.close()
    return None


def _tried(text: str, faults: list[int]) -> str | None:
    runner = open_scene(parse_scene(text, str(Path.cwd() / "scene.toml")))
    try:
        for place, fault in enumerate(faults):
            problem = _point(runner, fault, 1.0 + place)
            if problem is not None:
                return f"point {place + 1} of the faults {faults}: {problem}"
    finally:
        runner.close()
    return None


def _point(runner: Runner, fault: int, slope: float) -> str | None:
    began = time.monotonic()
    try:
        record = runner.run({"culprit.fault": float(fault), "culprit.u": slope})
    except ComponentError as error:
        return (
            None
            if fault and str(error).startswith("culprit")
            else f"an error that is none of its own: {error}"
        )
    if time.monotonic() - began > 25.0:
        return f"took {time.monotonic() - began:.0f} s"
    if record.outcome is Outcome.ok:
        return _wrong_values(record, slope, whole=not fault)
    if not fault:
        return f"an innocent point is lost: {record.outcome.name}: {record.message}"
    # a fault that attacks its process or others may strike during the call of another component
    blamed: tuple[str, ...] = (
        ("culprit", "bystander", "guard: ") if fault in AT_A_DISTANCE else ("culprit", "guard: ")
    )
    if fault in FLOODS:  # each call returns: the deadline may pass between two of them
        blamed += ("deadline: ",)
    named = record.message.startswith(blamed)
    return (
        None
        if named and record.outcome in (Outcome.crash, Outcome.timeout)
        else f"not named: {record.message}"
    )


def _wrong_values(record: RunRecord, slope: float, *, whole: bool) -> str | None:
    assert record.samples is not None
    times, culprit, bystander = record.samples.T
    if whole and len(times) != 11:
        return f"{len(times)} samples of 11: {record.message}"
    if len(times) != 11 and not record.message:
        return f"{len(times)} samples of 11, and no message"
    if np.abs(bystander - times).max() > 1e-12:
        return f"the bystander is wrong by {np.abs(bystander - times).max():.2g}"
    error = np.abs(culprit - slope * times).max()
    return f"the values are wrong by {error:.2g}: {record.message}" if error > 1e-11 else None


def _left_behind(mark: str) -> str | None:
    """Return the processes of the case that still live."""
    end = time.monotonic() + 10.0
    while found := [p for p in psutil.process_iter() if _is_marked(p, mark)]:
        if time.monotonic() > end:
            return f"{len(found)} processes outlive the run"
        time.sleep(0.02)
    return None


def _is_marked(process: psutil.Process, mark: str) -> bool:
    """Does a process belong to the case, by its environment or (a copy of a warm process) by its folder, and live?"""
    if process.pid == os.getpid():
        return False
    try:
        is_ours = process.environ().get(MARK) == mark or process.cwd() == os.getcwd()
        return is_ours and bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return False
