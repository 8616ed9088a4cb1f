"""Faults of an FMU in its process: the point has an outcome and a message with the place, and the next point runs."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil  # type: ignore[import-untyped, unused-ignore]
import pytest
from harness import warm
from support import fmu_factory
from support.command_line import vibroimpact

from vibroimpact.analysis.dataset import Outcome, RunRecord, read_flat
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.guard import GuardedRunner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and processes")

#: Names of faults; the index is the number in the model descriptions.
FAULTS = (
    "none", "error", "fatal", "discard", "hang", "log_flood", "print_flood", "segfault", "abort", "exit",
    "not_a_number", "terminate", "stall", "endless_events", "refuse",
)  # fmt: skip
ENDLESS_LOG = 30
PATIENCE, IMPATIENCE = 30.0, 0.4
"""Deadlines, s: of points that end by themselves, and of points that do not."""
FAULT_TIME, STEP = 0.35, 0.1

SCENE = """
[scene]
units = "SI"
[component.before]
fmu = "Oscillator"
parameters = {{ displacement_start = 1.0 }}
[component.culprit]
fmu = "Faulty.fmi{major}.fmu"
parameters = {{ fault = "none", fault_time = {fault_time} }}
[component.ball]
fmu = "BouncingBall.fmi2.fmu"
[[event]]
watch = "ball.h"
direction = "falling"
[record]
recorded_time = 1.0
variables = ["culprit.y", "ball.h"]
rate = 10
[sweep]
{sweep}
[execution]
macro_step = 0.1
guard = true
deadline = {deadline}
"""
#: Message of each fault; points with other faults end well.
SAID = {
    "error": "culprit: {fmi}DoStep returned error at time 0.30000000000000004: broken 1 0.4",
    "fatal": "culprit: {fmi}DoStep returned fatal at time 0.30000000000000004: broken 2 0.4",
    "discard": "culprit: {fmi}DoStep returned discard at time 0.3",
    "hang": "culprit: {fmi}DoStep at time 0.30000000000000004: no answer within 0.4 s",
    "segfault": "culprit: {fmi}DoStep at time 0.30000000000000004: the process was ended by SIGSEGV",
    "abort": "culprit: {fmi}DoStep at time 0.30000000000000004: the process was ended by SIGABRT",
    "exit": "culprit: {fmi}DoStep at time 0.30000000000000004: the process ended with exit code 0",
    "not_a_number": "culprit.y: expected a finite value, got nan at time 0.4",
    "terminate": "a component asked for the end at time 0.4",
    "stall": "culprit: fmi3DoStep: expected steps that advance",
    "endless_events": "culprit: fmi3UpdateDiscreteStates: expected event iteration to end",
    "refuse": "culprit: {fmi}ExitInitializationMode returned error at time 0: refused 14 0.35",
}
OUTCOMES = {
    "hang": Outcome.timeout,
    "segfault": Outcome.crash,
    "abort": Outcome.crash,
    "exit": Outcome.crash,
    **dict.fromkeys(["none", "log_flood", "print_flood", "terminate"], Outcome.ok),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("faults")
    for fmi in ("2.0", "3.0"):
        fmu_factory.faulty(folder, fmi)
    fmu_factory.bouncing_ball(folder)
    return folder


def scene_text(
    fmi: str, deadline: float = PATIENCE, sweep: str = '"culprit.fault" = { values = [0.0] }'
) -> str:
    return SCENE.format(major=fmi[0], fault_time=FAULT_TIME, sweep=sweep, deadline=deadline)


@pytest.fixture(scope="module")
def runner_of(folder: Path) -> Iterator[Callable[[str, float], GuardedRunner]]:
    """Return runners for all faults of their kind: after each fault they must be able to run again."""
    made: dict[tuple[str, float], GuardedRunner] = {}

    def runner(fmi: str, deadline: float) -> GuardedRunner:
        if (fmi, deadline) not in made:
            scene = parse_scene(scene_text(fmi, deadline), str(folder / "faults.toml"))
            guarded = open_scene(scene)
            assert isinstance(guarded, GuardedRunner)
            made[fmi, deadline] = guarded
        return made[fmi, deadline]

    yield runner
    for guarded in made.values():
        guarded.close()
    assert not living_children()


def living_children() -> list[psutil.Process]:
    """Return the guard children of this process that still run."""
    return [
        p
        for p in psutil.Process().children()
        if p.status() != psutil.STATUS_ZOMBIE and "vibroimpact.orchestrator.guard.supervisor" in words(p)
    ]


def words(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def assert_runs_well(record: RunRecord) -> None:
    assert record.outcome is Outcome.ok
    assert record.message == ""
    assert record.samples is not None
    assert np.abs(record.samples[:, 1] - record.samples[:, 0]).max() < 1e-12  # y' = 1


CASES = [
    (fmi, fault) for fmi in ("3.0", "2.0") for fault in FAULTS if (fmi, fault) != ("2.0", "endless_events")
]


@pytest.mark.parametrize(("fmi", "fault"), CASES)
def test_a_fault_is_an_outcome_or_an_error_that_says_who_where_and_when(
    runner_of: Callable[[str, float], GuardedRunner], fmi: str, fault: str
) -> None:
    runner = runner_of(fmi, IMPATIENCE if fault == "hang" else PATIENCE)
    said = SAID.get(fault, "")
    if (fmi, fault) == ("2.0", "stall"):
        said = "culprit: fmi2DoStep returned discard"
    said = said.format(fmi="fmi3" if fmi == "3.0" else "fmi2")
    values = {"culprit.fault": float(FAULTS.index(fault))}
    if fault in OUTCOMES:
        record = runner.run(values)
        assert record.outcome is OUTCOMES[fault]
        assert record.message.startswith(said)
    else:
        with pytest.raises(ComponentError) as failure:
            runner.run(values)
        assert str(failure.value).startswith(said)
    assert_runs_well(runner.run({"culprit.fault": 0.0}))
    assert len(living_children()) <= 4


def test_a_crash_after_log_lines_tells_the_last_ones_and_none_of_another_point(folder: Path) -> None:
    # the flood comes in every step from .1 on; then another point crashes without a message
    scene = parse_scene(scene_text("3.0"), str(folder / "faults.toml"))
    runner = open_scene(scene)
    try:
        flooded = runner.run({"culprit.fault": float(FAULTS.index("log_flood"))})
        assert flooded.outcome is Outcome.ok
        crashed = runner.run({"culprit.fault": float(FAULTS.index("segfault"))})
        assert crashed.message.endswith("the component logged last: nothing")
        with pytest.raises(ComponentError, match=r"returned discard .*: the component logged nothing"):
            runner.run({"culprit.fault": float(FAULTS.index("discard"))})
    finally:
        runner.close()


def test_what_a_component_logged_before_it_hung_is_told(folder: Path) -> None:
    # the deadline passes inside an endless flood: the lines until then are there
    runner = open_scene(parse_scene(scene_text("2.0", 2.0), str(folder / "f.toml")))
    try:
        record = runner.run({"culprit.fault": float(ENDLESS_LOG)})
    finally:
        runner.close()
    assert record.outcome is Outcome.timeout
    assert record.message.startswith(SAID["hang"].format(fmi="fmi2").replace("0.4 s", "2 s"))
    assert "the component logged last: line " in record.message


def test_a_hundred_failing_points_do_not_confuse_what_is_told_of_the_next_one(folder: Path) -> None:
    # every failing point creates the components anew: the space for notes must suffice
    runner = open_scene(parse_scene(scene_text("3.0"), str(folder / "faults.toml")))
    try:
        for _ in range(100):
            with pytest.raises(ComponentError, match="culprit: fmi3DoStep returned error"):
                runner.run({"culprit.fault": float(FAULTS.index("error"))})
        crashed = runner.run({"culprit.fault": float(FAULTS.index("segfault"))})
        assert crashed.message.startswith("culprit: fmi3DoStep at time 0.3")
        assert_runs_well(runner.run({"culprit.fault": 0.0}))
    finally:
        runner.close()


def test_neighbours_of_faults_in_a_batch_are_kept_and_each_fault_is_told_as_if_it_were_alone(
    runner_of: Callable[[str, float], GuardedRunner],
) -> None:
    runner = runner_of("3.0", IMPATIENCE)
    faults = ["none"] * 4 + ["segfault", "none", "none", "error", "none", "none", "hang", "none", "none"]
    points = [{"culprit.fault": float(FAULTS.index(fault))} for fault in faults]
    runner.announce([(values, None) for values in points])
    for fault, values in zip(faults, points, strict=True):
        if fault == "none":
            assert_runs_well(runner.run(values))
        elif fault == "error":
            with pytest.raises(ComponentError) as failure:
                runner.run(values)
            assert str(failure.value).startswith(SAID[fault].format(fmi="fmi3"))
        else:
            record = runner.run(values)
            assert record.outcome is OUTCOMES[fault]
            assert record.message.startswith(SAID[fault].format(fmi="fmi3"))
            assert record.seconds > (IMPATIENCE if fault == "hang" else 0.0)


def test_a_child_that_is_killed_between_two_points_costs_no_point(folder: Path) -> None:
    runner = open_scene(parse_scene(scene_text("3.0"), str(folder / "faults.toml")))
    try:
        assert_runs_well(runner.run({"culprit.fault": 0.0}))
        tree = [p for child in living_children() for p in (child, *child.children(recursive=True))]
        for process in tree:
            process.kill()
        wait_until(lambda: not any(alive(process) for process in tree))
        again = runner.run({"culprit.fault": 0.0})
        assert again.outcome is Outcome.ok
        assert again.message.startswith(
            "repeated in a new process, where it went well; in the first: guard: "
        )
        assert_runs_well(runner.run({"culprit.fault": 0.0}))
    finally:
        runner.close()


def test_ctrl_c_does_not_reach_the_point_that_a_child_runs(folder: Path) -> None:
    runner = open_scene(parse_scene(scene_text("3.0"), str(folder / "faults.toml")))
    try:
        before = living_children()
        for child in before:
            child.send_signal(signal.SIGINT)
        assert_runs_well(runner.run({"culprit.fault": 0.0}))
    finally:
        runner.close()


def test_an_fmu_that_cannot_be_loaded_is_an_error_of_the_runner(folder: Path, tmp_path: Path) -> None:
    before = living_children()
    broken = tmp_path / "Faulty.fmi3.fmu"
    broken.write_bytes((folder / "Faulty.fmi3.fmu").read_bytes())
    (tmp_path / "BouncingBall.fmi2.fmu").write_bytes((folder / "BouncingBall.fmi2.fmu").read_bytes())
    scene = parse_scene(scene_text("3.0"), str(tmp_path / "faults.toml"))
    broken.write_bytes(b"no longer an FMU")
    with pytest.raises(ComponentError, match=r"Faulty\.fmi3\.fmu"):
        open_scene(scene)
    assert set(living_children()) <= set(before)


# ---- no orphans ----

PARENT = """
import sys
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import load_scene
runner = open_scene(load_scene(sys.argv[1]))
print("ready", flush=True)
runner.run({"culprit.fault": 4.0})
"""


@pytest.mark.parametrize(
    "how",
    [signal.SIGKILL, *(pytest.param(how, marks=pytest.mark.long) for how in (signal.SIGTERM, signal.SIGINT))],
)
def test_a_hanging_component_does_not_outlive_its_parent(folder: Path, how: signal.Signals) -> None:
    path = folder / "orphan.toml"
    path.write_text(scene_text("3.0", 600.0), encoding="utf-8")
    parent = warm.start(PARENT, path, stderr=warm.DEVNULL)
    assert parent.stdout is not None
    assert parent.stdout.readline() == "ready\n"
    supervised = hanging(psutil.Process(parent.pid))
    os.kill(parent.pid, how)
    parent.communicate(timeout=20)
    wait_until(lambda: not any(map(alive, supervised)))
    assert not any(map(alive, supervised))


def hanging(parent: psutil.Process) -> list[psutil.Process]:
    """Wait until a point hangs; return its process and the process that watches it."""
    (supervisor,) = parent.children()
    wait_until(lambda: any(each.cpu_times().user > 0.5 for each in supervisor.children()))
    (point,) = supervisor.children()
    assert point.cpu_times().user > 0.5
    return [supervisor, point]


def alive(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)


# ---- campaigns ----


def campaign(scene: Path, output: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return vibroimpact("campaign", scene, "-o", output, *options)


def test_a_campaign_goes_on_without_the_points_that_crash_hang_or_fail(
    folder: Path, tmp_path: Path, cluster: str
) -> None:
    faults = [f for f in FAULTS if f not in ("log_flood", "print_flood")]
    numbers = [float(FAULTS.index(f)) for f in faults]
    path = folder / "campaign.toml"
    path.write_text(
        scene_text("3.0", IMPATIENCE, f'"culprit.fault" = {{ values = {numbers} }}'), encoding="utf-8"
    )
    done = campaign(path, tmp_path / "out", "--scheduler", cluster)
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr
    dataset = read_flat(tmp_path / "out" / "dataset.nc")
    outcomes = [Outcome(int(o)) for o in dataset["outcome"].values]
    assert outcomes == [OUTCOMES.get(fault, Outcome.error) for fault in faults]
    for fault, message in zip(faults, dataset["message"].values, strict=True):
        assert str(message).startswith(SAID.get(fault, "").format(fmi="fmi3")), fault
        assert bool(str(message)) == (fault != "none")


def test_a_sweep_over_the_time_of_a_crash_has_all_points_that_end_before_it(
    folder: Path, tmp_path: Path, cluster: str
) -> None:
    path = folder / "times.toml"
    sweep = '"culprit.fault_time" = { start = 0.05, stop = 1.95, points = 10 }'
    text = scene_text("2.0", PATIENCE, sweep).replace(
        'fault = "none", fault_time = 0.35', 'fault = "segfault"'
    )
    path.write_text(text, encoding="utf-8")
    done = campaign(path, tmp_path / "out", "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    dataset = read_flat(tmp_path / "out" / "dataset.nc")
    times = dataset["fault_time"].values
    outcomes = dataset["outcome"].values
    np.testing.assert_array_equal(outcomes == Outcome.ok, times > 1.0)
    assert set(outcomes[times < 1.0]) == {int(Outcome.crash)}
    messages = [str(m) for m in dataset["message"].values[times < 1.0]]
    assert all("SIGSEGV" in m and m.startswith("culprit: fmi2DoStep at time ") for m in messages)
    resumed = campaign(path, tmp_path / "out", "--scheduler", cluster)
    assert resumed.returncode == 0, resumed.stderr
    again = read_flat(tmp_path / "out" / "dataset.nc")
    np.testing.assert_array_equal(again["outcome"].values, outcomes)  # crashed points do not run again
    np.testing.assert_array_equal(again["point_seconds"].values, dataset["point_seconds"].values)


# ---- a hang outside of a step ----

HANGING_LAW = """\
def contact_law(displacement, velocity):
    while displacement > 0.5:
        pass
    return 0.7
