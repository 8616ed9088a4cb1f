"""A campaign in lanes by threads of this process: the parts and bits of one thread, and no thread outlives it."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.campaign_scenes import assert_same_rows, axis, frequency, scene_of, swept_text

import vibroimpact.orchestrator.campaign.campaign as campaign
import vibroimpact.orchestrator.campaign.schedule as schedule
import vibroimpact.orchestrator.campaign.workers.threads as threads
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult, Work
from vibroimpact.orchestrator.scene import Scene

HELD_AFTER_FREE = """
import numpy as np, psutil
import vibroimpact.orchestrator.campaign.workers.threads as threads
np.ones(3_000_000)  # freed at once: the library now keeps arrays of 24 MB in its heap
threads._give_arrays_back()
before = psutil.Process().memory_info().rss
arrays, kept = [], []
for _ in range(200):
    arrays.append(np.ones(50_000))
    kept.append(np.ones(10))
del arrays
print(psutil.Process().memory_info().rss - before)
"""
"""Program that prints the bytes that stay with the process after 80 MB of arrays were freed."""
RESTITUTION = axis("stop[1].restitution", [0.0, 0.4, 0.8])


def scene(path: str = "independent") -> Scene:
    return scene_of(swept_text(RESTITUTION, frequency(19, path), position=0.3))


@pytest.fixture(autouse=True)
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let two threads take over after the first chunk, and refuse workers."""

    def refused(**_: object) -> Any:
        raise AssertionError("workers are opened")

    monkeypatch.setattr(campaign, "open_workers", refused)
    monkeypatch.setattr(campaign, "thread_count", lambda _: 2)
    monkeypatch.setattr(campaign, "FEW_SECONDS", 0.0)
    monkeypatch.setattr(schedule, "FIRST_POINTS", 4)
    monkeypatch.setattr(schedule, "MOST_POINTS", 5)
    before = threading.active_count()
    yield
    assert threading.active_count() == before


def whole(monkeypatch: pytest.MonkeyPatch, folder: Path, path: str = "independent") -> Path:
    """Return the dataset of a campaign that one thread computes."""
    with monkeypatch.context() as patch:
        patch.setattr(campaign, "FEW_SECONDS", 1e9)
        return run_campaign(scene(path), folder).dataset


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_threads_give_the_bits_of_one_thread(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    computing = set[str]()
    run_chunk = threads.run_chunk

    def noted(work: Work, chunk: Chunk) -> ChunkResult:
        computing.add(threading.current_thread().name)
        return run_chunk(work, chunk)

    monkeypatch.setattr(threads, "run_chunk", noted)
    report = run_campaign(scene(path), tmp_path / "threads")
    assert computing
    assert threading.main_thread().name not in computing
    assert (report.workers, report.outcomes.total()) == (0, report.runs)
    assert_same_rows(report.dataset, whole(monkeypatch, tmp_path / "one", path))


def test_ctrl_c_ends_the_threads_and_the_same_campaign_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    next_answer, left = threads._next_answer, [1, 1, 1]

    def interrupted(answers: Any) -> Any:
        if not left:
            raise KeyboardInterrupt
        left.pop()
        return next_answer(answers)

    with monkeypatch.context() as patch:
        patch.setattr(threads, "_next_answer", interrupted)
        with pytest.raises(CampaignInterrupted, match="of 57 points are complete in"):
            run_campaign(scene(), tmp_path / "threads")
    assert not list((tmp_path / "threads" / "parts").glob(".*.tmp"))
    report = run_campaign(scene(), tmp_path / "threads")
    assert 0 < report.resumed < report.runs
    assert_same_rows(report.dataset, whole(monkeypatch, tmp_path / "one"))


def test_a_chunk_under_way_is_abandoned_when_another_thread_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_chunk, first = threads.run_chunk, threading.Lock()

    def refused(work: Work, chunk: Chunk) -> ChunkResult:
        if first.acquire(blocking=False):
            raise CampaignError("no room")
        return run_chunk(work, chunk)

    monkeypatch.setattr(threads, "run_chunk", refused)
    with pytest.raises(CampaignError, match="no room"):
        run_campaign(scene(), tmp_path / "threads")


@pytest.mark.parametrize(
    ("processors", "execution", "count"), [(2, "lanes", 2), (2, "fused", 0), (5, "lanes", 0)]
)
def test_only_lanes_on_few_processors_go_by_threads(
    monkeypatch: pytest.MonkeyPatch, processors: int, execution: str, count: int
) -> None:
    monkeypatch.setattr(threads, "processor_count", lambda: processors)
    assert threads.thread_count(execution) == count


@pytest.mark.skipif(sys.platform != "linux", reason="a setting of the C library of Linux")
def test_freed_arrays_go_back_to_the_system() -> None:
    """Freed arrays below a small object that stays are held by the heap, unless their memory is mapped alone."""
    run = subprocess.run([sys.executable, "-c", HELD_AFTER_FREE], capture_output=True, text=True, check=True)
    assert float(run.stdout) < 10e6
