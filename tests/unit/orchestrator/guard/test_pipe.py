"""What a guard and its child say to each other arrives whole, or not at all."""

from __future__ import annotations

import io
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.guard.child import _Answers
from vibroimpact.orchestrator.guard.pipe import BELL, HEAD, Failure, Order, receive, send
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


def test_a_record_arrives_with_every_bit_of_its_arrays_which_may_be_written() -> None:
    table = np.arange(12.0).reshape(3, 4)
    sent_record = RunRecord(
        Outcome.stuck,
        "stuck",
        periods=np.empty((0, 5)),
        impacts=table[:, ::2],  # not contiguous
        samples=np.asfortranarray(table),
        events=np.array([[np.nan, -0.0, np.inf]]),
        final_displacement=0.1 + 0.2,
        loop_residual=1e-300,
    )
    record = receive(io.BytesIO(sent(sent_record)))
    assert record.outcome is Outcome.stuck
    for name in RunRecord.__slots__:
        value, expected = getattr(record, name), getattr(sent_record, name)
        if isinstance(expected, np.ndarray):
            assert value.shape == expected.shape
            assert value.tobytes() == expected.tobytes()
            assert value.flags.writeable
        else:
            np.testing.assert_equal(value, expected)


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
