"""The Oscillator FMU in any tool: FMPy alone, misuse, bad parameters, events, saved states."""

import ctypes
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.oscillator_fmu import EXTERNAL, LOWER, VERSIONS, OscillatorFmu, forced, simulate, stop, unpacked
from support.tolerance import ORBIT, PARTITION, ROUNDING

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import binary_path, unpack

SCENE = {**forced(), **stop(1.0)}
MODES = [("2.0", False, False)] + [
    ("3.0", event, early) for event in (False, True) for early in (False, True)
]


@pytest.mark.parametrize(("version", "event_mode", "early_return"), MODES)
@pytest.mark.parametrize("interval", [0.01, 0.1, 1.0, 62.0])
def test_a_stock_importer_runs_it_alone_at_any_interval(
    version: str, event_mode: bool, early_return: bool, interval: float
) -> None:
    if event_mode and not early_return:
        early_return = True  # FMI 3.0: FMPy needs both for events
    result = simulate(
        SCENE,
        ["displacement", "contact[1].count", "contact[1].last_time"],
        62.0,
        interval,
        version=version,
        use_event_mode=event_mode,
        early_return_allowed=early_return,
    )
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(62.0)
        count, last = o.contact("count", "last_time")
        end = o.get("displacement")
    assert result["time"][-1] == pytest.approx(62.0, abs=1e-12)
    assert result["contact[1].count"][-1] == count
    assert abs(result["contact[1].last_time"][-1] - last) <= PARTITION
    assert abs(result["displacement"][-1] - end) <= PARTITION
    assert result["displacement"].max() <= 1.0


@pytest.mark.parametrize("version", VERSIONS)
def test_the_defaults_alone_are_a_run(version: str) -> None:
    result = simulate({}, ["displacement"], 10.0, 1.0, version=version)
    assert np.all(result["displacement"] == 0.0)


@pytest.mark.parametrize("version", VERSIONS)
def test_an_instance_that_is_reset_runs_as_a_new_one(version: str) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(50.0)
        first = o.state()
        o.fmu.reset()
        o.time = 0.0
        assert o.get("damping") == 0.0
        for name, value in SCENE.items():
            o.set(name, value)
        o.initialize()
        o.step(50.0)
        assert o.state() == first


BAD = [
    ("mass", 0.0, "> 0"),
    ("mass", -1.0, "> 0"),
    ("mass", math.nan, "> 0"),
    ("mass", math.inf, "> 0"),
    ("damping", -0.1, ">= 0"),
    ("damping", math.nan, ">= 0"),
    ("stiffness", -1.0, ">= 0"),
    ("stiffness", math.inf, ">= 0"),
    ("forcing.amplitude", math.nan, "finite"),
    ("forcing.angular_frequency", -1.0, ">= 0"),
    ("forcing.phase", math.inf, "finite"),
    ("displacement_start", math.nan, "finite"),
    ("velocity_start", -math.inf, "finite"),
    ("contact[1].restitution", 1.2, "0 <= r <= 1"),
    ("contact[1].restitution", -0.1, "0 <= r <= 1"),
    ("contact[1].restitution", math.nan, "0 <= r <= 1"),
    ("contact[1].position", math.nan, "finite"),
    ("contact[1].law", 7, "1 (restitution)"),
    ("contact[1].side", 3, "1 (upper)"),
    ("displacement_start", 1.5, "free side of contact[1]"),
    ("force", math.nan, "finite"),
    ("impact_limit", -1, ">= 0"),
]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("name", "value", "rule"), BAD)
def test_a_bad_parameter_ends_initialization_with_one_message_that_names_it(
    version: str, name: str, value: float, rule: str
) -> None:
    with OscillatorFmu({**SCENE, name: value}, version=version, initialize=False) as o:
        with pytest.raises(FMICallException, match="ExitInitializationMode"):
            o.initialize()
        assert len(o.messages) == 1
        text = o.messages[0]
        assert "ExitInitializationMode" in text
        assert f"{name}: expected" in text
        assert rule in text
        assert f"{value:g}" in text
        # it is not lost: it can be set right, and started
        o.set(name, {**SCENE, "mass": 1.0, "stiffness": 1.0, "contact[1].side": 1}.get(name, 0))
        o.fmu.exitInitializationMode()
        o.step(1.0)


