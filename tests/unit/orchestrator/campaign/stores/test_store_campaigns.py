"""Campaigns whose dataset is a Zarr store: equal to the file, after any interruption, damage and extension."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.campaign_scenes import assert_same_datasets, axis, scene_of
from support.serial_pool import Notes, campaign_here
from support.store_scenes import BODY

import vibroimpact.orchestrator.campaign.formats as formats
import vibroimpact.orchestrator.campaign.schedule as schedule
import vibroimpact.orchestrator.campaign.stores.grown as grown_store
import vibroimpact.orchestrator.campaign.stores.sealing as sealing
import vibroimpact.orchestrator.campaign.workers.pieces as pieces
from vibroimpact.analysis import open_dataset
from vibroimpact.fmus.errors import CampaignError, DatasetError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign
from vibroimpact.orchestrator.campaign.manifest import read_manifest
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

UP = [0.1, 0.2, 0.3, 0.4, 0.5]
FREQUENCY = "forcing.angular_frequency"
MAP = BODY + axis("forcing.amplitude", UP) + "\n" + axis(FREQUENCY, [0.6, 0.8, 1.0, 1.2])
ADAPTIVE = (
    BODY
    + f'"{FREQUENCY}" = {{ start = 0.5, stop = 1.6, points = 9, adaptive = {{ tolerance = 0.02, at_most = 30 }} }}'
)
KINDS = {
    "map": MAP,
    "descending": BODY + axis("forcing.amplitude", UP[::-1]) + "\n" + axis(FREQUENCY, [1.2, 0.8, 1.0]),
    "branches": BODY + axis(FREQUENCY, UP[:3], "up-down") + "\n" + axis("forcing.amplitude", [0.5, 0.6, 0.4]),
    "path": BODY + axis(FREQUENCY, [0.1 * k for k in range(3, 12)], "up-down"),
    "adaptive": ADAPTIVE,
    "one point": BODY.replace("[sweep]\n", ""),
}
LONG_KINDS = ("descending", "branches")


@pytest.fixture(autouse=True)
def _small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    make_shards_small(monkeypatch)


def make_shards_small(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(formats, "SHARD_POINTS", 8)
    patch.setattr(schedule, "FIRST_POINTS", 3)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with campaigns of the map: `expected` as a file, `half` and `finished` as a store."""
    home = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        make_shards_small(patch)
        campaign_here(patch, MAP, home / "expected")
        campaign_here(patch, MAP, home / "finished", format="zarr")
        for name, value in {"MOST_POINTS": 3, "SHARD_SECONDS": 0.0, "LAST_SHARD_SECONDS": 0.0}.items():
            patch.setattr(schedule, name, value)
        with pytest.raises(CampaignInterrupted, match="19 of 20 points are complete"):
            campaign_here(patch, MAP, home / "half", most_chunks=8, format="zarr")
    assert len(seals_of(home / "half")) == 1
    assert len(list((home / "half" / "parts").glob("branch-*.nc"))) == 4
    return home


@pytest.fixture
def expected(made: Path) -> Path:
    return made / "expected"


@pytest.fixture
def half(made: Path, tmp_path: Path) -> Path:
    """Return the folder of a campaign with a sealed shard, a second one in parts, and a part of the third."""
    return shutil.copytree(made / "half", tmp_path / "half")


@pytest.fixture
def finished(made: Path, tmp_path: Path) -> Path:
    """Return the folder of a campaign whose store is finished."""
    return shutil.copytree(made / "finished", tmp_path / "finished")


