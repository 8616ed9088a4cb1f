"""Effects of an FMU on innocent points, and its remains: nothing is lost, and nothing stays alive."""

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil  # type: ignore[import-untyped, unused-ignore]
import pytest
from harness import warm
from support import fmu_factory

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.guard import guarded as guard
from vibroimpact.orchestrator.run import Runner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and processes")

SCENE = """
[scene]
units = "SI"
[component.culprit]
fmu = "Faulty.fmi{major}.fmu"
parameters = {{ fault = "{fault}", fault_place = "{place}", fault_after = {after} }}
[record]
recorded_time = 0.5
variables = ["culprit.y"]
rate = 10
[sweep]
"culprit.u" = {{ values = [1.0] }}
[execution]
macro_step = 0.1
deadline = {deadline}
"""
MARK = "VIBROIMPACT_TEST_MARK"
"""Variable of the environment that marks the descendants of a process for a test."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("outstay")
    for fmi in ("2.0", "3.0"):
        fmu_factory.faulty(folder, fmi)
    return folder


@pytest.fixture
def runner_of(folder: Path) -> Iterator[Callable[..., Runner]]:
    made: list[Runner] = []

    def runner(
        fault: str, place: str = "step", *, after: int = 0, fmi: str = "3.0", deadline: float = 30.0
    ) -> Runner:
        text = SCENE.format(major=fmi[0], fault=fault, place=place, after=after, deadline=deadline)
        made.append(open_scene(parse_scene(text, str(folder / "scene.toml"))))
        return made[-1]

    yield runner
    for each in made:
        each.close()


def marked(value: str) -> list[psutil.Process]:
    """Return the living processes with a mark in their environment, except this one."""
    found = []
    for process in psutil.process_iter():
        try:
            own = process.pid != os.getpid() and process.environ().get(MARK) == value
            if own and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except psutil.Error:
            # it has ended in the meantime
            continue
    return found


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    value = f"{os.getpid()} {request.node.name}"
    monkeypatch.setenv(MARK, value)
    return value


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> bool:
    end = time.monotonic() + seconds
    while not (met := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return met


# ---- innocent points ----


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("fault", "place", "after"),
    [
        ("segfault", "reset", 0),
        ("abort", "exit_initialization", 3),
        ("segfault", "free", 0),
        ("exit", "step", 17),
    ],
)
def test_a_crash_that_points_before_have_caused_costs_no_point(
    runner_of: Callable[..., Runner], fmi: str, fault: str, place: str, after: int
) -> None:
    runner = runner_of(fault, place, after=after, fmi=fmi)
    remarks = []
    for k in range(1, 6):
        record = runner.run({"culprit.u": float(k)})
        assert record.outcome is Outcome.ok
        assert record.samples is not None
        assert record.samples[-1, 1] == pytest.approx(0.5 * k, rel=1e-12)
        remarks += [record.message] if record.message else []
    assert bool(remarks) == (place != "free")
    assert all(r.startswith("repeated in a new process, where it went well; in the first: ") for r in remarks)
    assert all("culprit: fmi" in r for r in remarks[1:])  # every call after the first crash is recorded


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("fault", ["error", "discard", "fatal"])
def test_a_component_that_cannot_be_reset_is_instantiated_anew(
    runner_of: Callable[..., Runner], fmi: str, fault: str
) -> None:
    runner = runner_of(fault, "reset", fmi=fmi)
    for k in range(1, 21):
        record = runner.run({"culprit.u": float(k)})
        assert (record.outcome, record.message) == (Outcome.ok, "")
        assert record.samples is not None
        assert record.samples[-1, 1] == pytest.approx(0.5 * k, rel=1e-12)


@pytest.mark.parametrize(
    # a process that stops itself can no longer name its current call
    ("fault", "named"),
    [("hang", "culprit: fmi3Reset"), ("stop_process", "no answer within")],
)
def test_a_reset_that_does_not_come_back_is_left_behind_with_its_process(
    runner_of: Callable[..., Runner], fault: str, named: str
) -> None:
    runner = runner_of(fault, "reset", deadline=0.3)
    for k in range(1, 4):
        record = runner.run({"culprit.u": float(k)})
        assert record.outcome is Outcome.ok
        assert (named in record.message) == (k > 1)


def test_a_point_that_crashes_in_a_fresh_process_too_is_lost(runner_of: Callable[..., Runner]) -> None:
    runner = runner_of("segfault", after=12)  # 12 steps are two and a half points
    outcomes = [runner.run({"culprit.u": 1.0}).outcome for _ in range(3)]
    assert outcomes == [Outcome.ok] * 3
    guilty = runner_of("segfault")
    for _ in range(2):
        record = guilty.run({"culprit.u": 1.0})
        assert record.outcome is Outcome.crash
        assert record.message.startswith("culprit: fmi3DoStep at time 0: the process was ended by SIGSEGV")


# ---- remains ----


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know the process group only")
@pytest.mark.parametrize("fault", ["fork", "fork_away"])
def test_processes_that_a_component_starts_end_with_the_run(
    runner_of: Callable[..., Runner], mark: str, fault: str
) -> None:
    runner = runner_of(fault)
    assert runner.run({"culprit.u": 1.0}).outcome is Outcome.ok
    assert len(marked(mark)) > 4  # one for each step
    runner.close()
    assert not marked(mark)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know the process group only")
def test_processes_of_a_component_that_then_crashes_end_with_it(
    runner_of: Callable[..., Runner], mark: str
) -> None:
    others = psutil.Process().children()  # children of this process from earlier tests
    runner = runner_of("fork_away", "exit_initialization")
    assert runner.run({"culprit.u": 1.0}).outcome is Outcome.ok
    assert marked(mark)
    (supervisor,) = set(psutil.Process().children()) - set(others)
    for process in supervisor.children():
        process.send_signal(signal.SIGSEGV)
    assert wait_until(lambda: not marked(mark))
    assert runner.run({"culprit.u": 1.0}).outcome is Outcome.ok


PARENT = """
import sys
from pathlib import Path
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene
runner = open_scene(parse_scene(Path(sys.argv[1]).read_text(), sys.argv[1]))
print("ready", flush=True)
runner.run({"culprit.u": 1.0})
print("run", flush=True)
time.sleep(600.0)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know the process group only")
@pytest.mark.parametrize(
    "fault",
    ["hang", *(pytest.param(fault, marks=pytest.mark.long) for fault in ("stop_process", "fork_away"))],
)
def test_nothing_of_a_component_outlives_a_parent_that_is_killed(folder: Path, mark: str, fault: str) -> None:
    path = folder / f"orphan_{fault}.toml"
    path.write_text(
        SCENE.format(major="3", fault=fault, place="step", after=0, deadline=600.0), encoding="utf-8"
    )
    # the environment carries the mark; a warm copy was started without it
    parent = warm.start(PARENT, path, cold=True)
    assert parent.stdout is not None
    assert parent.stdout.readline() == "ready\n"
    if fault == "fork_away":
        assert parent.stdout.readline() == "run\n"
    else:
        time.sleep(0.3)  # it hangs for ever in its first step
    assert len(marked(mark)) >= 3
    os.kill(parent.pid, signal.SIGKILL)
    parent.communicate(timeout=20)
    assert wait_until(lambda: not marked(mark))


