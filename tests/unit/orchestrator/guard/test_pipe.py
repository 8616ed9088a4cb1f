"""What a guard and its child say to each other arrives whole, or not at all."""

from __future__ import annotations

import io

import pytest

from vibroimpact.orchestrator.guard.pipe import LENGTH, Failure, Order, PointTask, receive, send
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
        PointTask({"body.mass": 0.1 + 0.2}, (1.0, -0.0)),
        Failure("a: expected b, got c\n\N{GREEK SMALL LETTER OMEGA}", misuse=True),
    ]
    pipe = io.BytesIO(sent(*messages))
    assert [receive(pipe) for _ in messages] == messages
    assert receive(pipe) is None


@pytest.mark.parametrize("kept", [0, 1, LENGTH.size - 1, LENGTH.size, LENGTH.size + 1, -1])
def test_a_message_that_was_cut_off_is_none(kept: int) -> None:
    assert receive(io.BytesIO(sent(Failure("lost"))[:kept])) is None
