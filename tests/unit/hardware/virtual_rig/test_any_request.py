"""Any request of NI's protocol gets an answer or an error of NI's: no field stops or blocks the server."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import event, example, given
from support.places import ROOT
from support.rig_bench import Bench, opened_bench

from vibroimpact.hardware.daqmx import METHODS, constants, grpc, message_class
from vibroimpact.hardware.virtual_rig.calls import Calls
from vibroimpact.hardware.virtual_rig.serving import THREADS

DEADLINE = 10.0
"""Maximum time of a request, s; far more than any takes."""
CALLS = 25
"""Maximum time of one example, s."""
ANSWERED = [name for name in METHODS if Calls(None).answer(name) is not None]  # type: ignore[arg-type]  # no call is made
ANSWERED += ["RegisterEveryNSamplesEvent", "RegisterDoneEvent"]
RUNNING = (
    "CfgSampClkTiming",
    "StartTask",
    "StopTask",
    "TaskControl",
    "Read",
    "Write",
    "SetTiming",
    "SetBuffer",
)
OFTEN = [name for name in ANSWERED if name.startswith(RUNNING)]
"""Calls without which time stands still."""
ENDS = ("ClearTask", "ResetDevice", "CreateTask")
TASKS = ["in"] * 6 + ["out"] * 5 + ["none", ""]
TEXTS = [
    *("Dev1", "Dev1/ai0", "Dev1/ai0:3", "Dev1/ai0, Dev1/ai5", "Dev1/ao1", "Dev1/_ao0_vs_aognd", "/Dev1/PFI0"),
    *(
        "PFI3",
        "/Dev1/ao/SampleClock",
        "/Dev1/ai/StartTrigger",
        "Dev2/ai0",
        "a0:999999999",
        "x:1",
        "ai0:",
        "",
        ",",
    ),
    *("tip", "Dev1/ai0:a3", "\x00", "Dev1/ai\u0663", "q" * 5000),
]
NUMBERS = [0, 1, 2, 3, 100, 1000, 10_000, 2**15, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1, -1, -2, -(2**31)]
REALS = [0.0, -0.0, 0.01, 0.5, 1.0, -1.0, 5.0, 10.0, -10.0, 1000.0, 1e6, 1e-300, 1e300, -5.0]
REALS += [float("nan"), float("inf")]
ATTRIBUTES = [
    0x1344,
    0x1300,
    0x1310,
    0x1852,
    0x1347,
    0x1393,
    0x1407,
    0x190A,
    0x190B,
    0x1211,
    0x1453,
    0x186C,
    0x186D,
]
ATTRIBUTES += [
    0x1815,
    0x17DD,
    0x1097,
    0x182E,
    0x1223,
    0x31E8,
    0x193B,
    0x2990,
    0x0631,
    0x2342,
    0x1273,
    0x7FFF,
    0,
]
MODES = [10178, 10123, 10280, 10171, 10424, 10428, 10252, 10348, 10388, 10106, 10083, 4, 0, 1, 2, -1, 12345]


def _value(field: Any, dice: random.Random) -> Any:
    if field.name == "name":
        return dice.choice(TASKS)
    if field.name.startswith("attribute"):
        return dice.choice(ATTRIBUTES)
    if field.cpp_type == field.CPPTYPE_STRING:
        text = dice.choice(TEXTS)
        return text.encode() if field.type == field.TYPE_BYTES else text
    if field.cpp_type in (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT):
        return dice.choice([*REALS, dice.uniform(-12.0, 12.0)])
    if field.cpp_type == field.CPPTYPE_BOOL:
        return dice.random() < 0.5
    signed = field.cpp_type in (field.CPPTYPE_INT32, field.CPPTYPE_INT64, field.CPPTYPE_ENUM)
    bits = 64 if field.cpp_type in (field.CPPTYPE_INT64, field.CPPTYPE_UINT64) else 32
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
    chosen = dice.choice(MODES if "raw" in field.name or field.enum_type else NUMBERS)
    return chosen if low <= chosen < high else 1


def filled(message: Any, dice: random.Random, depth: int = 0) -> Any:
    """Return a message with random values in most of its fields."""
    for field in message.DESCRIPTOR.fields:
        inside = field.cpp_type == field.CPPTYPE_MESSAGE
        listed = field.is_repeated if hasattr(field, "is_repeated") else field.label == field.LABEL_REPEATED
        if field.containing_oneof and field.name != "name" and not field.name.endswith("_raw"):
            continue  # one of several fields with the same meaning
        if inside and (depth > 2 or field.message_type.GetOptions().map_entry):
            continue
        if field.name not in ("task", "name", "attribute_raw") and dice.random() < 0.1:
            continue
        if inside and listed:
            for _ in range(dice.randint(0, 2)):
                filled(getattr(message, field.name).add(), dice, depth + 1)
        elif inside:
            filled(getattr(message, field.name), dice, depth + 1)
        elif listed:
            getattr(message, field.name).extend(
                _value(field, dice) for _ in range(dice.choice([0, 1, 2, 6, 100]))
            )
        else:
            setattr(message, field.name, _value(field, dice))
    return message


def drawn(dice: random.Random) -> tuple[str, Any]:
    """Return a method and a request; many writes get as many values as they declare."""
    name = dice.choice(dice.choice([ANSWERED, OFTEN]))
    if name in ENDS and dice.random() < 0.9:
        name = "StartTask"
    request = filled(message_class(METHODS[name].input_type)(), dice)
    if hasattr(request, "write_array") and hasattr(request, "num_samps_per_chan") and dice.random() < 0.7:
        request.num_samps_per_chan = len(request.write_array)
        request.task.name = "out"
    return name, request


def may_wait(request: Any) -> bool:
    """Return whether a request may wait for longer than a second."""
    timeouts = [getattr(request, field) for field in ("timeout", "time_to_wait") if hasattr(request, field)]
    return any(timeout == -1.0 or timeout > 1.0 for timeout in timeouts)


def asked(name: str, **fields: Any) -> Any:
    """Return a request; `task` is given by its name."""
    request = message_class(METHODS[name].input_type)()
    for key, value in fields.items():
        setattr(request.task if key == "task" else request, "name" if key == "task" else key, value)
    return request


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml") as opened:
        yield opened


def outcome_of(bench: Bench, name: str, request: Any) -> tuple[Any, int]:
    """Return the outcome of a call: gRPC's code and NI's."""
    streams = METHODS[name].server_streaming
    kind = bench.channel.unary_stream if streams else bench.channel.unary_unary
    call = kind(f"/nidaqmx_grpc.NiDAQmx/{name}")
    try:
        answer = call(request.SerializeToString(), timeout=DEADLINE)
        if streams:
            answer.initial_metadata()
            answer.cancel()
    except grpc.RpcError as error:
        said = dict(error.trailing_metadata() or ())
        return error.code(), int(said.get("ni-error", 0))
    return grpc.StatusCode.OK, 0


def prepare(bench: Bench, timed: bool) -> None:
    """Make an input task and an output task, with or without clocks."""
    bench.clear()
    wide = {"min_val": -5.0, "max_val": 5.0, "units_raw": constants.VoltageUnits.VOLTS.value}
    anyhow = {"terminal_config_raw": constants.TerminalConfiguration.DEFAULT.value}
    clock = {"rate": 1000.0, "samps_per_chan": 100, "sample_mode_raw": constants.AcquisitionType.FINITE.value}
    setup = [
        *(("CreateTask", {"session_name": name}) for name in ("in", "out")),
        ("CreateAIVoltageChan", {"task": "in", "physical_channel": "Dev1/ai0:2", **wide, **anyhow}),
        ("CreateAOVoltageChan", {"task": "out", "physical_channel": "Dev1/ao0", **wide}),
        *(("CfgSampClkTiming", {"task": name, **clock}) for name in ("in", "out") if timed),
    ]
    for name, fields in setup:
        assert outcome_of(bench, name, asked(name, **fields)) == (grpc.StatusCode.OK, 0)


@given(st.integers(0, 2**32), st.booleans())
@example(3, True)
def test_any_request_is_answered_or_refused_with_a_code_of_nis(rig: Bench, seed: int, timed: bool) -> None:
    dice = random.Random(seed)
    prepare(rig, timed)
    for _ in range(CALLS):
        name, request = drawn(dice)
        if may_wait(request):
            continue
        code, error = outcome_of(rig, name, request)
        event(f"{name}: {error}")
        assert (code, error) == (grpc.StatusCode.OK, 0) or (code is grpc.StatusCode.UNKNOWN and error < 0), (
            f"{name}: {code}: {request}"
        )
    rig.clear()


def test_calls_whose_programs_are_gone_hold_no_thread(rig: Bench) -> None:
    rig.clear()
    with rig.inputs("Dev1/ai0", 1000.0) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
        task.start()
        request = asked("WaitUntilTaskDone", task=task.name, time_to_wait=-1.0)
        call = rig.channel.unary_unary("/nidaqmx_grpc.NiDAQmx/WaitUntilTaskDone")
        # more than the server has threads; each is being answered or waits for a thread when its program gives up
        waiting = [call.future(request.SerializeToString(), timeout=0.3) for _ in range(THREADS + 10)]
        assert {each.code() for each in waiting} == {grpc.StatusCode.DEADLINE_EXCEEDED}
        assert outcome_of(rig, "IsTaskDone", asked("IsTaskDone", task=task.name)) == (grpc.StatusCode.OK, 0)
        task.stop()