@pytest.mark.parametrize("fault", ["stop_process", "close_files", "corrupt_heap"])
def test_a_component_that_turns_on_the_guard_is_a_lost_point(
    runner_of: Callable[..., Runner], mark: str, fault: str
) -> None:
    runner = runner_of(fault, deadline=0.5)
    record = runner.run({"culprit.u": 1.0})
    assert record.outcome is (Outcome.timeout if fault == "stop_process" else Outcome.crash)
    runner.close()
    assert not marked(mark)


def test_a_component_that_kills_the_supervisor_of_its_process_goes_with_it(
    runner_of: Callable[..., Runner], mark: str
) -> None:
    runner = runner_of("kill_parent", after=5)
    for _ in range(3):
        assert runner.run({"culprit.u": 1.0}).outcome in (Outcome.ok, Outcome.crash)
    runner.close()
    assert wait_until(lambda: not marked(mark))


# ---- loading ----

LOADING = [
    ("LOAD", "segfault", "loading", "ended by SIGSEGV"),
    ("LOAD", "abort", "loading", "ended by SIGABRT"),
    ("LOAD", "hang", "loading", "no answer within 12 s"),
    # a look at the running thread may just have noted the call itself
    ("INSTANTIATE", "segfault", "(loading|fmi3Instantiate)", "ended by SIGSEGV"),
]
NUMBERS = {"hang": 4, "segfault": 7, "abort": 8}


@pytest.mark.parametrize(("when", "fault", "call", "what"), LOADING)
def test_a_component_that_crashes_or_hangs_while_it_is_loaded_is_named_with_its_file(
    runner_of: Callable[..., Runner],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    mark: str,
    when: str,
    fault: str,
    call: str,
    what: str,
) -> None:
    monkeypatch.setattr(guard, "START_TIME", 12.0 if fault == "hang" else 60.0)
    monkeypatch.setenv(f"VIBROIMPACT_FAULTY_{when}", str(NUMBERS[fault]))
    with pytest.raises(ComponentError) as failure:
        runner_of("none")
    message = str(failure.value)
    assert re.match(f"culprit: {call}", message)
    assert str(folder / "Faulty.fmi3.fmu") in message
    assert what in message
    assert not marked(mark)


def test_a_library_that_was_cut_off_is_named_with_its_file(folder: Path, tmp_path: Path) -> None:
    import zipfile

    path = tmp_path / "Faulty.fmi3.fmu"
    with zipfile.ZipFile(folder / "Faulty.fmi3.fmu") as whole, zipfile.ZipFile(path, "w") as cut:
        for name in whole.namelist():
            content = whole.read(name)
            cut.writestr(name, content[:8192] if name.endswith(".so") else content)
    text = SCENE.format(major="3", fault="none", place="step", after=0, deadline=5.0)
    with pytest.raises(ComponentError, match=r"Faulty\.fmi3\.fmu"):
        open_scene(parse_scene(text, str(tmp_path / "scene.toml")))
