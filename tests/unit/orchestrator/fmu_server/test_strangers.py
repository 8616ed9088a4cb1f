"""Strangers, and importers that send nonsense: each is refused, and the server goes on."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.served_fmus import HERE, TOKEN

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmu_server import server as serving
from vibroimpact.orchestrator.fmu_server.calls import ServedInstance
from vibroimpact.orchestrator.fmu_server.server import Server
from vibroimpact.orchestrator.remote.address import Address
from vibroimpact.orchestrator.remote.channel import grpc
from vibroimpact.orchestrator.remote.protocol import (
    DESCRIBE,
    HASH_KEY,
    MOST_VALUES,
    PROTOCOL,
    PROTOCOL_KEY,
    RUN,
    TOKEN_KEY,
    Answer,
    Batch,
    Call,
    Description,
)

BEGIN = Call(function="Instantiate", texts=["x"], numbers=[1, 1, 0])
KNOWN = ((TOKEN_KEY, f"Bearer {TOKEN}"), (PROTOCOL_KEY, PROTOCOL))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    found = Server(fmu_path("ImpactStop"), HERE, TOKEN)
    yield found
    found.close()


@pytest.fixture(scope="module")
def channel(server: Server) -> Iterator[Any]:
    with grpc.insecure_channel(str(server.address)) as found:
        yield found


def described(channel: Any, metadata: Iterable[tuple[str, str]]) -> Any:
    return Description.FromString(channel.unary_unary(DESCRIBE)(b"", metadata=tuple(metadata), timeout=20))


def answers(channel: Any, *messages: bytes, metadata: Iterable[tuple[str, str]] = KNOWN) -> list[Any]:
    stream = channel.stream_stream(RUN)(iter(messages), metadata=tuple(metadata), timeout=60)
    return [Answer.FromString(answer) for answer in stream]


def refused(channel: Any, metadata: Iterable[tuple[str, str]], code: str, text: str) -> None:
    for call in (described, lambda *each: answers(each[0], b"", metadata=each[1])):
        with pytest.raises(grpc.RpcError) as refusal:
            call(channel, metadata)
        error: Any = refusal.value
        assert error.code().name == code
        assert text in error.details()


def test_a_call_without_the_token_meets_a_refusal_alone(server: Server, channel: Any) -> None:
    text = "expected the token of this server, got none or another."
    for token in ((), ((TOKEN_KEY, "Bearer "),), ((TOKEN_KEY, f"Bearer {TOKEN}x"),), ((TOKEN_KEY, TOKEN),)):
        refused(channel, (*token, KNOWN[1]), "UNAUTHENTICATED", text)
    assert server.instances == 0
    assert described(channel, KNOWN).name == "ImpactStop.fmu"


def test_another_version_and_another_fmu_are_named(server: Server, channel: Any) -> None:
    refused(channel, (KNOWN[0], (PROTOCOL_KEY, "9")), "FAILED_PRECONDITION", "version '1' of the messages")
    refused(
        channel,
        (*KNOWN, (HASH_KEY, "ab" * 32)),
        "FAILED_PRECONDITION",
        f"{'ab' * 32}, got ImpactStop.fmu with",
    )


def test_an_unknown_method_is_none_of_the_server(channel: Any) -> None:
    for method in ("/vibroimpact.Fmu/Shell", "/vibroimpact.Fmu/../../etc/passwd"):
        with pytest.raises(grpc.RpcError) as refusal:
            channel.unary_unary(method)(b"", metadata=KNOWN, timeout=20)
        error: Any = refusal.value
        assert error.code().name in ("UNIMPLEMENTED", "INVALID_ARGUMENT")


def test_bytes_that_are_no_message_end_their_stream(server: Server, channel: Any) -> None:
    (answer,) = answers(channel, b"\xff" * 40, b"never read")
    assert answer.refusal == "expected a batch of calls, got bytes that are no message."
    assert described(channel, KNOWN).sha256 == server.fmu.sha256


def test_a_message_above_the_limit_is_refused_unread(server: Server, channel: Any) -> None:
    with pytest.raises(grpc.RpcError) as refusal:
        answers(channel, bytes(8 * 2**20))
    error: Any = refusal.value
    assert error.code().name == "RESOURCE_EXHAUSTED"


def test_instances_are_bounded_and_idle_ones_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "MOST_INSTANCES", 1)
    server = Server(fmu_path("ImpactStop"), HERE, TOKEN, idle=1.0)

    def waiting() -> Iterator[bytes]:
        yield Batch(calls=[BEGIN]).SerializeToString()
        time.sleep(20.0)

    try:
        with grpc.insecure_channel(str(server.address)) as own:
            stream = own.stream_stream(RUN)(waiting(), metadata=KNOWN)
            assert not Answer.FromString(next(stream)).refusal
            with pytest.raises(grpc.RpcError) as refusal:
                answers(own, b"")
            error: Any = refusal.value
            assert "expected at most 1 instances at a time" in error.details()
            with pytest.raises(grpc.RpcError):
                next(stream)
        end = time.monotonic() + 10.0
        while server.instances and time.monotonic() < end:
            time.sleep(0.01)
        assert server.instances == 0
    finally:
        server.close()


# ---- calls ----


def instance() -> ServedInstance:
    def unchanged(name: str, function: Function) -> Function:
        return function

    return ServedInstance(unpack(fmu_path("ImpactStop")), LogTail(), unchanged)


def refusal_of(*calls: Any) -> str:
    answer, goes_on = instance().answer(Batch(calls=calls).SerializeToString())
    assert not goes_on
    return str(Answer.FromString(answer).refusal)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (Call(function="../../../etc/passwd"), "expected a function of FMI that an importer calls"),
        (Call(function="FreeInstance"), "expected a function of FMI that an importer calls"),
        (Call(function="GetUnknown"), "expected a function of FMI that an importer calls"),
        (Call(function="SerializeFMUState"), "expected a function of FMI that an importer calls"),
        (BEGIN, "expected Instantiate once"),
        (Call(function="SetFMUState", slot=3), "expected a saved state, got number 3"),
        (Call(function="FreeFMUState"), "expected a saved state, got number 0"),
        (
            Call(function="SetFloat64", references=[1], size=1, values=b"123"),
            "expected 1 values, got 3 bytes",
        ),
        (Call(function="GetFloat64", references=[1], size=MOST_VALUES + 1), "values in all, got more"),
        (Call(function="DoStep", numbers=[0.0]), "expected 3 numbers, got others"),
        (Call(function="DoStep", numbers=[0.0, 1.0, math.nan]), "expected 3 numbers, got others"),
        (Call(function="SetString", references=[1, 2], size=2, texts=["a"]), "expected 2 texts, got 1"),
        (Call(function="GetShiftDecimal"), "expected one clock, got 0"),
        (Call(function="GetDirectionalDerivative", references=[1], size=1), "expected one known variable"),
    ],
    ids=lambda each: each.function if isinstance(each, Call) else "",
)
def test_a_call_that_no_importer_makes_is_refused(call: Any, text: str) -> None:
    assert text in refusal_of(BEGIN, call)


def test_no_call_is_made_before_an_instance(server: Server) -> None:
    assert "expected Instantiate once, before all other calls" in refusal_of(Call(function="Terminate"))
    assert "expected a name and three flags" in refusal_of(Call(function="Instantiate"))
    assert "expected 1 to 4096 calls" in refusal_of()
    assert "expected 1 to 4096 calls" in refusal_of(*[BEGIN] * 4097)


@given(st.binary(max_size=200))
@settings(max_examples=50, deadline=None)
def test_no_bytes_are_more_than_refused(data: bytes) -> None:
    answer, goes_on = instance().answer(data)
    assert Answer.FromString(answer).refusal
    assert not goes_on


_CALLS = st.builds(
    Call,
    function=st.sampled_from(
        ["DoStep", "GetInt8", "SetBoolean", "Reset", "SetClock", "", "GetFMUState", "\N{SNOWMAN}"]
    ),
    references=st.lists(st.integers(0, 2**32 - 1), max_size=3),
    size=st.integers(0, 2**32 - 1),
    values=st.binary(max_size=9),
    numbers=st.lists(st.floats(), max_size=4),
    texts=st.lists(st.text(max_size=3), max_size=2),
    slot=st.integers(0, 2**32 - 1),
)


@given(st.lists(_CALLS, min_size=1, max_size=5))
@settings(max_examples=25, deadline=None)
def test_drawn_calls_of_a_body_are_answered_or_refused(calls: list[Any]) -> None:
    found = instance()
    answer, _ = found.answer(Batch(calls=[BEGIN, *calls]).SerializeToString())
    told = Answer.FromString(answer)
    assert told.refusal or 1 <= len(told.results) <= 1 + len(calls)
    found.free()


# ---- what can be served ----


def test_an_fmu_that_cannot_be_served_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ComponentFileError, match="expected an FMU for co-simulation, got one without it"):
        Server(fmu_factory.exchanged(tmp_path), HERE, TOKEN)


def test_beyond_this_machine_there_is_tls_or_nothing() -> None:
    with pytest.raises(UsageError, match=r"expected --certificate and --key for 0\.0\.0\.0:0"):
        Server(fmu_path("ImpactStop"), Address("0.0.0.0", 0), TOKEN)
