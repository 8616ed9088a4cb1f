"""Damaged parts are named and computed again; other files in the folder are left alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from support.campaign_scenes import assert_same_rows, frequency_text
from support.serial_pool import Notes, campaign_here

import vibroimpact.orchestrator.campaign.destination as destination
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis.dataset import read_flat, write_dataset
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.fmus.errors import CampaignError, DatasetError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted

TEXT = frequency_text(30, "up-down", milliseconds=0.001)


@pytest.fixture
def half(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a campaign that was interrupted after four parts."""
    with monkeypatch.context() as patch:
        patch.setattr(schedule, "FIRST_POINTS", 5)
        patch.setattr(schedule, "MOST_POINTS", 5)
        with pytest.raises(CampaignInterrupted):
            campaign_here(patch, TEXT, tmp_path / "half", most_chunks=4)
    assert len(parts_of(tmp_path / "half")) == 4
    return tmp_path / "half"


@pytest.fixture
def expected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    campaign_here(monkeypatch, TEXT, tmp_path / "expected")
    return tmp_path / "expected" / "dataset.nc"


def parts_of(folder: Path) -> list[Path]:
    return sorted((folder / "parts").glob("branch-*.nc"))


def flip(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def test_a_flipped_bit_is_found_before_the_part_is_opened_and_its_points_are_computed_again(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged = parts_of(half)[1]
    flip(damaged, damaged.stat().st_size // 2)
    opened: list[str] = []
    opening = netCDF4.Dataset

    def watched(path: str, *arguments: Any, **options: Any) -> Any:
        if Path(path) == damaged and damaged.exists():
            opened.append(path)
        return opening(path, *arguments, **options)

    notes = Notes()
    with monkeypatch.context() as patch:
        patch.setattr(netCDF4, "Dataset", watched)
        with pytest.raises(CampaignInterrupted):
            campaign_here(patch, TEXT, half, most_chunks=0, notes=notes)
    assert not opened
    assert len(notes.lines) == 1
    assert notes.lines[0].startswith(f"{damaged.name} was damaged and is removed; its 5 points come again")
    campaign_here(monkeypatch, TEXT, half)
    assert_same_rows(half / "dataset.nc", expected)


def test_a_part_that_is_damaged_after_it_was_written_is_computed_again_by_the_same_command(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compact, notes, damaged = destination.compact, Notes(), []

    def damage_first(parts: Sequence[Path], *others: Any) -> xr.Dataset:
        if not damaged:
            damaged.append(parts[2])
            flip(parts[2], 5000)
        return compact(parts, *others)

    monkeypatch.setattr(destination, "compact", damage_first)
    campaign_here(monkeypatch, TEXT, half, notes=notes)
    assert f"{damaged[0].name} was damaged and is removed" in notes.lines[0]
    assert_same_rows(half / "dataset.nc", expected)


@pytest.mark.parametrize("hashed", [False, True])
def test_a_part_whose_values_do_not_fit_is_no_dead_end(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch, hashed: bool
) -> None:
    other, notes = parts_of(half)[0], Notes()
    rows = read_flat(other)
    if hashed:
        write_dataset(rows.assign(final_phase=rows.final_phase.assign_attrs(units="m")), other)
    else:
        # flipped bits in a part of version 0.1: times go backwards
        times = rows.impact_time.values
        content = other.read_bytes()[:-LINE_LENGTH]
        assert content.count(times.tobytes()) == 1
        other.write_bytes(content.replace(times.tobytes(), np.negative(times).tobytes()))
    campaign_here(monkeypatch, TEXT, half, notes=notes)
    assert f"{other.name} was damaged and is removed" in notes.lines[0]
    assert_same_rows(half / "dataset.nc", expected)


def test_a_part_of_version_0_1_without_a_hash_is_taken(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in parts_of(half):
        path.write_bytes(path.read_bytes()[:-LINE_LENGTH])
    assert campaign_here(monkeypatch, TEXT, half).resumed == 20
    assert_same_rows(half / "dataset.nc", expected)


def test_parts_that_never_fit_end_in_an_error_that_names_them(
    half: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> None:
        raise DatasetError("these do not fit")

    monkeypatch.setattr(destination, "compact", never)
    with pytest.raises(CampaignError, match="the parts do not fit together: these do not fit"):
        campaign_here(monkeypatch, TEXT, half)
    assert parts_of(half)


def test_a_damaged_dataset_is_one_clear_error_and_computed_again_when_it_is_gone(
    expected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = expected.read_bytes()
    flip(expected, len(sound) // 2)
    with pytest.raises(DatasetError, match=r"the file is damaged.* Delete .*dataset.nc to compute"):
        campaign_here(monkeypatch, TEXT, expected.parent)
    expected.unlink()
    campaign_here(monkeypatch, TEXT, expected.parent)
    (tmp_path / "sound.nc").write_bytes(sound)
    assert_same_rows(expected, tmp_path / "sound.nc")


def test_a_damaged_manifest_that_no_part_carries_is_one_clear_error(
    half: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = half / "campaign.json"
    manifest.write_text(manifest.read_text().replace("restitution = 0.7", "restitution = 0.3"))
    for path in parts_of(half):
        write_dataset(read_flat(path).assign_attrs(campaign_manifest=""), path)
    with pytest.raises(UsageError, match="expected the manifest of a campaign, got a damaged file"):
        campaign_here(monkeypatch, TEXT, half)


def test_what_is_not_of_the_campaign_stays_in_the_folder_of_parts(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = half / "parts"
    (parts / "mynotes.txt").write_text("mine")
    (parts / ".unsaved.tmp").write_text("mine too")
    (parts / "figures").mkdir()
    (parts / "figures" / "thesis.docx").write_text("years of work")
    campaign_here(monkeypatch, TEXT, half)
    assert sorted(path.name for path in parts.iterdir()) == [".unsaved.tmp", "figures", "mynotes.txt"]
    assert (parts / "figures" / "thesis.docx").read_text() == "years of work"
    report = campaign_here(monkeypatch, TEXT, half)
    assert report.resumed == report.runs == 60
    assert_same_rows(half / "dataset.nc", expected)


def test_a_link_to_a_scratch_disk_keeps_what_else_is_there(
    tmp_path: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch, folder = tmp_path / "scratch", tmp_path / "campaign"
    scratch.mkdir()
    folder.mkdir()
    (scratch / "thesis.docx").write_text("years of work")
    (folder / "parts").symlink_to(scratch)
    campaign_here(monkeypatch, TEXT, folder)
    assert [path.name for path in scratch.iterdir()] == ["thesis.docx"]
    assert campaign_here(monkeypatch, TEXT, folder).resumed == 60
    assert_same_rows(folder / "dataset.nc", expected)


def test_files_that_a_killed_command_left_are_taken_away(half: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for left in (half / ".dataset.nc.17.0123abcd.tmp", half / ".campaign.json.17.0123abcd.tmp"):
        left.write_bytes(b"half")
    campaign_here(monkeypatch, TEXT, half)
    assert not list(half.glob(".*.tmp"))
