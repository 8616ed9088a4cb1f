"""Adaptive sweeps against uniform ones: they bracket the same jumps with far fewer points, under any disturbance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.borders import borders_found
from support.campaign_process import CampaignProcess
from support.campaign_scenes import assert_same_rows
from support.places import ROOT
from support.serial_pool import campaign_here

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.jumps import jumps_of
from vibroimpact.analysis.landmarks import ImpactOscillator, folds, period_doublings
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import load_scene

FIGURE = ROOT / "examples" / "thesis" / "figure_3_3.toml"
KEY = "forcing.angular_frequency"
AXIS = {"start": 0.6, "stop": 1.6, "path": "up-down"}
TOLERANCE = 1e-5
UNIFORM = 2 * 100_001
"""Points of a uniform sweep up and down with the tolerance as its step."""
SHORT = {"transient_periods": 200, "recorded_periods": 10, "impacts": False, "extrema": True, "strobe": True}


def swept(folder: Path, sweep: dict[str, object], record: dict[str, object] | None = None) -> xr.Dataset:
    """Return the opened campaign of thesis figure 3.3 over another sweep."""
    scene = load_scene(FIGURE)
    chosen = scene.with_values({"record": record}) if record else scene
    with pytest.MonkeyPatch.context() as patch:
        text = chosen.with_sweep(sweep).text
        return open_dataset(campaign_here(patch, text, folder, runner=DEFAULT_RUNNER).dataset)


@pytest.fixture(scope="module")
def figure(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    adaptive = {"tolerance": TOLERANCE, "at_most": 5000}
    return swept(tmp_path_factory.mktemp("figure"), {KEY: AXIS | {"points": 51, "adaptive": adaptive}})


def runs(dataset: xr.Dataset) -> int:
    return int((dataset["run_id"] >= 0).sum())


def test_the_jumps_of_thesis_figure_3_3_are_bracketed_with_hundreds_of_times_fewer_points(
    figure: xr.Dataset,
) -> None:
    jumps = jumps_of(figure)
    assert jumps.sizes["jump"] == 15
    assert (jumps.above - jumps.below > 0.0).all()
    assert (jumps.above - jumps.below <= TOLERANCE).all()
    assert figure.attrs["unresolved_jumps"] == 0
    assert 20 * runs(figure) < UNIFORM
    assert UNIFORM / runs(figure) > 500


def test_brackets_hold_the_closed_forms_of_fold_and_period_doubling(figure: xr.Dataset) -> None:
    oscillator = ImpactOscillator.from_scene(str(figure.attrs["scene"]))
    jumps = jumps_of(figure)
    (up,) = np.flatnonzero((jumps.direction == "up") & (jumps.below > 1.4))
    (fold,) = [limit.angular_frequency for limit in folds(oscillator, 1.3, 1.6)]
    assert jumps.below[up] - 2 * TOLERANCE < fold < jumps.above[up] + 2 * TOLERANCE
    (doubling,) = [limit.angular_frequency for limit in period_doublings(oscillator, 0.9, 1.0)]
    found = jumps.isel(jump=((jumps.direction == "down") & (jumps.period == [2, 1]).all("side")).values)
    # an orbit counts as doubled when its halves differ by 1e-3
    assert np.abs(found.above.values - doubling).min() < 2e-4


def test_every_jump_of_a_uniform_sweep_is_bracketed_between_the_same_two_motions(
    figure: xr.Dataset, tmp_path: Path
) -> None:
    uniform = jumps_of(swept(tmp_path, {KEY: AXIS | {"points": 401}}), jump=0.2)
    adaptive = jumps_of(figure)

    def motion(jumps: xr.Dataset, place: int) -> tuple[object, ...]:
        one = jumps.isel(jump=place)
        # next to an aperiodic motion, counts of impacts depend on the window that the steps of a path hit
        return str(one.direction.values), *one.period.values.tolist()

    step = 1.0 / 400
    for place in range(uniform.sizes["jump"]):
        near = np.flatnonzero(
            (adaptive.above >= uniform.below[place] - step) & (adaptive.below <= uniform.above[place] + step)
        )
        ends = [motion(adaptive, k) for k in near]
        way, below, above = motion(uniform, place)
        # one step of the uniform sweep may pass several jumps
        assert any(one[0] == way and one[1] == below for one in ends), (place, ends)
        assert any(one[0] == way and one[2] == above for one in ends), (place, ends)


def test_a_uniform_sweep_through_a_bracket_jumps_inside_it(figure: xr.Dataset, tmp_path: Path) -> None:
    jumps = jumps_of(figure)
    (up,) = np.flatnonzero((jumps.direction == "up") & (jumps.below > 1.4))
    low, high = float(jumps.below[up]), float(jumps.above[up])
    values = {"start": low - 10 * TOLERANCE, "stop": high + 10 * TOLERANCE, "points": 22, "path": "up"}
    coarse = np.linspace(1.2, values["start"], 40)[:-1].tolist()
    fine = np.linspace(values["start"], values["stop"], 22).tolist()
    (found,) = jumps_of(
        swept(tmp_path, {KEY: {"values": [*coarse, *fine], "path": "up"}}), jump=0.2
    ).above.values
    assert low - TOLERANCE <= found <= high + TOLERANCE


def test_the_borders_of_a_map_are_those_of_a_uniform_one_but_for_islands_between_first_values(
    tmp_path: Path,
) -> None:
    start, gap = {"start": 0.6, "stop": 1.6}, {"start": 0.2, "stop": 1.8}
    cuts, first = 4, (6, 5)
    finest = [(count - 1) * 2**cuts + 1 for count in first]
    adaptive = swept(
        tmp_path / "adaptive",
        {
            KEY: start
            | {"points": first[0], "adaptive": {"tolerance": 0.2 / 2**cuts * 1.01, "at_most": 20_000}},
            "stop[1].position": gap | {"points": first[1], "adaptive": {"tolerance": 0.4 / 2**cuts * 1.01}},
        },
        SHORT,
    )
    uniform = swept(
        tmp_path / "uniform",
        {KEY: start | {"points": finest[0]}, "stop[1].position": gap | {"points": finest[1]}},
        SHORT,
    )
    found = borders_found(adaptive, uniform, cuts)
    assert adaptive.attrs["unresolved_jumps"] == 0
    assert found.pairs > 300
    assert found.missed == 0
    assert found.bracketed > 0.8 * found.pairs
    assert 2 * runs(adaptive) < runs(uniform)


@pytest.mark.parametrize("plane", [False, pytest.param(True, marks=pytest.mark.long)], ids=["path", "plane"])
def test_an_adaptive_campaign_is_the_same_bit_for_bit_with_any_workers_and_after_kill_9(
    plane: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    adaptive = {"tolerance": 1e-3, "at_most": 400}
    axis: dict[str, object] = {KEY: AXIS | {"points": 41, "adaptive": adaptive}}
    if plane:
        axis = {
            KEY: {"start": 0.6, "stop": 1.6, "points": 9, "adaptive": {"tolerance": 0.01, "at_most": 400}},
            "stop[1].position": {"start": 0.6, "stop": 1.4, "points": 5, "adaptive": {"tolerance": 0.02}},
        }
    text = load_scene(FIGURE).with_values({"record": SHORT}).with_sweep(axis).text
    (tmp_path / "scene.toml").write_text(text)
    serial = campaign_here(monkeypatch, text, tmp_path / "serial", runner=DEFAULT_RUNNER)
    runner = "unhurried_lanes" if plane else "UnhurriedRunner"  # a path runs point by point
    killed = CampaignProcess(tmp_path / "scene.toml", tmp_path / "killed", "--workers", "2", runner=runner)
    killed.wait_for_parts(6)
    killed.process.kill()
    killed.end()
    killed.assert_nothing_lives()
    assert not (tmp_path / "killed" / "dataset.nc").exists()
    again = CampaignProcess(tmp_path / "scene.toml", tmp_path / "killed", "--workers", "1", runner=runner)
    code, _, said = again.end()
    assert code == 0, said
    assert_same_rows(serial.dataset, tmp_path / "killed" / "dataset.nc")