@pytest.mark.parametrize("version", VERSIONS)
def test_all_bad_parameters_are_told_at_once(version: str) -> None:
    bad = {"mass": -1.0, "damping": -2.0, "contact[1].restitution": 3.0}
    with OscillatorFmu({**SCENE, **bad}, version=version, initialize=False) as o:
        with pytest.raises(FMICallException):
            o.initialize()
        assert len(o.messages) == 1
        assert all(f"{name}: expected" in o.messages[0] for name in bad)


def test_stops_without_room_between_them_and_a_start_time_that_is_none_are_refused() -> None:
    crossed = {**SCENE, **stop(2.0, side=LOWER, k=2), "displacement_start": 1.0}
    for parameters, start in ((crossed, 0.0), (SCENE, math.nan), (SCENE, math.inf)):
        with OscillatorFmu(parameters, initialize=False) as o:
            with pytest.raises(FMICallException):
                o.initialize(start)
            assert len(o.messages) == 1


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf, -math.inf])
def test_a_bad_step_is_an_error_that_leaves_the_state_as_it_was(version: str, size: float) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(7.0)
        before = o.serialized()
        with pytest.raises(FMICallException, match="DoStep"):
            o.fmu.doStep(currentCommunicationPoint=7.0, communicationStepSize=size)
        assert "communicationStepSize" in o.messages[0]
        assert o.serialized() == before
        o.step(1.0)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("point", [0.0, 6.9, 7.1, math.nan, -7.0])
def test_a_step_from_another_time_is_an_error_that_leaves_the_state_as_it_was(
    version: str, point: float
) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(7.0)
        before = o.serialized()
        with pytest.raises(FMICallException, match="DoStep"):
            o.fmu.doStep(currentCommunicationPoint=point, communicationStepSize=1.0)
        assert "currentCommunicationPoint" in o.messages[0]
        assert o.serialized() == before


@pytest.mark.parametrize("version", VERSIONS)
def test_an_input_that_is_not_a_number_is_an_error_until_it_is_one(version: str) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(1.0)
        o.set("force", math.nan)
        with pytest.raises(FMICallException):
            o.step(1.0)
        assert "force: expected a finite number, got nan" in o.messages[-1]
        o.set("force", 0.0)
        o.step(1.0)
        with OscillatorFmu(SCENE, version=version) as twin:
            twin.step(1.0)
            twin.step(1.0)
            assert o.state() == twin.state()


@pytest.mark.parametrize("version", VERSIONS)
def test_calls_in_the_wrong_mode_are_errors(version: str) -> None:
    with OscillatorFmu(SCENE, version=version, initialize=False) as o:
        for call in (
            lambda: o.step(1.0),
            o.fmu.exitInitializationMode,
            o.fmu.terminate,
        ):
            with pytest.raises(FMICallException):
                call()
        o.initialize()
        for call in (o.fmu.enterInitializationMode, o.fmu.exitInitializationMode, lambda: o.set("mass", 2.0)):
            with pytest.raises(FMICallException):
                call()
        assert o.get("mass") == 1.0
        o.fmu.terminate()
        with pytest.raises(FMICallException):
            o.step(1.0)
        assert o.get("mass") == 1.0
        assert len(o.messages) == 7


@pytest.mark.parametrize("version", VERSIONS)
def test_wrong_value_references_are_errors(version: str) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        real, integer = (
            (o.fmu.getFloat64, o.fmu.getInt64) if version == "3.0" else (o.fmu.getReal, o.fmu.getInteger)
        )
        for call, reference in (
            (real, 10_000),
            (real, 2**32 - 1),
            (integer, o.reference("mass")),
            (real, o.reference("contact[1].count")),
            (o.fmu.getBoolean, o.reference("mass")),
        ):
            with pytest.raises(FMICallException):
                call([reference])
        write = o.fmu.setFloat64 if version == "3.0" else o.fmu.setReal
        with pytest.raises(FMICallException):
            write([o.reference("displacement")], [1.0])
        assert len(o.messages) == 6


def test_too_few_and_too_many_values_are_errors_in_fmi_3() -> None:
    with OscillatorFmu(SCENE) as o:
        rows, mass = o.reference("record.rows"), o.reference("mass")
        for references, count in (
            ([rows], 8),
            ([rows], 512 * 8 + 1),
            ([mass], 0),
            ([mass], 2),
            ([mass, rows], 4096),
        ):
            with pytest.raises(FMICallException):
                o.fmu.getFloat64(references, nValues=count)
        assert len(o.fmu.getFloat64([mass, rows], nValues=4097)) == 4097
        assert o.fmu.getFloat64([]) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_a_foreign_or_damaged_state_is_refused_and_changes_nothing(version: str) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(20.0)
        good = o.serialized()
        chance = np.random.default_rng(1)
        damaged = [b"", b"x", good[:-1], good + b"\0", good[:40], bytes(len(good)), chance.bytes(len(good))]
        for position in range(len(good)):
            damaged.append(good[:position] + bytes([good[position] ^ 0x40]) + good[position + 1 :])
        for data in damaged:
            with pytest.raises(FMICallException):
                o.restore(data)
            assert o.serialized() == good
        o.restore(good)
        o.step(1.0)


