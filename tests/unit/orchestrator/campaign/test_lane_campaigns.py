"""Campaigns in lanes: any cut into chunks gives the same bits, and two engines are never mixed."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.campaign_process import CampaignProcess
from support.campaign_scenes import assert_same_rows, axis, frequency, scene_of, swept_text
from support.serial_pool import campaign_here

import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis.dataset import read_flat
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted
from vibroimpact.orchestrator.campaign.manifest import read_manifest, write_manifest
from vibroimpact.orchestrator.run.point import ENGINE
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

BODY = swept_text(position=0.3)
RESTITUTION = axis("stop[1].restitution", [0.0, 0.4, 0.8]) + "\n"
MAP = BODY + RESTITUTION + frequency(9, "independent")
BRANCHES = BODY + RESTITUTION + frequency(9, "up-down")
PATH = BODY + frequency(9, "up-down")


@pytest.mark.parametrize("text", [MAP, BRANCHES], ids=["map", "branches"])
def test_a_campaign_in_lanes_that_is_interrupted_has_the_bits_of_one_that_is_not(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = campaign_here(monkeypatch, text, tmp_path / "whole", runner=DEFAULT_RUNNER)
    with monkeypatch.context() as patch:
        patch.setattr(schedule, "FIRST_POINTS", 4)
        patch.setattr(schedule, "MOST_POINTS", 5)
        with pytest.raises(CampaignInterrupted):
            campaign_here(monkeypatch, text, tmp_path / "cut", runner=DEFAULT_RUNNER, most_chunks=4)
    assert campaign_here(monkeypatch, text, tmp_path / "cut", runner=DEFAULT_RUNNER).resumed > 0
    assert_same_rows(whole.dataset, tmp_path / "cut" / "dataset.nc")
    rows = read_flat(whole.dataset)
    assert (rows.attrs["execution"], rows.attrs["engine_version"]) == ("lanes", ENGINE)
    assert rows.attrs["engine"].startswith("lanes, many points at once: Oscillator")
    assert set(rows.outcome.values) == {0}
    assert (rows.impact_count.values > 0).any()


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and sessions")
@pytest.mark.parametrize(
    ("path", "points"), [("independent", 12), pytest.param("up-down", 6, marks=pytest.mark.long)]
)
def test_kill_9_of_a_worker_and_of_the_campaign_changes_no_bit_of_points_in_lanes(
    path: str, points: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    restitution = '"stop[1].restitution" = { start = 0.0, stop = 0.9, points = 40 }\n'
    text = BODY + restitution + frequency(points, path)
    whole = campaign_here(monkeypatch, text, tmp_path / "whole", runner=DEFAULT_RUNNER)
    rests = read_flat(whole.dataset).stick_count.values > 0
    assert 0 < np.count_nonzero(rests) < rests.size  # lanes leave out points that rest
    (tmp_path / "scene.toml").write_text(text)
    command = (tmp_path / "scene.toml", tmp_path / "killed", "--workers", "2")
    killed = CampaignProcess(*command, runner="unhurried_lanes")
    killed.wait_for_parts(1)
    killed.workers()[0].kill()
    killed.wait_for_parts(3)
    killed.process.kill()
    killed.end()
    killed.assert_nothing_lives()
    assert not (tmp_path / "killed" / "dataset.nc").exists()
    code, out, err = CampaignProcess(*command, runner="unhurried_lanes").end()
    assert code == 0, err
    assert "by 2 workers, " in out  # both computed points, besides the stored points
    assert_same_rows(whole.dataset, tmp_path / "killed" / "dataset.nc")


def test_a_path_that_is_extended_by_another_key_goes_on_fused_as_it_began(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wider = BODY + RESTITUTION.replace("0.8", "0.7") + frequency(9, "up-down")
    campaign_here(monkeypatch, PATH, tmp_path / "path", runner=DEFAULT_RUNNER)
    report = campaign_here(monkeypatch, wider, tmp_path / "path", runner=DEFAULT_RUNNER)
    assert report.resumed == 18
    fused = wider + '\n[execution]\nhow = "fused"\n'
    alone = campaign_here(monkeypatch, fused, tmp_path / "fused", runner=DEFAULT_RUNNER)
    assert_same_rows(report.dataset, alone.dataset)
    assert read_flat(report.dataset).attrs["execution"] == "fused"
    assert read_flat(report.dataset).attrs["engine"].startswith("fused")


def test_a_half_done_campaign_of_another_engine_is_refused_by_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(schedule, "FIRST_POINTS", 4)
        with pytest.raises(CampaignInterrupted):
            campaign_here(patch, MAP, tmp_path, runner=DEFAULT_RUNNER, most_chunks=1)
    path = tmp_path / "campaign.json"
    manifest = read_manifest(path)
    assert manifest is not None
    write_manifest(path, scene_of(MAP), replace(manifest.identity, engine=1), manifest.runs)
    parts = sorted((tmp_path / "parts").iterdir())
    with pytest.raises(
        UsageError, match=rf"engine was 1, is {ENGINE}\. Results of two kinds are never mixed"
    ):
        campaign_here(monkeypatch, MAP, tmp_path, runner=DEFAULT_RUNNER)
    assert sorted((tmp_path / "parts").iterdir()) == parts
