"""Common behaviour of all bodies' FMUs: FMPy alone, bad parameters, misuse."""

import ctypes
import math
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.body_scenes import BEAM, BODIES, BodyScene
from support.component_fmu import (
    KELVIN_VOIGT,
    LOWER,
    VERSIONS,
    simulate,
    stop,
    unpacked,
)
from support.tolerance import ORBIT, PARTITION

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import binary_path, unpack

MODES = [("2.0", False, False), ("3.0", False, False), ("3.0", False, True), ("3.0", True, True)]
"""FMI version, event mode, early return; in FMI 3.0 FMPy needs early returns for events."""
each_body = pytest.mark.parametrize("body", BODIES, ids=str)
each_version = pytest.mark.parametrize("version", VERSIONS)


# ---- FMPy alone ----


@each_body
@pytest.mark.parametrize(("version", "event_mode", "early_return"), MODES)
def test_a_stock_importer_runs_it_alone_at_any_interval(
    body: BodyScene, version: str, event_mode: bool, early_return: bool
) -> None:
    with body.fmu(version=version) as one_step:
        one_step.step(body.end)
        count, last = one_step.contact("count", "last_time")
        end = one_step.get("displacement")
    assert count > 3
    for interval in body.intervals:
        result = simulate(
            body.component,
            body.scene,
            ["displacement", "contact[1].count", "contact[1].last_time"],
            body.end,
            interval,
            version=version,
            use_event_mode=event_mode,
            early_return_allowed=early_return,
        )
        assert result["time"][-1] == pytest.approx(body.end, abs=1e-12)
        assert result["contact[1].count"][-1] == count
        assert abs(result["contact[1].last_time"][-1] - last) <= PARTITION
        assert abs(result["displacement"][-1] - end) <= PARTITION
        # a beam is on its stop only up to rounding, as a sum of its modes
        assert result["displacement"].max() <= body.position * (1.0 + (ORBIT if body is BEAM else 0.0))


@each_body
def test_both_versions_of_fmi_move_alike_bit_for_bit(body: BodyScene) -> None:
    runs = [
        simulate(body.component, body.scene, ["displacement"], body.end, body.intervals[0], version=version)
        for version in VERSIONS
    ]
    assert np.array_equal(runs[0]["displacement"], runs[1]["displacement"])
    ends = []
    for version in VERSIONS:
        second = stop(-body.position, 0.4, side=LOWER, k=2)
        with body.fmu({**body.scene, **second}, version=version) as b:
            for k in range(100):
                b.set(body.load, 0.1 * math.sin(k))
                b.set(body.load.replace("force", "force_rate"), 0.05)
                b.step(body.end / 167.0)
            names = ("count", "last_time", "last_velocity", "last_phase")
            ends.append([*b.state(), *b.contact(*names), *b.contact(*names, k=2)])
    assert ends[0] == ends[1]
    assert min(ends[0][2], ends[0][6]) > 0


@each_body
@each_version
def test_the_defaults_alone_are_a_run(body: BodyScene, version: str) -> None:
    result = simulate(body.component, {}, ["displacement"], 10.0, 1.0, version=version)
    assert np.all(result["displacement"] == 0.0)


@each_body
@each_version
def test_an_instance_that_is_reset_runs_as_a_new_one(body: BodyScene, version: str) -> None:
    with body.fmu(version=version) as b:
        b.step(body.end)
        first = b.state()
        b.fmu.reset()
        b.time = 0.0
        assert {name: b.get(name) for name in body.scene} == {
            name: b.start_values()[name] for name in body.scene
        }
        for name, value in body.scene.items():
            b.set(name, value)
        b.initialize()
        b.step(body.end)
        assert b.state() == first


# ---- bad parameters ----


@each_version
@pytest.mark.parametrize(
    ("body", "name", "value", "rule"), [(body, *bad) for body in BODIES for bad in body.bad], ids=str
)
def test_a_bad_parameter_ends_initialization_with_one_message_that_names_it(
    body: BodyScene, version: str, name: str, value: float, rule: str
) -> None:
    with body.fmu({**body.scene, name: value}, version=version, initialize=False) as b:
        with pytest.raises(FMICallException, match="ExitInitializationMode"):
            b.initialize()
        assert len(b.messages) == 1
        text = b.messages[0]
        assert "ExitInitializationMode" in text
        assert f"{name}: expected" in text
        assert rule in text
        assert f"got {value:g}" in text
        # the instance survives: correct values can be set, and it can be started
        b.set(name, body.scene.get(name, b.start_values()[name]))
        b.fmu.exitInitializationMode()
        b.step(body.end)