def test_a_wrong_token_or_guid_makes_no_instance() -> None:
    for version, attribute in (("3.0", "instantiationToken"), ("2.0", "guid")):
        folder, description = unpacked(version)
        assert getattr(description, attribute).startswith("{")
        slave = OscillatorFmu(version=version, initialize=False).fmu
        wrong = type(slave)(
            guid="{00000000-0000-0000-0000-000000000000}",
            unzipDirectory=str(folder),
            modelIdentifier="Oscillator",
            instanceName="wrong",
        )
        with pytest.raises(Exception, match="Failed to instantiate"):
            wrong.instantiate()


def test_every_function_of_both_standards_resolves() -> None:
    library = ctypes.CDLL(str(binary_path(unpack(fmu_path("Oscillator", "3.0")))))
    headers = Path(fmpy.__file__).parent / "c-code"
    names = set()
    for header, prefix in (("fmi2FunctionTypes.h", "fmi2"), ("fmi3FunctionTypes.h", "fmi3")):
        text = (headers / header).read_text()
        names |= {
            word[: -len("TYPE")] for word in _words(text) if word.startswith(prefix) and word.endswith("TYPE")
        }
    functions = {name for name in names if not name.endswith(("Callback", "CallbackFunctions"))}
    assert len(functions) > 80
    assert [name for name in sorted(functions) if not hasattr(library, name)] == []


def _words(text: str) -> set[str]:
    return set("".join(c if c.isalnum() else " " for c in text).split())


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


