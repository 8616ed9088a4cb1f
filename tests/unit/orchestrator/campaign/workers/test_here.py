"""A campaign that begins in this process: the same parts and bits as workers, who take over long campaigns."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from support.busy_runner import run_busy
from support.campaign_scenes import assert_same_rows, frequency_text, scene_of
from support.serial_pool import SerialPool, campaign_here

import vibroimpact.orchestrator.campaign.campaign as campaign
import vibroimpact.orchestrator.campaign.schedule as schedule
import vibroimpact.orchestrator.campaign.workers.here as here
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult, Work
from vibroimpact.orchestrator.run import PointRunner, Runner
from vibroimpact.orchestrator.running import kept
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene

BUSY = "support.busy_runner:BusyRunner"
GENERAL = """
[component.body]
fmu = "Oscillator"
parameters = { stiffness = 1.0, velocity_start = 1.0 }
[record]
recorded_time = 1.0
variables = ["body.displacement"]
rate = 10
[execution]
macro_step = 1.0
"""


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace workers by this process, and return the list of opened workers."""
    pools: list[str] = []

    @contextmanager
    def serial(**_: object) -> Iterator[SerialPool]:
        pools.append("workers")
        yield SerialPool()

    monkeypatch.setattr(campaign, "open_workers", serial)
    monkeypatch.setattr(campaign, "may_begin_here", lambda *_: True)
    return pools


def run(scene: Scene, folder: Path, runner: str = BUSY) -> CampaignReport:
    return run_campaign(scene, folder, runner=runner)


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_few_points_need_no_workers_and_have_the_rows_of_a_run(
    tmp_path: Path, opened: list[str], path: str
) -> None:
    scene = scene_of(frequency_text(12, path, milliseconds=0.1))
    report = run(scene, tmp_path / "campaign")
    run_busy(scene, tmp_path / "run.nc")
    assert_same_rows(report.dataset, tmp_path / "run.nc")
    assert (opened, report.workers, report.runs) == ([], 0, scene.runs)
    again = run(scene, tmp_path / "campaign")
    assert again.resumed == again.runs


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_workers_go_on_where_more_is_left_than_is_worth_doing_here(
    tmp_path: Path, opened: list[str], path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(here, "HERE_SECONDS", 0.05)
    monkeypatch.setattr(schedule, "FIRST_POINTS", 4)
    scene = scene_of(frequency_text(40, path, milliseconds=3.0))
    report = run(scene, tmp_path / "campaign")
    run_busy(scene, tmp_path / "run.nc")
    assert_same_rows(report.dataset, tmp_path / "run.nc")
    assert (opened, report.workers, report.resumed) == (["workers"], 1, 0)
    assert report.outcomes.total() == scene.runs


@pytest.mark.parametrize("how", ["fused", "auto", "coupled"])
def test_a_point_that_takes_long_is_left_to_workers_before_it_ends(
    tmp_path: Path, opened: list[str], monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    monkeypatch.setattr(here, "HERE_SECONDS", 0.0)
    monkeypatch.setattr(campaign, "thread_count", lambda _: 0)
    text = frequency_text(3).replace("transient_periods = 10", "transient_periods = 2000")
    scene = scene_of(f'{text}\n[execution]\nhow = "{how}"\n')
    report = run(scene, tmp_path / "campaign", DEFAULT_RUNNER)
    assert opened == ["workers"]
    assert (report.resumed, report.outcomes.total()) == (0, 3)


def test_ctrl_c_here_is_said_and_both_ways_resume_each_other(
    tmp_path: Path, opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedule, "FIRST_POINTS", 4)
    text = frequency_text(20, "up-down", milliseconds=0.1)
    scene = scene_of(text)
    run_chunk, left = here.run_chunk, [1]

    def interrupted(work: Work, chunk: Chunk) -> ChunkResult:
        if not left:
            raise KeyboardInterrupt
        left.pop()
        return run_chunk(work, chunk)

    with monkeypatch.context() as patch:
        patch.setattr(here, "run_chunk", interrupted)
        with pytest.raises(CampaignInterrupted, match="of 40 points are complete in"):
            run(scene, tmp_path / "campaign")
    with pytest.raises(CampaignInterrupted):
        campaign_here(monkeypatch, text, tmp_path / "campaign", runner=BUSY, most_chunks=1)
    report = run(scene, tmp_path / "campaign")
    assert 0 < report.resumed < report.runs
    run_busy(scene, tmp_path / "run.nc")
    assert_same_rows(report.dataset, tmp_path / "run.nc")
    assert opened == []


def test_a_part_that_cannot_be_written_is_the_error_of_the_campaign(
    tmp_path: Path, opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> ChunkResult:
        raise CampaignError("no room")

    monkeypatch.setattr(here, "run_chunk", refused)
    with pytest.raises(CampaignError, match="no room"):
        run(scene_of(frequency_text(3)), tmp_path / "campaign")
    assert opened == []


def test_workers_that_are_asked_for_are_started(tmp_path: Path, opened: list[str]) -> None:
    report = run_campaign(scene_of(frequency_text(3)), tmp_path / "campaign", workers=1, runner=BUSY)
    assert (opened, report.workers) == (["workers"], 1)


def test_what_may_take_this_process_down_or_hold_it_up_does_not_begin_in_it() -> None:
    plain, general = scene_of(frequency_text(3)), scene_of(GENERAL)
    guarded = scene_of(f"{GENERAL}guard = true\n")
    assert here.may_begin_here(plain, DEFAULT_RUNNER, 3)
    assert not here.may_begin_here(plain, BUSY, 3)
    assert not here.may_begin_here(general, DEFAULT_RUNNER, 3)
    assert not here.may_begin_here(general, DEFAULT_RUNNER, 1)
    assert here.may_begin_here(guarded, DEFAULT_RUNNER, 1)
    assert not here.may_begin_here(guarded, DEFAULT_RUNNER, 2)


def test_two_campaigns_of_one_process_do_not_share_what_is_open(tmp_path: Path) -> None:
    work = Work(scene_of(frequency_text(3)), str(tmp_path))
    with here.opened_here(work) as first, here.opened_here(work) as second:
        assert first is not None
        assert second is None
    with here.opened_here(work) as again:
        assert again == first


def test_a_scene_stays_open_for_the_next_campaign_unless_a_point_failed(
    tmp_path: Path, opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Scene] = []
    make = kept.named_runner

    def noted(scene: Scene, runner: str, execution: str | None) -> Runner:
        made.append(scene)
        return make(scene, runner, execution)

    monkeypatch.setattr(kept, "named_runner", noted)
    scene = scene_of(frequency_text(3, milliseconds=1.0078125))
    for name in ("first", "second"):
        run(scene, tmp_path / name, DEFAULT_RUNNER)
    assert_same_rows(tmp_path / "second" / "dataset.nc", tmp_path / "first" / "dataset.nc")
    assert len(made) == 1
    rows = PointRunner.rows

    def broken(runner: PointRunner, *arguments: Any) -> tuple[RunColumns, object]:
        records, carried = rows(runner, *arguments)
        assert isinstance(records, RunColumns)
        records.outcome[:], records.message[:] = Outcome.error, "broken"
        return records, carried

    with monkeypatch.context() as patch:
        patch.setattr(PointRunner, "rows", broken)
        run(scene, tmp_path / "third", DEFAULT_RUNNER)
    run(scene, tmp_path / "fourth", DEFAULT_RUNNER)
    assert len(made) == 2