@each_body
@each_version
def test_all_bad_parameters_are_told_at_once(body: BodyScene, version: str) -> None:
    last = {"Oscillator": "", "Structure": "contact[32].law"}.get(body.component, "contact[8].law")
    unused = {last: KELVIN_VOIGT} if last else {}
    with body.fmu({**body.scene, **unused, **body.together}, version=version, initialize=False) as b:
        with pytest.raises(FMICallException):
            b.initialize()
        assert len(b.messages) == 1
        assert all(f"{name}: expected" in b.messages[0] for name in body.together)


@each_body
@pytest.mark.parametrize("start", [math.nan, math.inf])
def test_a_start_time_that_is_none_is_refused(body: BodyScene, start: float) -> None:
    with body.fmu(initialize=False) as b:
        with pytest.raises(FMICallException):
            b.initialize(start)
        assert len(b.messages) == 1


# ---- misuse ----


@each_body
@each_version
@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf, -math.inf])
def test_a_bad_step_is_an_error_that_leaves_the_state_as_it_was(
    body: BodyScene, version: str, size: float
) -> None:
    with body.fmu(version=version) as b:
        b.step(body.end)
        before, moving = b.serialized(), b.state()
        with pytest.raises(FMICallException, match="DoStep"):
            b.fmu.doStep(currentCommunicationPoint=body.end, communicationStepSize=size)
        assert "communicationStepSize: expected a finite number > 0" in b.messages[0]
        assert b.serialized() == before
        b.step(1e-300)
        assert b.state() == moving
        b.step(1.0)


@each_body
@each_version
@pytest.mark.parametrize("point", [0.0, 0.99, 1.01, math.nan, -1.0])
def test_a_step_from_another_time_is_an_error_that_leaves_the_state_as_it_was(
    body: BodyScene, version: str, point: float
) -> None:
    with body.fmu(version=version) as b:
        b.step(body.end)
        before = b.serialized()
        with pytest.raises(FMICallException, match="DoStep"):
            b.fmu.doStep(currentCommunicationPoint=point * body.end, communicationStepSize=1.0)
        assert "currentCommunicationPoint" in b.messages[0]
        assert b.serialized() == before


@each_body
@each_version
def test_a_step_past_the_stop_time_is_an_error_and_one_up_to_it_is_none(
    body: BodyScene, version: str
) -> None:
    with body.fmu(version=version, initialize=False) as b:
        if version == "3.0":
            b.fmu.enterInitializationMode(startTime=0.0, stopTime=1.0)
        else:
            b.fmu.setupExperiment(startTime=0.0, stopTime=1.0)
            b.fmu.enterInitializationMode()
        b.fmu.exitInitializationMode()
        b.step(0.9)
        with pytest.raises(Exception, match=r"(?i)dostep"):
            b.step(0.2)
        assert "expected a step that ends by the stop time 1 s, got one from 0.9" in b.messages[-1]
        for _ in range(10):
            b.step(0.01)  # the sum of these steps is above .1, by rounding
        assert b.time >= 1.0


@each_body
@each_version
@pytest.mark.parametrize("stop", [2.0, -math.inf, math.nan])
def test_a_stop_time_before_the_start_time_is_refused(body: BodyScene, version: str, stop: float) -> None:
    with body.fmu(version=version, initialize=False) as b:
        setup = b.fmu.enterInitializationMode if version == "3.0" else b.fmu.setupExperiment
        with pytest.raises(FMICallException):
            setup(startTime=3.0, stopTime=stop)
        assert "expected a stop time that is not before the start time 3 s, got" in b.messages[-1]
        setup(startTime=3.0, stopTime=3.0)  # the instance is unchanged, and a run of length 0 is allowed


@each_body
@each_version
def test_an_input_that_is_not_a_number_is_an_error_until_it_is_one(body: BodyScene, version: str) -> None:
    with body.fmu(version=version) as b:
        b.step(1.0)
        b.set(body.load, math.nan)
        with pytest.raises(FMICallException):
            b.step(1.0)
        assert f"{body.load}: expected a finite number, got nan" in b.messages[-1]
        b.set(body.load, 0.0)
        b.step(1.0)
        with body.fmu(version=version) as twin:
            twin.step(1.0)
            twin.step(1.0)
            assert b.state() == twin.state()


@each_body
@each_version
def test_calls_in_the_wrong_mode_are_errors(body: BodyScene, version: str) -> None:
    with body.fmu(version=version, initialize=False) as b:
        for call in (lambda: b.step(1.0), b.fmu.exitInitializationMode, b.fmu.terminate):
            with pytest.raises(FMICallException):
                call()
        b.initialize()
        before = b.get(body.fixed)
        for call in (
            b.fmu.enterInitializationMode,
            b.fmu.exitInitializationMode,
            lambda: b.set(body.fixed, 2.0),
        ):
            with pytest.raises(FMICallException):
                call()
        assert b.get(body.fixed) == before
        b.fmu.terminate()
        with pytest.raises(FMICallException):
            b.step(1.0)
        assert b.get(body.fixed) == before
        assert len(b.messages) == 7


