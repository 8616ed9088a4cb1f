"""Announced points run in batches, and equal the same points run one by one."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.orchestrator.guard import GuardedRunner, guarded
from vibroimpact.orchestrator.guard.pipe import PointTask
from vibroimpact.orchestrator.guard.point_process import PointProcess
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.run.points import independent_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there points are run one by one")

SCENE = """
[scene]
units = "SI"
[component.body]
fmu = "Oscillator"
parameters = { stiffness = 1.0, velocity_start = 1.0 }
[record]
recorded_time = 1.0
variables = ["body.displacement", "body.velocity"]
rate = RATE
[execution]
macro_step = 1.0
guard = true
"""
SWEPT = "body.stiffness"


@pytest.fixture(scope="module", params=[500, 5000], ids=["pipe", "memory"])
def scene(request: pytest.FixtureRequest) -> Scene:
    """Return a scene whose points have 12 kB of samples, which go through the pipe, or 120 kB, which go by memory."""
    return parse_scene(SCENE.replace("RATE", str(request.param)), "batches.toml")


@pytest.fixture(scope="module")
def runner(scene: Scene) -> Iterator[GuardedRunner]:
    made = open_scene(scene)
    assert isinstance(made, GuardedRunner)
    yield made
    made.close()


@pytest.fixture(scope="module")
def alone(scene: Scene) -> Iterator[Callable[[float], RunRecord]]:
    made = open_runner(scene, "auto")
    yield lambda stiffness: made.run({SWEPT: stiffness})
    made.close()


@pytest.fixture
def batches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the list of batch sizes, which grows with each batch given to a child."""
    sizes: list[int] = []
    say = PointProcess.say

    def counted(process: PointProcess, message: Any) -> None:
        sizes.append(len(message))
        say(process, message)

    monkeypatch.setattr(PointProcess, "say", counted)
    return sizes


def assert_same(record: RunRecord, expected: RunRecord) -> None:
    assert record.message == expected.message
    assert record.samples is not None
    assert expected.samples is not None
    np.testing.assert_array_equal(record.samples, expected.samples)


def test_the_points_of_a_chunk_are_those_of_a_runner_without_a_guard(
    runner: GuardedRunner,
    alone: Callable[[float], RunRecord],
    batches: list[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the child gets more points than fit its time, and gets the rest again
    monkeypatch.setattr(guarded, "BATCH_TIME", 10.0)
    stiffnesses = [1.0 + k for k in range(40)]
    points = independent_points({SWEPT: np.array(stiffnesses)}, len(stiffnesses))
    records, _ = runner.rows(points)
    assert isinstance(records, list)
    for stiffness, record in zip(stiffnesses, records, strict=True):
        assert_same(record, alone(stiffness))
    assert 1 < len(batches) < len(points)
    assert batches[:2] == [1, len(points) - 1]


def test_points_that_were_run_ahead_and_are_not_asked_for_are_forgotten(
    runner: GuardedRunner, alone: Callable[[float], RunRecord]
) -> None:
    announced: list[PointTask] = [({SWEPT: 1.0 + k}, None) for k in range(8)]
    runner.announce(announced)
    for values, start in announced[:3]:
        assert_same(runner.run(values, start), alone(values[SWEPT]))
    # equal to an announced point, but another object
    for stiffness in (4.0, 20.0, 4.0):
        assert_same(runner.run({SWEPT: stiffness}), alone(stiffness))
    runner.announce(announced[4:])
    for values, start in announced[4:]:
        assert_same(runner.run(values, start), alone(values[SWEPT]))


def test_a_point_after_ctrl_c_gets_its_own_answer(
    runner: GuardedRunner, alone: Callable[[float], RunRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(process: PointProcess, seconds: float) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(PointProcess, "answers", interrupted)
        with pytest.raises(KeyboardInterrupt):
            runner.run({SWEPT: 2.0})
    assert_same(runner.run({SWEPT: 3.0}), alone(3.0))