def seals_of(folder: Path) -> list[Path]:
    return sorted((folder / "seals").glob("shard-*.json"))


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.long if kind in LONG_KINDS else ()) for kind in KINDS]
)
def test_a_store_equals_the_file_of_the_same_campaign(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "store"
    report = campaign_here(monkeypatch, KINDS[kind], folder, format="zarr")
    assert report.dataset == folder / "dataset.zarr"
    campaign_here(monkeypatch, KINDS[kind], tmp_path / "file", format="netcdf")
    assert_same_datasets(folder, tmp_path / "file")
    assert sorted(path.name for path in folder.iterdir()) == [
        ".lock",
        "campaign.json",
        "dataset.zarr",
        "seals",
    ]
    again = campaign_here(monkeypatch, KINDS[kind], folder)
    assert (again.resumed, again.chunks) == (report.runs, [])


@pytest.mark.parametrize(
    "runner", [DEFAULT_RUNNER, pytest.param("support.busy_runner:SceneRunner", marks=pytest.mark.long)]
)
def test_a_shard_that_runs_in_pieces_has_the_same_rows(
    runner: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = BODY + axis("forcing.amplitude", [0.1 + 0.01 * k for k in range(12)])
    campaign_here(monkeypatch, text, tmp_path / "whole", runner=runner)
    monkeypatch.setattr(pieces, "PIECE_POINTS", 3)
    campaign_here(monkeypatch, text, tmp_path / "pieces", runner=runner, format="zarr")
    assert_same_datasets(tmp_path / "pieces", tmp_path / "whole")


def test_an_unfinished_store_is_not_opened_and_the_same_command_goes_on(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(DatasetError, match="expected a finished store"):
        open_dataset(half)
    there = {path: path.read_bytes() for path in seals_of(half)}
    report = campaign_here(monkeypatch, MAP, half)
    assert report.resumed == 19
    assert {path: path.read_bytes() for path in there} == there
    assert_same_datasets(half, expected)


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-7])


SHARD_DAMAGES = [
    ("dataset.zarr/outcome/c/0/0", flip),
    pytest.param("dataset.zarr/final_phase/c/0/0", cut, marks=pytest.mark.long),
    ("dataset.zarr/impact_time/c/0/0", Path.unlink),
    ("seals/shard-000000.json", flip),
]


@pytest.mark.parametrize(("name", "damage"), SHARD_DAMAGES)
def test_a_damaged_shard_is_named_by_its_seal_and_computed_again(
    name: str,
    damage: Callable[[Path], None],
    finished: Path,
    expected: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    notes = Notes()
    damage(finished / name)
    report = campaign_here(monkeypatch, MAP, finished, notes=notes)
    assert notes.lines[0].startswith("shard-000000 of the store was damaged; its points come again: ")
    assert (report.resumed, report.runs) == (12, 20)
    assert_same_datasets(finished, expected)


@pytest.mark.long
def test_a_damaged_shard_of_an_unfinished_store_is_computed_again(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = Notes()
    flip(half / "dataset.zarr/outcome/c/0/0")
    report = campaign_here(monkeypatch, MAP, half, notes=notes)
    assert notes.lines[0].startswith("shard-000000 of the store was damaged; its points come again: ")
    assert report.resumed == 11
    assert_same_datasets(half, expected)


@pytest.mark.parametrize(
    ("name", "damage"), [("zarr.json", flip), ("outcome/zarr.json", Path.unlink), ("amplitude/c/0", cut)]
)
def test_damaged_metadata_are_written_again_and_no_point_is_computed(
    name: str,
    damage: Callable[[Path], None],
    finished: Path,
    expected: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    damage(finished / "dataset.zarr" / name)
    report = campaign_here(monkeypatch, MAP, finished)
    assert (report.resumed, report.chunks) == (20, [])
    assert_same_datasets(finished, expected)


def test_a_shard_that_changes_after_its_seal_is_computed_again_by_the_same_command(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    complete, notes = grown_store.GrownStore.complete, Notes()
    damaged: list[Path] = []

    def damage_first(store: grown_store.GrownStore, *others: Any) -> bool:
        if not damaged:
            damaged.append(half / "dataset.zarr" / "final_velocity" / "c" / "0" / "0")
            flip(damaged[0])
        return complete(store, *others)

    monkeypatch.setattr(grown_store.GrownStore, "complete", damage_first)
    campaign_here(monkeypatch, MAP, half, notes=notes)
    assert notes.lines[0].startswith("shard-000000.json was damaged and is removed; its points come again: ")
    assert_same_datasets(half, expected)


def test_a_half_written_shard_is_computed_again(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seals_of(half)[0].unlink()
    shutil.rmtree(half / "dataset.zarr" / "final_phase" / "c")
    cut(half / "dataset.zarr" / "outcome" / "c" / "0" / "0")
    campaign_here(monkeypatch, MAP, half)
    assert_same_datasets(half, expected)


def test_a_full_disk_ends_in_one_line_and_loses_nothing(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "seal")

    with monkeypatch.context() as patch:
        patch.setattr(sealing, "write_seal", full)
        with pytest.raises(CampaignError, match="Make room or restore access"):
            campaign_here(patch, MAP, half)
    assert len(seals_of(half)) == 1
    campaign_here(monkeypatch, MAP, half)
    assert_same_datasets(half, expected)


def test_a_lost_manifest_is_made_again_from_seals(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.rmtree(half / "parts")
    began = (half / "campaign.json").read_bytes()
    (half / "campaign.json").unlink()
    notes = Notes()
    campaign_here(monkeypatch, MAP, half, notes=notes)
    assert "campaign.json was missing and is made again from 1 part" in notes.lines[0]
    assert (half / "campaign.json").read_bytes() == began
    assert_same_datasets(half, expected)


GROWN = {
    "finer": (
        MAP,
        BODY + axis("forcing.amplitude", UP) + "\n" + axis(FREQUENCY, [0.6, 0.7, 0.8, 1.0, 1.1, 1.2]),
    ),
    "an axis more": (
        BODY + axis(FREQUENCY, [0.6, 0.8]),
        BODY + axis(FREQUENCY, [0.6, 0.8]) + "\n" + axis("forcing.amplitude", [*UP, 0.6]),
    ),
    "fewer": (MAP, BODY + axis("forcing.amplitude", UP[:2]) + "\n" + axis(FREQUENCY, [0.6, 1.2])),
    "a longer path": (
        BODY + axis(FREQUENCY, UP, "up-down"),
        BODY + axis(FREQUENCY, [*UP, 0.6, 0.7], "up-down"),
    ),
    "a sweep of a run": (KINDS["one point"], BODY + axis("forcing.amplitude", [0.4, 0.5])),
}


SHORT = {("finer", None), ("a longer path", 1)}


@pytest.mark.parametrize(
    ("change", "most_chunks"),
    [
        pytest.param(change, most, marks=() if (change, most) in SHORT else pytest.mark.long)
        for change in GROWN
        for most in (1, None)
    ],
)
def test_an_extended_store_equals_a_new_one(
    change: str, most_chunks: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, then = GROWN[change]
    folder, notes = tmp_path / "store", Notes()
    try:
        campaign_here(monkeypatch, first, folder, format="zarr", most_chunks=most_chunks)
    except CampaignInterrupted:
        assert most_chunks is not None
    report = campaign_here(monkeypatch, then, folder, notes=notes)
    assert any("points are kept from the earlier sweep" in line for line in notes.lines)
    assert report.resumed > 0
    campaign_here(monkeypatch, then, tmp_path / "new", format="netcdf")
    assert_same_datasets(folder, tmp_path / "new")


def test_the_format_of_a_campaign_stays(
    half: Path, expected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match="started, zarr, got netcdf"):
        campaign_here(monkeypatch, MAP, half, format="netcdf")
    with pytest.raises(UsageError, match='expected "netcdf" or "zarr", got \'nc\''):
        run_campaign(scene_of(MAP), tmp_path / "new", format="nc")  # type: ignore[arg-type]  # of a careless caller
    with pytest.raises(UsageError, match="started, netcdf, got zarr"):
        campaign_here(monkeypatch, MAP, expected, format="zarr")


def test_the_store_of_another_scene_is_refused_in_one_line(
    half: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = MAP.replace("restitution = 0.7", "restitution = 0.6")
    with pytest.raises(UsageError, match="expected the scene that this campaign was started with"):
        campaign_here(monkeypatch, other, half)
    campaign_here(monkeypatch, other, tmp_path / "other", format="zarr")
    shutil.rmtree(half / "dataset.zarr")
    shutil.copytree(tmp_path / "other" / "dataset.zarr", half / "dataset.zarr")
    with pytest.raises(UsageError, match="expected the store of this campaign, got that of another scene"):
        campaign_here(monkeypatch, MAP, half)
    (half / "campaign.json").unlink()
    shutil.rmtree(half / "seals")
    shutil.rmtree(half / "parts")
    with pytest.raises(UsageError, match="got data without campaign"):
        campaign_here(monkeypatch, MAP, half)


def test_shards_keep_their_size_whatever_the_next_version_prefers(
    half: Path, expected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "SHARD_POINTS", 64)
    campaign_here(monkeypatch, MAP, half)
    manifest = read_manifest(half / "campaign.json")
    assert manifest is not None
    assert manifest.shard_points == 8
    assert len(seals_of(half)) == 3
    assert_same_datasets(half, expected)


def test_a_title_changes_in_a_finished_store(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign_here(monkeypatch, ADAPTIVE, tmp_path / "whole", format="zarr")
    for text, folder in ((MAP, finished), (ADAPTIVE, tmp_path / "whole")):
        report = campaign_here(monkeypatch, text.replace("a store", "another title"), folder)
        assert not report.chunks
        with open_dataset(folder) as dataset:
            assert dataset.attrs["title"] == "another title"
        assert not campaign_here(monkeypatch, text, folder).chunks


def test_a_store_is_the_default_for_large_sweeps_only() -> None:
    small = scene_of(MAP)
    large = scene_of(
        BODY
        + '"forcing.amplitude" = { start = 0.1, stop = 0.9, points = 4000 }\n'
        + f'"{FREQUENCY}" = {{ start = 0.6, stop = 1.6, points = 2500 }}'
    )
    assert (formats.default_format(small), formats.default_format(large)) == ("netcdf", "zarr")


def test_a_shard_of_many_recorded_periods_has_fewer_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    few, many = (scene_of(MAP.replace("recorded_periods = 2", f"recorded_periods = {n}")) for n in (2, 200))
    assert formats.shard_points_of(few) <= 2**20
    assert formats.shard_points_of(few) == 128 * formats.shard_points_of(many)
