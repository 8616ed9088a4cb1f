"""Adaptive campaigns: rounds of points where the motion jumps, the same after any interruption."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from support.campaign_scenes import assert_same_rows, swept_text
from support.serial_pool import campaign_here

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import read_flat
from vibroimpact.analysis.jumps import jumps_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import parse_scene

BODY = swept_text(transient_periods=100, recorded_periods=10)
PATH = BODY + (
    '"forcing.angular_frequency" = { start = 1.2, stop = 1.6, points = 9, path = "up-down", '
    "adaptive = { tolerance = 5e-3, at_most = 200 } }\n"
)
PLANE = BODY + (
    '"forcing.angular_frequency" = { start = 1.2, stop = 1.6, points = 4, '
    "adaptive = { tolerance = 0.05, at_most = 90 } }\n"
    '"stop[1].position" = { values = [0.6, 1.0, 1.4], adaptive = { tolerance = 0.2 } }\n'
)
EXACT_FOLD = 1.5166110861  # of P(1,1), vibroimpact.analysis.landmarks.folds


@pytest.mark.parametrize("text", [PATH, PLANE], ids=["path", "plane"])
def test_a_campaign_interrupted_after_every_chunk_has_the_rows_of_one_that_was_not(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = campaign_here(monkeypatch, text, tmp_path / "whole", runner=DEFAULT_RUNNER)
    report = None
    while report is None:
        with suppress(CampaignInterrupted):
            report = campaign_here(monkeypatch, text, tmp_path / "cut", runner=DEFAULT_RUNNER, most_chunks=1)
    assert report.runs == whole.runs
    assert_same_rows(report.dataset, whole.dataset)
    again = campaign_here(monkeypatch, text, tmp_path / "cut", runner=DEFAULT_RUNNER, most_chunks=0)
    assert again.resumed == again.runs == whole.runs


def test_a_damaged_part_of_a_round_is_computed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = campaign_here(monkeypatch, PATH, tmp_path / "whole", runner=DEFAULT_RUNNER)
    with pytest.raises(CampaignInterrupted):
        campaign_here(monkeypatch, PATH, tmp_path / "cut", runner=DEFAULT_RUNNER, most_chunks=3)
    part = min((tmp_path / "cut" / "parts").glob("branch-*"))
    part.write_bytes(part.read_bytes()[:-100])
    report = campaign_here(monkeypatch, PATH, tmp_path / "cut", runner=DEFAULT_RUNNER)
    assert_same_rows(report.dataset, whole.dataset)


def test_the_fold_of_the_impacting_motion_is_bracketed_along_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = campaign_here(monkeypatch, PATH, tmp_path, runner=DEFAULT_RUNNER)
    jumps = jumps_of(open_dataset(report.dataset))
    fold = jumps.isel(jump=((jumps.direction == "up") & (jumps.below > 1.4)).values)
    assert fold.sizes["jump"] == 1
    # the transient of 100 periods decays only at a distance from the fold of a little more than the tolerance
    assert fold.below.item() == pytest.approx(EXACT_FOLD, abs=6e-3)
    assert 0.0 < fold.above.item() - fold.below.item() <= 5e-3
    assert fold.impacts.values.tolist() == [[1, 0]]
    assert report.runs < 60


def test_a_plane_is_a_list_of_points_with_a_coordinate_for_each_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = campaign_here(monkeypatch, PLANE, tmp_path, runner=DEFAULT_RUNNER)
    dataset = open_dataset(report.dataset)
    assert (
        dataset.displacement_range.dims
        == dataset.position.dims
        == dataset.angular_frequency.dims
        == ("point",)
    )
    assert 12 < dataset.sizes["point"] <= 90
    assert np.unique(np.stack([dataset.position, dataset.angular_frequency]), axis=1).shape[1] == report.runs


def test_jumps_that_there_was_no_room_for_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = PATH.replace("at_most = 200", "at_most = 19")
    report = campaign_here(monkeypatch, text, tmp_path, runner=DEFAULT_RUNNER)
    assert report.runs == 19
    assert read_flat(report.dataset).attrs["unresolved_jumps"] >= 1


def test_another_tolerance_is_another_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign_here(monkeypatch, PLANE, tmp_path, runner=DEFAULT_RUNNER)
    with pytest.raises(UsageError, match=r"adaptive.tolerance was 0.05, is 0.04"):
        campaign_here(monkeypatch, PLANE.replace("0.05, at", "0.04, at"), tmp_path, runner=DEFAULT_RUNNER)


def test_a_run_in_memory_refuses_points_that_are_not_known_before(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"got adaptive axes\. Use `vibroimpact campaign`"):
        run_scene(parse_scene(PLANE, "plane.toml"), tmp_path / "plane.nc")
