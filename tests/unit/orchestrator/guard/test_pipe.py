"""Messages between a guard and its child arrive whole, or not at all."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.guard import pipe as pipe_module
from vibroimpact.orchestrator.guard.child import _Answers
from vibroimpact.orchestrator.guard.pipe import BELL, HEAD, Failure, Memory, Order, packed, receive, send
from vibroimpact.orchestrator.guard.point_process import HAS_BELL
from vibroimpact.orchestrator.scene import parse_scene

FREE = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 5"


def sent(*messages: object) -> bytes:
    pipe = io.BytesIO()
    for message in messages:
        send(pipe, message)
    return pipe.getvalue()


def test_messages_arrive_one_by_one_as_they_were_sent() -> None:
    messages = [
        Order(parse_scene(FREE, "scene.toml"), "fused", "notes", noting=True),
        (({"body.mass": 0.1 + 0.2}, (1.0, -0.0)), ({"body.mass": 1.0}, None)),
        Failure("a: expected b, got c\n\N{GREEK SMALL LETTER OMEGA}", misuse=True),
    ]
    pipe = io.BytesIO(sent(*messages))
    assert [receive(pipe) for _ in messages] == messages
    assert receive(pipe) is None


@pytest.mark.parametrize("kept", [0, 1, HEAD.size - 1, HEAD.size, HEAD.size + 1, -1])
def test_a_message_that_was_cut_off_is_none(kept: int) -> None:
    assert receive(io.BytesIO(sent(Failure("lost"))[:kept])) is None


def record_of(rows: int) -> RunRecord:
    """Return a record with arrays of all kinds."""
    table = np.arange(4.0 * rows).reshape(rows, 4)
    return RunRecord(
        Outcome.stuck,
        "stuck",
        periods=np.empty((0, 5)),
        impacts=table[:, ::2],  # not contiguous
        samples=np.asfortranarray(table),
        events=np.array([[np.nan, -0.0, np.inf]]),
        final_displacement=0.1 + 0.2,
        loop_residual=1e-300,
    )


def assert_arrived(record: RunRecord, sent_record: RunRecord) -> None:
    assert record.outcome is sent_record.outcome
    for name in RunRecord.__slots__:
        value, expected = getattr(record, name), getattr(sent_record, name)
        if isinstance(expected, np.ndarray):
            assert value.shape == expected.shape
            assert value.tobytes() == expected.tobytes()
            assert value.flags.writeable
        else:
            np.testing.assert_equal(value, expected)


def test_a_record_arrives_with_every_bit_of_its_arrays_which_may_be_written() -> None:
    sent_record = record_of(3)
    assert_arrived(receive(io.BytesIO(sent(sent_record))), sent_record)


@pytest.fixture
def memory() -> Iterator[int]:
    """Return a file in memory."""
    if sys.platform != "linux":
        pytest.skip("the system has no files in memory")
    file = os.memfd_create("test")
    yield file
    os.close(file)


def through(memory: int, writer: Memory, *records: RunRecord) -> tuple[list[RunRecord | None], int]:
    """Send and receive records; return them, and the number of bytes through the pipe."""
    pipe = io.BytesIO(b"".join(bytes(row) for record in records for row in packed(record, writer)))
    size = len(pipe.getvalue())
    return [receive(pipe, memory) for _ in records], size


def test_large_arrays_arrive_by_memory_and_all_others_by_the_pipe(memory: int) -> None:
    records = [record_of(rows) for rows in (3, 2000, 5, 3000)]
    writer = Memory(memory)
    for _ in range(3):  # later batches find the memory as the first has left it
        received, size = through(memory, writer, *records)
        assert size < 2000
        for record, expected in zip(received, records, strict=True):
            assert record is not None
            assert_arrived(record, expected)
        writer.clear()


def test_what_memory_has_no_room_for_goes_through_the_pipe(
    memory: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipe_module, "MEMORY_ROOM", 250_000)
    records = [record_of(rows) for rows in (2000, 3000, 4000, 500)]
    received, size = through(memory, Memory(memory), *records)
    assert os.fstat(memory).st_size <= 250_000
    assert size > 100_000
    for record, expected in zip(received, records, strict=True):
        assert record is not None
        assert_arrived(record, expected)


def test_a_file_that_takes_nothing_leaves_all_to_the_pipe(memory: int) -> None:
    refusing = os.open(f"/proc/self/fd/{memory}", os.O_RDONLY)
    try:
        (record,), size = through(memory, Memory(refusing), record_of(2000))
    finally:
        os.close(refusing)
    assert size > 90_000
    assert record is not None
    assert_arrived(record, record_of(2000))


def test_a_record_whose_memory_is_gone_is_none(memory: int) -> None:
    pipe = io.BytesIO(b"".join(bytes(row) for row in packed(record_of(2000), Memory(memory))))
    os.ftruncate(memory, 1000)
    assert receive(pipe, memory) is None


@pytest.mark.parametrize("missing", [1, 7, 8, 96, 97, 200])
def test_a_record_that_was_cut_off_is_none(missing: int) -> None:
    whole = sent(RunRecord(Outcome.ok, "", periods=np.ones((2, 5)), impacts=np.ones((3, 4))))
    assert receive(io.BytesIO(whole[:-missing])) is None


@pytest.mark.skipif(not HAS_BELL, reason="answers are read one by one where there is no bell")
def test_answers_larger_than_the_pipe_are_read_whole_while_they_are_written() -> None:
    ends, bell = os.pipe(), os.pipe()
    answers = _Answers(ends[1], bell[1])
    record = RunRecord(
        Outcome.ok, "", periods=np.zeros((1, 5)), impacts=np.random.default_rng(1).random((9999, 9))
    )
    with ThreadPoolExecutor(1) as pool, os.fdopen(ends[0], "rb") as pipe:
        writing = pool.submit(lambda: [answers.put(record, last=number == 3) for number in range(4)])
        received, last = [], False
        while not last:
            count, last = BELL.unpack(os.read(bell[0], BELL.size))
            received += [receive(pipe) for _ in range(count)]
        writing.result()
    assert [one.impacts.tobytes() for one in received] == 4 * [record.impacts.tobytes()]
    for end in (ends[1], *bell):
        os.close(end)