@each_body
@each_version
def test_wrong_value_references_are_errors(body: BodyScene, version: str) -> None:
    with body.fmu(version=version) as b:
        real, integer, write = (
            (b.fmu.getFloat64, b.fmu.getInt64, b.fmu.setFloat64)
            if version == "3.0"
            else (b.fmu.getReal, b.fmu.getInteger, b.fmu.setReal)
        )
        for call, reference in (
            (real, 1_000_000),
            (real, 2**32 - 1),
            (integer, b.reference(body.fixed)),
            (real, b.reference("contact[1].count")),
            (b.fmu.getBoolean, b.reference(body.fixed)),
        ):
            with pytest.raises(FMICallException):
                call([reference])
        with pytest.raises(FMICallException):
            write([b.reference("displacement")], [1.0])
        assert len(b.messages) == 6


@each_body
def test_too_few_and_too_many_values_are_errors_in_fmi_3(body: BodyScene) -> None:
    with body.fmu() as b:
        rows, fixed = b.reference("record.rows"), b.reference(body.fixed)
        for references, count in (
            ([rows], 8),
            ([rows], 512 * 8 + 1),
            ([fixed], 0),
            ([fixed], 2),
            ([fixed, rows], 4096),
        ):
            with pytest.raises(FMICallException):
                b.fmu.getFloat64(references, nValues=count)
        assert len(b.fmu.getFloat64([fixed, rows], nValues=4097)) == 4097
        assert b.fmu.getFloat64([]) == []


@each_body
@each_version
def test_a_wrong_token_or_guid_makes_no_instance(body: BodyScene, version: str) -> None:
    folder, description = unpacked(fmu_path(body.component, version))
    token = description.guid if version == "2.0" else description.instantiationToken
    assert token.startswith("{")
    with body.fmu(version=version, initialize=False) as b:
        wrong = type(b.fmu)(
            guid="{00000000-0000-0000-0000-000000000000}",
            unzipDirectory=str(folder),
            modelIdentifier=body.component,
            instanceName="wrong",
        )
    with pytest.raises(Exception, match="Failed to instantiate"):
        wrong.instantiate()


def library(body: BodyScene) -> str:
    return str(binary_path(unpack(fmu_path(body.component, "3.0"))))


@each_body
def test_every_function_of_both_standards_resolves(body: BodyScene) -> None:
    headers = Path(fmpy.__file__).parent / "c-code"
    names = set()
    for header, prefix in (("fmi2FunctionTypes.h", "fmi2"), ("fmi3FunctionTypes.h", "fmi3")):
        text = "".join(c if c.isalnum() else " " for c in (headers / header).read_text())
        names |= {w[: -len("TYPE")] for w in text.split() if w.startswith(prefix) and w.endswith("TYPE")}
    functions = {name for name in names if not name.endswith(("Callback", "CallbackFunctions"))}
    assert len(functions) > 80
    loaded = ctypes.CDLL(library(body))
    assert [name for name in sorted(functions) if not hasattr(loaded, name)] == []


NULLS = """
import ctypes, sys
library = ctypes.CDLL(sys.argv[1])
names = sys.argv[2].split(",")
zero, empty = ctypes.c_void_p(), ctypes.c_double(0.0)
library.fmi3FreeInstance(zero); library.fmi2FreeInstance(zero)
for name in names:
    function = getattr(library, name)
    function.restype = ctypes.c_int
    if name.endswith("DoStep"):
        status = function(zero, empty, empty, 1, zero, zero, zero, zero)
    else:
        status = function(*[zero] * 12)
    assert status != 0, (name, status)
print("survived")
"""
CALLS = ("Terminate", "Reset", "EnterInitializationMode", "ExitInitializationMode", "DoStep")
CALLS2 = ("GetReal", "SetReal", "GetFMUstate", "SetFMUstate", "SerializeFMUstate", "SetupExperiment")
CALLS3 = ("GetFloat64", "SetFloat64", "GetFMUState", "SetFMUState", "UpdateDiscreteStates")


@each_body
def test_null_instances_and_null_pointers_do_not_crash_the_host(body: BodyScene) -> None:
    names = [*(f"fmi2{name}" for name in CALLS + CALLS2), *(f"fmi3{name}" for name in CALLS + CALLS3)]
    command = [sys.executable, "-c", NULLS, library(body), ",".join(names)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.stdout.strip() == "survived", result.stderr


@each_body
def test_reaching_the_impact_limit_is_said_and_not_a_hang(body: BodyScene) -> None:
    with body.fmu({**body.scene, "impact_limit": 10}) as b:
        with pytest.raises(FMICallException, match="discard"):
            b.step(1e5)
        assert b.contact("count") == [10]
    with body.fmu({**body.scene, "impact_limit": 10}, version="2.0") as b:
        with pytest.raises(FMICallException, match="error"):
            b.step(1e5)
        assert "impact_limit" in b.messages[-1]
