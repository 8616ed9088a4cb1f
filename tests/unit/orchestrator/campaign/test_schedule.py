from dataclasses import replace
from types import SimpleNamespace

from vibroimpact.orchestrator.campaign.schedule import (
    CHUNK_SECONDS,
    FIRST_POINTS,
    MOST_POINTS,
    MOST_RATE,
    QUEUED_PER_WORKER,
    SHORTEST_SECONDS,
    ChunkSchedule,
)
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult
from vibroimpact.orchestrator.scene.sweep import Branch, SweepAxis, SweepPath, expand


def branches(points: int, path: SweepPath = "independent", others: int = 1) -> tuple[Branch, ...]:
    axes = (
        SweepAxis("forcing.amplitude", tuple(map(float, range(others)))),
        SweepAxis("forcing.angular_frequency", tuple(map(float, range(points))), path),
    )
    return expand(SimpleNamespace(sweep=axes))


def ended(chunk: Chunk, seconds_per_point: float) -> ChunkResult:
    return ChunkResult(chunk, (1.0, 2.0), {}, seconds_per_point * chunk.count)


def next_chunk(schedule: ChunkSchedule) -> Chunk:
    chunk = schedule.next_chunk()
    assert chunk is not None
    return chunk


def test_the_first_chunks_are_small_and_later_ones_last_as_long_as_a_chunk_should() -> None:
    schedule = ChunkSchedule(branches(100_000), [], workers=2)
    first = next_chunk(schedule)
    assert first.count == FIRST_POINTS
    schedule.finished(first, ended(first, 1e-3))
    assert next_chunk(schedule).count == round(CHUNK_SECONDS / 1e-3)


def test_a_slow_point_makes_a_chunk_of_its_own() -> None:
    schedule = ChunkSchedule(branches(1000), [], workers=2)
    first = next_chunk(schedule)
    schedule.finished(first, ended(first, 30.0))
    assert next_chunk(schedule).count == 1


def test_quick_points_do_not_make_a_part_that_fills_the_memory() -> None:
    schedule = ChunkSchedule(branches(10_000_000), [], workers=2)
    first = next_chunk(schedule)
    schedule.finished(first, ended(first, 1e-7))
    assert next_chunk(schedule).count == MOST_POINTS


def test_chunks_get_shorter_towards_the_end_so_that_workers_finish_together() -> None:
    schedule = ChunkSchedule(branches(50_000), [], workers=2)
    counts = []
    while chunk := schedule.next_chunk():
        counts.append(chunk.count)
        schedule.finished(chunk, ended(chunk, 1e-3))
    assert sum(counts) == 50_000
    assert max(counts) == round(CHUNK_SECONDS / 1e-3)
    assert counts[-1] <= 1.5 * SHORTEST_SECONDS / 1e-3


def test_up_and_down_run_side_by_side_and_each_waits_for_its_own_last_state() -> None:
    schedule = ChunkSchedule(branches(1000, "up-down"), [], workers=2)
    up, down = next_chunk(schedule), next_chunk(schedule)
    assert (up.first, down.first) == (0, 1000)
    assert schedule.next_chunk() is None
    schedule.finished(down, ended(down, 1e-3))
    following = next_chunk(schedule)
    assert following.first == down.stop
    assert following.start == (1.0, 2.0)
    assert schedule.next_chunk() is None


def test_short_branches_share_a_chunk() -> None:
    schedule = ChunkSchedule(branches(20, "up", others=1000), [], workers=2)
    first = next_chunk(schedule)
    assert first.count == 60
    schedule.finished(first, ended(first, 1e-3))
    chunk = next_chunk(schedule)
    assert chunk.count == round(CHUNK_SECONDS / 1e-3)
    assert chunk.first % 20 == 0


def test_a_chunk_that_takes_too_long_ends_early_and_its_rest_is_handed_out_again() -> None:
    schedule = ChunkSchedule(branches(FIRST_POINTS), [], workers=2)
    planned = next_chunk(schedule)
    assert schedule.next_chunk() is None
    done = Chunk(0, 0, 10)
    schedule.finished(planned, ended(done, 0.2))
    assert next_chunk(schedule).first == 10


def test_a_chunk_that_killed_its_worker_comes_back_in_pieces() -> None:
    schedule = ChunkSchedule(branches(FIRST_POINTS), [], workers=2)
    schedule.lost(next_chunk(schedule))
    assert next_chunk(schedule).count == FIRST_POINTS // 16


def test_workers_never_wait_for_the_next_chunk_of_independent_points() -> None:
    assert ChunkSchedule(branches(10), [], workers=4).most_in_flight == 4 * QUEUED_PER_WORKER


def test_before_the_time_of_a_point_is_known_each_worker_gets_one_chunk() -> None:
    schedule = ChunkSchedule(branches(100_000), [], workers=2)
    first, _ = next_chunk(schedule), next_chunk(schedule)
    assert schedule.next_chunk() is None
    schedule.finished(first, ended(first, 1e-3))
    assert next_chunk(schedule).count == round(CHUNK_SECONDS / 1e-3)


def test_large_results_make_a_chunk_of_fewer_points() -> None:
    schedule = ChunkSchedule(branches(10_000_000), [], workers=2, most_bytes=10_000)
    first = next_chunk(schedule)
    schedule.finished(first, replace(ended(first, 1e-6), size=100 * first.count))
    chunk = next_chunk(schedule)
    assert (chunk.count, chunk.most_bytes) == (100, 10_000)


def test_chunks_of_many_workers_take_as_long_as_one_scheduler_needs() -> None:
    schedule = ChunkSchedule(branches(10_000_000, others=100), [], workers=1000)
    first = next_chunk(schedule)
    schedule.finished(first, ended(first, 1e-3))
    assert next_chunk(schedule).count == round(1000 / MOST_RATE / 1e-3)
