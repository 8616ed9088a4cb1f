"""The points of a chunk in pieces: the bits of one piece, and a bound on the size of the results."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from support.campaign_scenes import axis, frequency, scene_of, swept_text

import vibroimpact.orchestrator.campaign.workers.pieces as pieces
from vibroimpact.analysis.dataset.columns import Ragged, RunColumns
from vibroimpact.orchestrator.campaign.workers.pieces import run_in_pieces
from vibroimpact.orchestrator.run.points import PointColumns, columns_of_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand

RESTITUTION = axis("stop[1].restitution", [0.2, 0.4, 0.8])
PERIODS = "recorded_periods = 2\n"


def opened(path: str, each_period: bool = True) -> tuple[Scene, PointColumns]:
    text = swept_text(RESTITUTION, frequency(5, path), position=0.3, transient_periods=5)
    scene = scene_of(text.replace(PERIODS, f"{PERIODS}each_period = {str(each_period).lower()}\n"))
    return scene, columns_of_points(expand(scene), 0, scene.runs)


def assert_same_columns(one: object, other: object) -> None:
    assert isinstance(one, RunColumns)
    assert isinstance(other, RunColumns)
    for name in (field.name for field in fields(RunColumns) if field.name != "seconds"):
        first, second = getattr(one, name), getattr(other, name)
        if isinstance(first, Ragged):
            np.testing.assert_array_equal(first.count, second.count)
            first, second = first.rows, second.rows
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_pieces_change_no_bit(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, points = opened(path)
    with open_scene(scene) as runner:
        whole, end = runner.rows(points)
        monkeypatch.setattr(pieces, "PIECE_POINTS", 4)
        monkeypatch.setattr(pieces, "PIECE_BRANCHES", 1)
        cut, cut_end = run_in_pieces(runner, points, None, math.inf)
    assert_same_columns(cut, whole)
    assert cut_end == end


def test_one_value_for_all_periods_is_that_of_the_dataset(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, points = opened("independent", each_period=False)
    with open_scene(scene) as runner:
        cut, _ = run_in_pieces(runner, points, None, math.inf)
    assert isinstance(cut, RunColumns)
    assert cut.periods is not None
    assert cut.periods.shape[1] == 1
    np.testing.assert_array_equal(pieces._of_all_periods(cut).periods, cut.periods)


def test_results_of_a_chunk_have_a_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    text = swept_text(RESTITUTION, frequency(5), position=0.3, transient_periods=5)
    scene = scene_of(text.replace(PERIODS, PERIODS + "impacts = false\n"))
    points = columns_of_points(expand(scene), 0, scene.runs)
    monkeypatch.setattr(pieces, "PIECE_POINTS", 2)
    with open_scene(scene) as runner:
        one, _ = run_in_pieces(runner, points, None, math.inf, 1)
        whole, _ = runner.rows(points)
        assert isinstance(whole, RunColumns)
        some, _ = run_in_pieces(runner, points, None, math.inf, whole.nbytes // 2)
        over, _ = run_in_pieces(runner, points, None, 0.0)
    assert isinstance(some, RunColumns)
    assert len(one) == len(over) == 2
    assert 2 < len(some) < len(points)
    assert some.nbytes <= whole.nbytes // 2
