"""The FMUs of the test suite behave as their README says: valid by description, each with its own fault."""

import ctypes
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    defaultCallbacks,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Component,
)
from fmpy.fmi3 import FMU3Slave
from harness import warm
from support import fmu_factory

from vibroimpact.fmus.packaging.check import check_fmu

WRITERS = {
    "BouncingBall": fmu_factory.bouncing_ball,
    "Buffer": fmu_factory.buffer,
    "Clocked": lambda folder, _: fmu_factory.clocked(folder),
    "Exchanged": fmu_factory.exchanged,
    "Faulty": fmu_factory.faulty,
    "Feedthrough": fmu_factory.feedthrough,
    "Gain": lambda folder, _: fmu_factory.gain(folder),
    "Mass": fmu_factory.mass,
    "Single": fmu_factory.single,
    "StatelessMass": lambda folder, fmi: fmu_factory.mass(folder, fmi, states=False),
    "SteppedBall": fmu_factory.stepped_ball,
    "Timed": lambda folder, _: fmu_factory.timed(folder),
    "Typed": fmu_factory.typed,
    "UpdatingMass": lambda folder, _: fmu_factory.updating_mass(folder),
}
GRAVITY, RESTITUTION, HEIGHT = 9.81, 0.7, 1.0
H, V, BOUNCES, LANDING = 1, 2, 6, 5
U, Y, FAULT, FAULT_TIME = 1, 2, 3, 4