def test_null_instances_and_null_pointers_do_not_crash_the_host() -> None:
    path = binary_path(unpack(fmu_path("Oscillator", "3.0")))
    names = [
        f"fmi{v}{name}"
        for v in "23"
        for name in (
            ("Terminate", "Reset", "EnterInitializationMode", "ExitInitializationMode", "DoStep")
            + (("GetReal", "SetReal", "GetFMUstate", "SetFMUstate", "SerializeFMUstate", "SetupExperiment")
               if v == "2" else ("GetFloat64", "SetFloat64", "GetFMUState", "SetFMUState", "UpdateDiscreteStates"))
        )
    ]  # fmt: skip
    code = NULLS
    command = [sys.executable, "-c", code, str(path), ",".join(names)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.stdout.strip() == "survived", result.stderr


# ---- the external law: an importer that answers ----

COUPLED = {**forced(), **stop(1.0, 0.7, law=EXTERNAL)}


@pytest.mark.parametrize("early_return", [False, True])
def test_an_external_law_without_event_mode_is_refused_with_what_to_do(early_return: bool) -> None:
    with OscillatorFmu(COUPLED, early_return=early_return, initialize=False) as o:
        with pytest.raises(FMICallException):
            o.initialize()
        assert len(o.messages) == 1
        assert "external" in o.messages[0]
        assert "event mode" in o.messages[0]
        assert "restitution (1)" in o.messages[0]


def test_an_answered_external_law_is_the_restitution_law() -> None:
    with OscillatorFmu(COUPLED, event_mode=True) as o, OscillatorFmu(SCENE) as fused:
        for _ in range(60):
            o.needs_event = False
            o.advance_to_event()
            assert o.get("contact[1].event_time") == pytest.approx(o.time, abs=0.0)
            o.answer(0.7)
            fused.step(o.time + 1e-9 - fused.time)
            assert abs(fused.get("contact[1].last_time") - o.get("contact[1].last_time")) <= PARTITION
            assert abs(fused.get("contact[1].last_velocity") - o.get("contact[1].last_velocity")) <= PARTITION
        assert abs(o.get("contact[1].last_phase") - 0.3665212101960540571) <= ORBIT


def test_an_answered_external_law_chatters_sticks_and_is_released() -> None:
    parameters = {**forced(1.0, 0.2, 0.05, displacement_start=-0.1), **stop(0.0, 0.7, law=EXTERNAL)}
    with OscillatorFmu(parameters, event_mode=True) as o:
        events = 0
        while o.time < 20.0:
            o.step(20.0 - o.time)
            if o.needs_event:
                o.fmu.enterEventMode()
                o.answer(0.7)
                events += 1
                assert events < 200
        assert abs(o.get("contact[1].stick_start") - 2.50982609171411) <= 1e-12
        assert abs(o.get("contact[1].stick_end") - 7.853981633974483) <= 1e-12


def test_an_answer_that_never_came_is_an_error_not_a_hang() -> None:
    with OscillatorFmu(COUPLED, event_mode=True) as o:
        o.advance_to_event()
        with pytest.raises(FMICallException):
            o.fmu.updateDiscreteStates()
        assert "contact[1].applied_restitution: expected an answer" in o.messages[-1]
        o.fmu.enterStepMode()
        with pytest.raises(FMICallException):
            o.step(1.0)
    with pytest.raises(FMICallException):
        simulate(COUPLED, ["displacement"], 60.0, 0.5, use_event_mode=True, early_return_allowed=True)


@pytest.mark.parametrize("answer", [-0.1, 1.1, math.nan])
def test_an_answer_that_is_no_restitution_is_an_error(answer: float) -> None:
    with OscillatorFmu(COUPLED, event_mode=True) as o:
        o.advance_to_event()
        o.set("contact[1].applied_restitution", answer)
        with pytest.raises(FMICallException):
            o.fmu.updateDiscreteStates()


def test_in_fmi_2_a_contact_is_announced_stepped_back_to_and_answered() -> None:
    with OscillatorFmu(COUPLED, version="2.0") as o, OscillatorFmu(SCENE) as fused:
        for _ in range(30):
            while True:
                saved, before = o.serialized(), o.time
                o.step(0.5)
                event = o.get("contact[1].event_time")
                if not math.isnan(event):
                    break
            with pytest.raises(FMICallException):
                o.step(0.5)  # it has passed through the stop: only back is right
            o.restore(saved)
            o.time = before
            if event > before:
                o.step(event - before)
            assert o.get("displacement") == 1.0
            o.set("contact[1].applied_restitution", 0.7)
        fused.step(o.time - 0.5)
        assert abs(fused.get("contact[1].last_time") - o.get("contact[1].last_time")) <= PARTITION
        assert abs(fused.get("contact[1].last_velocity") - o.get("contact[1].last_velocity")) <= PARTITION


def test_reaching_the_impact_limit_is_said_and_not_a_hang() -> None:
    limited: dict[str, Any] = {**SCENE, "impact_limit": 10}
    with OscillatorFmu(limited) as o:
        with pytest.raises(FMICallException, match="discard"):
            o.step(1e5)
        assert o.contact("count") == [10]
    with OscillatorFmu(limited, version="2.0") as o:
        with pytest.raises(FMICallException, match="error"):
            o.step(1e5)
        assert "impact_limit" in o.messages[-1]


def test_both_versions_do_the_same_bit_for_bit() -> None:
    ends = []
    for version in VERSIONS:
        with OscillatorFmu({**forced(0.9, 0.8, 0.02), **stop(0.3, 0.9)}, version=version) as o:
            for _ in range(100):
                o.step(0.37)
            ends.append((*o.state(), *o.contact("count", "last_time", "last_velocity", "last_phase")))
    assert ends[0] == ends[1]


def test_the_outputs_follow_an_input_set_between_steps() -> None:
    with OscillatorFmu({"displacement_start": 0.5}) as o:
        assert o.get("acceleration") == -0.5
        o.set("force", 2.0)
        assert o.get("acceleration") == 1.5
        o.set("base_acceleration", 1.0)
        # absolute: the relative one is 2 - .5 - 1
        assert abs(o.get("acceleration") - 1.5) <= ROUNDING


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_past_the_stop_time_is_an_error_and_one_up_to_it_is_none(version: str) -> None:
    with OscillatorFmu({"displacement_start": 1.0}, version=version, initialize=False) as fmu:
        if version == "3.0":
            fmu.fmu.enterInitializationMode(startTime=0.0, stopTime=1.0)
        else:
            fmu.fmu.setupExperiment(startTime=0.0, stopTime=1.0)
            fmu.fmu.enterInitializationMode()
        fmu.fmu.exitInitializationMode()
        fmu.step(0.9)
        with pytest.raises(Exception, match=r"(?i)dostep"):
            fmu.step(0.2)
        assert "expected a step that ends by the stop time 1 s, got one from 0.9" in fmu.messages[-1]
        for _ in range(10):
            fmu.step(0.01)  # their sum is above .1, by rounding
        assert fmu.time >= 1.0
