"""A schedule hands out every run once, and every branch in order, for any behaviour of its workers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.orchestrator.campaign.parts import StoredPart
from vibroimpact.orchestrator.campaign.schedule import CHUNK_SECONDS, MOST_POINTS, ChunkSchedule
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene.sweep import Branch, SweepAxis, SweepPath, expand

paths = st.sampled_from(["independent", "up", "down", "up-down"])


def sweep(points: int, path: SweepPath, others: int) -> tuple[Branch, ...]:
    axes = (
        SweepAxis("forcing.amplitude", tuple(map(float, range(others)))),
        SweepAxis("forcing.angular_frequency", tuple(map(float, range(points))), path),
    )
    return expand(SimpleNamespace(sweep=axes))


def state_after(branches: tuple[Branch, ...], run: int) -> State | None:
    """Return a state that names its run; independent runs pass no state on."""
    return None if branches[0].direction == "independent" else (float(run), 0.0)


def stored(branches: tuple[Branch, ...], first: int, stop: int) -> StoredPart:
    chunk = Chunk(0, first, stop)
    return StoredPart(Path(chunk.part_name), chunk, state_after(branches, stop - 1))


def some_parts(data: st.DataObject, branches: tuple[Branch, ...], runs: int) -> list[StoredPart]:
    cuts = sorted(data.draw(st.sets(st.integers(0, runs), max_size=8)))
    ranges = list(zip(cuts[::2], cuts[1::2], strict=False))
    return [stored(branches, first, stop) for first, stop in ranges]


@given(
    data=st.data(),
    points=st.integers(1, 40),
    path=paths,
    others=st.integers(1, 12),
    workers=st.integers(1, 4),
    in_lanes=st.booleans(),
)
def test_every_run_is_computed_once_and_starts_where_the_one_before_ended(
    data: st.DataObject, points: int, path: SweepPath, others: int, workers: int, in_lanes: bool
) -> None:
    branches = sweep(points, path, others)
    runs = sum(len(branch.points) for branch in branches)
    begins = {branch.points.first_index for branch in branches}
    parts = some_parts(data, branches, runs)
    covered = [run for part in parts for run in range(part.chunk.first, part.chunk.stop)]
    schedule = ChunkSchedule(branches, parts, workers, in_lanes=in_lanes)
    seconds = data.draw(st.sampled_from([1e-5, 1e-3, 0.04, 3.0]))
    in_flight: list[Chunk] = []
    while True:
        while len(in_flight) < schedule.most_in_flight and (chunk := schedule.next_chunk()):
            in_flight.append(chunk)
        if not in_flight:
            break
        chunk = in_flight.pop(data.draw(st.integers(0, len(in_flight) - 1)))
        what = data.draw(st.sampled_from(["done", "done", "ended early", "lost"]))
        if what == "lost" and chunk.count > 1:
            schedule.lost(chunk)
            continue
        if branches[0].direction != "independent":
            expected = None if chunk.first in begins else (float(chunk.first - 1), 0.0)
            assert chunk.start == expected
        count = data.draw(st.integers(1, chunk.count)) if what == "ended early" else chunk.count
        done = replace(chunk, stop=chunk.first + count)
        covered += range(done.first, done.stop)
        carried = state_after(branches, done.stop - 1)
        schedule.finished(chunk, ChunkResult(done, carried, {}, seconds * count))
    assert sorted(covered) == list(range(runs))
    assert schedule.left == 0


@given(points=st.integers(1, 10**6), seconds=st.floats(1e-6, 10.0), workers=st.integers(1, 64))
def test_no_chunk_is_longer_than_was_asked_for_once_the_pace_is_known(
    points: int, seconds: float, workers: int
) -> None:
    schedule = ChunkSchedule(sweep(points, "independent", 1), [], workers)
    first = schedule.next_chunk()
    assert first is not None
    schedule.finished(first, ChunkResult(first, None, {}, seconds * first.count))
    second = schedule.next_chunk()
    assert second is None or second.count <= max(1, CHUNK_SECONDS / seconds * 1.001)
    assert second is None or second.count <= MOST_POINTS
