"""A campaign goes on with another sweep: it keeps every point with equal values, and equals a new campaign."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from support.campaign_scenes import TIMING, assert_same_rows, axis, frequency, swept_text
from support.serial_pool import Notes, campaign_here

import vibroimpact.analysis.dataset.flat_file as flat_file
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import read_flat
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted


def sweep(*axes: str, **options: Any) -> str:
    return swept_text(*axes, mass=0.001, damping_ratio=0.0, **options)


ONE, THREE = axis("forcing.amplitude", [0.5]), axis("forcing.amplitude", [0.5, 0.4, 0.6])


def test_the_files_of_a_cut_off_extension_go_with_the_next_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = sweep(axis("forcing.amplitude", [0.1, 0.2]))
    for text in (small, small, sweep(axis("forcing.amplitude", [0.1, 0.2, 0.3]))):
        left = tmp_path / "campaign" / ".earlier-rows"
        left.mkdir(parents=True, exist_ok=True)
        (left / "000000.nc").write_bytes(b"half a file")
        campaign_here(monkeypatch, text, tmp_path / "campaign")
        assert not left.exists()


GROWN = {
    "twice as fine": (sweep(frequency(101)), sweep(frequency(201)), 101),
    "an appended value": (
        sweep(axis("forcing.amplitude", [0.1, 0.2, 0.3])),
        sweep(axis("forcing.amplitude", [0.1, 0.2, 0.3, 0.25])),
        3,
    ),
    "another axis": (sweep(frequency(11)), sweep(THREE, frequency(11)), 11),
    "another axis, the fastest": (sweep(frequency(11)), sweep(frequency(11), THREE), 11),
    "an axis taken away": (sweep(THREE, frequency(11)), sweep(frequency(11)), 11),
    "axes the other way round": (sweep(THREE, frequency(5)), sweep(frequency(5), THREE), 15),
    "a path up to the first other value": (
        sweep(axis("body.mass", [0.001, 0.002, 0.003, 0.005], path="up")),
        sweep(axis("body.mass", [0.001, 0.002, 0.003, 0.004, 0.005, 0.006], path="up")),
        3,
    ),
    "a path that goes further": (
        sweep(axis("body.mass", [0.001, 0.002, 0.003], path="up")),
        sweep(axis("body.mass", [0.001, 0.002, 0.003, 0.004], path="up")),
        3,
    ),
    "a path down as well": (sweep(frequency(9, "up")), sweep(frequency(9, "up-down")), 9),
    "more branches": (sweep(ONE, frequency(9, "up-down")), sweep(THREE, frequency(9, "up-down")), 18),
    "branches where there was one": (
        sweep(frequency(9, "up-down")),
        sweep(THREE, frequency(9, "up-down")),
        18,
    ),
    "a number that the sweep replaces": (
        sweep(frequency(11)),
        sweep(frequency(11)).replace("angular_frequency = 0.8", "angular_frequency = 0.9"),
        11,
    ),
}


def assert_as_if_new(extended: Path, fresh: Path) -> None:
    """Assert that two datasets and all attributes are bit-identical, except for their timing."""
    assert_same_rows(extended, fresh)
    one, other = (read_flat(path).drop_vars(TIMING) for path in (extended, fresh))
    xr.testing.assert_identical(one, other)


@pytest.mark.parametrize("name", GROWN)
def test_a_finished_campaign_is_extended_as_if_it_were_new(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new, kept = GROWN[name]
    campaign_here(monkeypatch, old, tmp_path / "campaign")
    report = campaign_here(monkeypatch, new, tmp_path / "campaign")
    campaign_here(monkeypatch, new, tmp_path / "new")
    assert report.resumed == kept
    assert report.outcomes.total() == report.runs - kept
    assert_as_if_new(tmp_path / "campaign" / "dataset.nc", tmp_path / "new" / "dataset.nc")
    assert not (tmp_path / "campaign" / "parts").exists()


def interrupted(monkeypatch: pytest.MonkeyPatch, text: str, folder: Path, chunks: int) -> None:
    """Interrupt a campaign after a number of chunks of two or three points."""
    with monkeypatch.context() as patch:
        patch.setattr(schedule, "FIRST_POINTS", 2)
        patch.setattr(schedule, "MOST_POINTS", 3)
        with pytest.raises(CampaignInterrupted):
            campaign_here(monkeypatch, text, folder, most_chunks=chunks)


@pytest.mark.parametrize("name", GROWN)
def test_a_half_done_campaign_is_extended_as_if_it_were_new(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new, _ = GROWN[name]
    interrupted(monkeypatch, old, tmp_path / "campaign", chunks=1)
    with suppress(CampaignInterrupted):
        campaign_here(monkeypatch, new, tmp_path / "campaign", most_chunks=1)
    report = campaign_here(monkeypatch, new, tmp_path / "campaign")
    campaign_here(monkeypatch, new, tmp_path / "new")
    assert report.resumed > 0
    assert_as_if_new(tmp_path / "campaign" / "dataset.nc", tmp_path / "new" / "dataset.nc")


@pytest.mark.parametrize("name", ["an axis taken away", "axes the other way round", "more branches"])
def test_rows_that_are_read_in_stretches_are_the_same(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new, kept = GROWN[name]
    campaign_here(monkeypatch, old, tmp_path / "campaign")
    shutil.copytree(tmp_path / "campaign", tmp_path / "at once")
    with monkeypatch.context() as patch:
        patch.setattr(flat_file, "LARGE_BYTES", 20_000)
        patch.setattr(flat_file, "STRETCH_BYTES", 20_000)
        assert len(list(flat_file.blocks_of(tmp_path / "campaign" / "dataset.nc"))) > 1
        assert campaign_here(patch, new, tmp_path / "campaign").resumed == kept
    campaign_here(monkeypatch, new, tmp_path / "at once")
    assert_as_if_new(tmp_path / "campaign" / "dataset.nc", tmp_path / "at once" / "dataset.nc")
    for one in (tmp_path / "campaign").glob("earlier-*.nc"):
        xr.testing.assert_identical(read_flat(one), read_flat(tmp_path / "at once" / one.name))
    assert sorted(path.name for path in (tmp_path / "campaign").iterdir()) == sorted(
        path.name for path in (tmp_path / "at once").iterdir()
    )


def test_points_that_the_new_sweep_does_not_have_are_not_thrown_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = Notes()
    folder = tmp_path / "campaign"
    campaign_here(monkeypatch, sweep(THREE, frequency(5)), folder)
    before = read_flat(folder / "dataset.nc")
    campaign_here(monkeypatch, sweep(frequency(5)), folder, notes=notes)
    (earlier,) = folder.glob("earlier-*.nc")
    xr.testing.assert_identical(read_flat(earlier).drop_attrs(), before.drop_attrs())
    assert open_dataset(earlier).sizes["amplitude"] == 3
    assert f"10 points of the earlier sweep are not in this one; they stay in {earlier.name}." in notes.lines


@pytest.mark.parametrize(
    ("new", "message"),
    [
        (sweep(frequency(21), restitution=0.8), "stop[1].restitution was 0.7, is 0.8"),
        (
            sweep(axis("forcing.amplitude", [0.4, 0.6]), frequency(11)),
            "sweep.forcing.amplitude.path was absent",
        ),
        (sweep(frequency(11, "down")), 'path was "independent", is "down"'),
        (sweep(axis("forcing.phase", [0.5, 1.0])), "sweep.forcing.angular_frequency.path"),
    ],
)
def test_what_has_no_equal_point_is_refused_and_nothing_is_touched(
    new: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign_here(monkeypatch, sweep(frequency(11)), tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(UsageError) as refused:
        campaign_here(monkeypatch, new, tmp_path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_a_changed_title_keeps_every_point_and_is_that_of_the_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "campaign"
    interrupted(monkeypatch, sweep(frequency(101)), folder, chunks=1)
    renamed = sweep(frequency(101), title="another title")
    assert campaign_here(monkeypatch, renamed, folder).resumed > 0
    campaign_here(monkeypatch, renamed, tmp_path / "new")
    assert_as_if_new(folder / "dataset.nc", tmp_path / "new" / "dataset.nc")
    last = sweep(frequency(101), title="the last title")
    report = campaign_here(monkeypatch, last, folder)
    assert report.resumed == report.runs
    campaign_here(monkeypatch, last, tmp_path / "last")
    assert_as_if_new(folder / "dataset.nc", tmp_path / "last" / "dataset.nc")


def test_a_campaign_that_dies_at_any_step_of_an_extension_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each change of a file is a step: after any number of steps the command can go on with the folder."""
    replace, unlink = os.replace, Path.unlink
    old, new = sweep(THREE, frequency(5)), sweep(frequency(9))
    campaign_here(monkeypatch, new, tmp_path / "new")
    interrupted(monkeypatch, old, tmp_path / "interrupted", chunks=3)
    steps = 0
    while True:
        folder = tmp_path / str(steps)
        shutil.copytree(tmp_path / "interrupted", folder)
        left = [steps]

        def counted(change: Callable[..., Any], left: list[int] = left) -> Callable[..., Any]:
            def step(*arguments: Any, **options: Any) -> Any:
                left[0] -= 1
                if left[0] < 0:
                    raise SystemExit
                return change(*arguments, **options)

            return step

        with monkeypatch.context() as patch, suppress(SystemExit):
            patch.setattr(os, "replace", counted(replace))
            patch.setattr(Path, "unlink", counted(unlink))
            campaign_here(monkeypatch, new, folder)
        ended = left[0] >= 0
        campaign_here(monkeypatch, new, folder)
        assert_as_if_new(folder / "dataset.nc", tmp_path / "new" / "dataset.nc")
        if ended:
            break
        steps += 1
    assert steps > 5


def test_a_full_disk_leaves_the_earlier_sweep_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    campaign_here(monkeypatch, sweep(frequency(5)), tmp_path)
    before = (tmp_path / "dataset.nc").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr("vibroimpact.orchestrator.campaign.earlier_sweep.join_files", full)
        with pytest.raises(
            CampaignError, match=r"could not be kept: No space left on device\. They are where"
        ):
            campaign_here(monkeypatch, sweep(frequency(9)), tmp_path)
    assert (tmp_path / "dataset.nc").read_bytes() == before
    assert campaign_here(monkeypatch, sweep(frequency(9)), tmp_path).resumed == 5