"""
LAW_SCENE = """
[scene]
units = "SI"
[component.body]
fmu = "Oscillator"
parameters = { "forcing.amplitude" = 0.5, "contact[1].law" = "external", "contact[1].position" = 0.75 }
[component.law]
fmu = "law.fmu"
[[connection]]
from = "body.contact[1].displacement"
to = "law.displacement"
[[connection]]
from = "law.applied_restitution"
to = "body.contact[1].applied_restitution"
[record]
recorded_time = 10.0
[execution]
macro_step = 100.0
guard = true
deadline = 1.0
"""


def test_a_law_in_python_that_never_answers_is_told_as_the_call_that_hangs(tmp_path: Path) -> None:
    pytest.importorskip("pythonfmu")
    from vibroimpact.fmus.packaging.python_fmus import build_user_contact_law

    before = living_children()
    (tmp_path / "law.py").write_text(HANGING_LAW, encoding="utf-8")
    build_user_contact_law(tmp_path / "law.py", tmp_path / "law.fmu")
    runner = open_scene(parse_scene(LAW_SCENE, str(tmp_path / "law.toml")))
    try:
        record = runner.run({})
    finally:
        runner.close()
    assert record.outcome is Outcome.timeout
    assert record.message.startswith("law: fmi2GetReal at time ")
    assert set(living_children()) <= set(before)