# drives an FMU with FMPy's own classes, in a process that may die or hang
DRIVER = """
import sys
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
path, folder, fault, steps = sys.argv[1:]
md = read_model_description(path)
item = next(i for t in md.typeDefinitions if t.name == "Fault" for i in t.items if i.name == fault)
slave = FMU3Slave if md.fmiVersion == "3.0" else FMU2Slave
fmu = slave(guid=md.guid, unzipDirectory=extract(path, folder),
            modelIdentifier=md.coSimulation.modelIdentifier, instanceName="faulty")
fmu.instantiate()
if md.fmiVersion == "3.0":
    fmu.setInt64([3], [int(item.value)])
    fmu.setFloat64([4], [0.35])
else:
    fmu.setInteger([3], [int(item.value)])
    fmu.setReal([4], [0.35])
    fmu.setupExperiment()
fmu.enterInitializationMode()
fmu.exitInitializationMode()
for k in range(int(steps)):
    print("step", k, flush=True)
    print("answer", fmu.doStep(k / 10, 1 / 10), flush=True)
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


def opened(path: Path, folder: Path) -> FMU2Slave | FMU3Slave:
    md = read_model_description(str(path))
    slave = FMU3Slave if md.fmiVersion == "3.0" else FMU2Slave
    return slave(
        guid=md.guid,
        unzipDirectory=extract(str(path), str(folder)),
        modelIdentifier=md.coSimulation.modelIdentifier,
        instanceName=md.modelName,
    )


def initialize(fmu: FMU2Slave | FMU3Slave) -> None:
    if isinstance(fmu, FMU2Slave):
        fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def bounce_times(ball: FMU2Slave, step: float, count: int) -> list[float]:
    initialize(ball)
    times: list[float] = []
    k = 0
    while len(times) < count:
        ball.doStep(k * step, step)
        k += 1
        if ball.getInteger([BOUNCES])[0] > len(times):
            times.append(k * step)
    return times


def exact_bounce_times(count: int) -> list[float]:
    # free fall, then flights of 2 e^n v / g
    first = math.sqrt(2 * HEIGHT / GRAVITY)
    flights = [2 * first * RESTITUTION**n for n in range(1, count)]
    return [first + sum(flights[:n]) for n in range(count)]


@pytest.fixture
def ball(tmp_path: Path) -> Iterator[FMU2Slave]:
    fmu = opened(fmu_factory.bouncing_ball(tmp_path), tmp_path / "ball")
    fmu.instantiate()
    yield fmu
    fmu.terminate()
    fmu.freeInstance()


@pytest.mark.parametrize(("name", "fmi"), fmu_factory.MADE)
def test_each_made_fmu_is_valid_and_exports_the_whole_standard(name: str, fmi: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path, fmi)
    assert check_fmu(path) == ()


def test_each_is_compiled_once_and_has_the_same_bytes_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = [WRITERS[name](tmp_path / "one", fmi) for name, fmi in fmu_factory.MADE]
    monkeypatch.delattr(fmu_factory, "compile_library")
    again = [WRITERS[name](tmp_path / "two", fmi) for name, fmi in fmu_factory.MADE]
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in again]


@pytest.mark.parametrize(("step", "first", "third"), [(0.1, 4.85e-2, 1.74e-1), (0.001, 4.76e-4, 2.85e-3)])
def test_a_plain_loop_finds_the_bounces_late_by_parts_of_its_step(
    ball: FMU2Slave, step: float, first: float, third: float
) -> None:
    pairs = zip(bounce_times(ball, step, 3), exact_bounce_times(3), strict=True)
    errors = [found - exact for found, exact in pairs]
    assert errors[0] == pytest.approx(first, rel=0.02)
    assert errors[2] == pytest.approx(third, rel=0.02)


@pytest.mark.parametrize(
    ("landing", "height"), [(0, 0.0), (1, HEIGHT - GRAVITY / 2), (2, sys.float_info.min)]
)
def test_a_step_through_the_ground_ends_where_the_landing_says(
    ball: FMU2Slave, landing: int, height: float
) -> None:
    ball.setInteger([LANDING], [landing])
    initialize(ball)
    ball.doStep(0.0, 1.0)
    assert ball.getReal([H, V]) == pytest.approx([height, RESTITUTION * GRAVITY], abs=1e-300, rel=1e-15)


def test_a_step_that_ends_at_the_bounce_is_exact_and_can_be_taken_back(ball: FMU2Slave) -> None:
    initialize(ball)
    before = ball.getFMUState()
    ball.doStep(0.0, 1.0)
    ball.setFMUState(before)
    assert ball.getReal([H, V]) == [1.0, 0.0]
    first = exact_bounce_times(1)[0]
    ball.doStep(0.0, first * (1 + 1e-15))
    assert ball.getReal([V]) == pytest.approx([RESTITUTION * GRAVITY * first], rel=1e-14)
    ball.freeFMUState(before)


def test_a_serialized_state_comes_back_the_same(ball: FMU2Slave) -> None:
    initialize(ball)
    ball.doStep(0.0, 0.3)
    state = ball.getFMUState()
    data = ball.serializeFMUState(state)
    other = ball.deSerializeFMUstate(data)
    ball.doStep(0.3, 0.3)
    ball.setFMUState(other)
    assert ball.getReal([H]) == pytest.approx([1 - GRAVITY * 0.045], rel=1e-14)
    for each in (state, other):
        ball.freeFMUState(each)


def test_the_ball_refuses_a_communication_point_where_it_is_not(ball: FMU2Slave) -> None:
    initialize(ball)
    with pytest.raises(FMICallException):
        ball.doStep(0.2, 0.1)


def test_the_ball_of_fmi_3_has_no_event_mode(tmp_path: Path) -> None:
    ball = opened(fmu_factory.bouncing_ball(tmp_path, "3.0"), tmp_path / "ball")
    with pytest.raises(Exception, match="instantiate"):
        ball.instantiate(eventModeUsed=True)
    ball.instantiate()
    initialize(ball)
    assert ball.doStep(0.0, 1.0) == (False, False, False, 1.0)
    assert ball.getFloat64([0, H, V]) == pytest.approx([1.0, 0.0, RESTITUTION * GRAVITY], rel=1e-15)
    ball.freeInstance()


def test_the_gain_answers_at_once_and_saves_no_state(tmp_path: Path) -> None:
    gain = opened(fmu_factory.gain(tmp_path), tmp_path / "gain")
    gain.instantiate()
    gain.setReal([1, 3, 4], [2.0, 10.0, 0.5])
    initialize(gain)
    assert gain.getReal([2]) == [20.5]
    with pytest.raises(FMICallException):
        gain.getFMUState()
    gain.freeInstance()


def driver(tmp_path: Path, fmi: str, fault: str, steps: int = 5) -> list[str | Path]:
    return [DRIVER, fmu_factory.faulty(tmp_path, fmi), tmp_path / "faulty", fault, str(steps)]


def drive(tmp_path: Path, fmi: str, fault: str, steps: int = 5) -> subprocess.CompletedProcess[str]:
    return warm.run(*driver(tmp_path, fmi, fault, steps))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_without_a_fault_it_integrates_to_the_end(tmp_path: Path, fmi: str) -> None:
    result = drive(tmp_path, fmi, "none")
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("answer") == 5


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("fault", "number"), [("error", 1), ("fatal", 2)])
def test_an_error_is_logged_and_returned_at_its_time(
    tmp_path: Path, fmi: str, fault: str, number: int
) -> None:
    result = drive(tmp_path, fmi, fault)
    # steps 0 to 2 end before 0.35 s
    assert "step 3" in result.stdout
    assert result.stdout.count("answer") == 3
    assert f"broken {number} 0.4" in result.stdout
    assert "FMICallException" in result.stderr


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("fault", "signal"), [("segfault", 11), ("abort", 6), ("exit", 0)])
def test_a_crash_ends_the_process_in_the_fourth_step(
    tmp_path: Path, fmi: str, fault: str, signal: int
) -> None:
    result = drive(tmp_path, fmi, fault)
    if sys.platform != "win32":
        assert result.returncode == -signal
    assert result.stdout.rstrip().endswith("step 3")


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_hang_never_comes_back(tmp_path: Path, fmi: str) -> None:
    with warm.start(*driver(tmp_path, fmi, "hang")) as process:
        assert process.stdout is not None
        printed = list(iter(process.stdout.readline, "step 3\n"))
        assert sum(line.startswith("answer") for line in printed) == 3
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=1.0)  # any other step takes microseconds
        process.kill()
        assert process.stdout.read() == ""


def test_a_flood_prints_and_the_step_succeeds(tmp_path: Path) -> None:
    result = drive(tmp_path, "3.0", "print_flood", steps=4)
    assert result.returncode == 0, result.stderr
    assert "printed line 100000\n" in result.stdout


def faulty(tmp_path: Path, fmi: str, fault: int) -> tuple[FMU2Slave | FMU3Slave, list[bytes]]:
    fmu = opened(fmu_factory.faulty(tmp_path, fmi), tmp_path / "faulty")
    lines: list[bytes] = []
    if fmi == "3.0":
        fmu.instantiate(
            eventModeUsed=True, earlyReturnAllowed=True, logMessage=lambda *a: lines.append(a[-1])
        )
        fmu.setInt64([FAULT], [fault])
        initialize_slave(fmu)
    else:
        # the fifth argument is the format: Python cannot read the arguments after it
        logger = fmi2CallbackLoggerTYPE(lambda *a: lines.append(a[4]))
        memory = defaultCallbacks.allocateMemory, defaultCallbacks.freeMemory
        fmu.instantiate(callbacks=fmi2CallbackFunctions(logger, *memory))
        fmu.setInteger([FAULT], [fault])
        initialize(fmu)
    return fmu, lines


def initialize_slave(fmu: FMU3Slave) -> None:
    # with event mode, initialization ends in event mode
    initialize(fmu)
    fmu.enterStepMode()


def test_a_million_lines_are_logged_in_one_step(tmp_path: Path) -> None:
    fmu, lines = faulty(tmp_path, "3.0", 5)
    fmu.doStep(0.0, 0.1)
    assert len(lines) == 1_000_000
    assert lines[-1] == b"line 1000000 0.1"
    fmu.freeInstance()


def test_fmi_2_logs_through_a_format_with_arguments(tmp_path: Path) -> None:
    fmu, lines = faulty(tmp_path, "2.0", 1)
    with pytest.raises(FMICallException):
        fmu.doStep(0.0, 0.1)
    assert lines == [b"%s %d %g"]
    fmu.freeInstance()


def test_events_never_settle(tmp_path: Path) -> None:
    fmu, _ = faulty(tmp_path, "3.0", 13)
    assert fmu.doStep(0.0, 0.1) == (True, False, False, 0.1)
    fmu.enterEventMode()
    outputs = []
    for _ in range(100):
        assert fmu.updateDiscreteStates()[0]
        outputs += fmu.getFloat64([Y])
    assert outputs == [-1.0, 1.0] * 50
    fmu.freeInstance()


def test_a_stall_returns_early_at_the_same_time_for_ever(tmp_path: Path) -> None:
    fmu, _ = faulty(tmp_path, "3.0", 12)
    assert [fmu.doStep(0.0, 0.1) for _ in range(3)] == [(False, False, True, 0.0)] * 3
    fmu.freeInstance()


def test_an_end_that_the_fmu_asks_for_is_told_in_each_versions_way(tmp_path: Path) -> None:
    fmu, _ = faulty(tmp_path, "3.0", 11)
    assert fmu.doStep(0.0, 0.1) == (False, True, False, 0.1)
    fmu.freeInstance()
    fmu, _ = faulty(tmp_path, "2.0", 11)
    value = ctypes.c_int()
    assert (
        fmu.dll.fmi2DoStep(fmi2Component(fmu.component), ctypes.c_double(0.0), ctypes.c_double(0.1), 0) == 2
    )
    assert fmu.dll.fmi2GetBooleanStatus(fmi2Component(fmu.component), 3, ctypes.byref(value)) == 0
    assert value.value == 1
    fmu.freeInstance()


def test_a_discarded_step_has_gone_half_of_its_way(tmp_path: Path) -> None:
    fmu, _ = faulty(tmp_path, "2.0", 3)
    value = ctypes.c_double()
    assert (
        fmu.dll.fmi2DoStep(fmi2Component(fmu.component), ctypes.c_double(0.0), ctypes.c_double(0.1), 0) == 2
    )
    assert fmu.dll.fmi2GetRealStatus(fmi2Component(fmu.component), 2, ctypes.byref(value)) == 0
    assert value.value == 0.05
    assert fmu.getReal([Y]) == [0.05]
    fmu.freeInstance()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_output_that_is_not_a_number_comes_with_a_step_that_succeeds(tmp_path: Path, fmi: str) -> None:
    fmu, _ = faulty(tmp_path, fmi, 10)
    fmu.doStep(0.0, 0.1)
    (y,) = fmu.getReal([Y]) if fmi == "2.0" else fmu.getFloat64([Y])
    assert math.isnan(y)
    fmu.freeInstance()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_refused_parameters_are_told_when_initialization_ends(tmp_path: Path, fmi: str) -> None:
    with pytest.raises(FMICallException, match="ExitInitializationMode"):
        faulty(tmp_path, fmi, 14)
