"""Stores whose runs follow one another: rounds of an adaptive sweep, and points in no order."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from support.campaign_scenes import assert_same_datasets, axis, scene_of, swept_text
from support.serial_pool import Notes, campaign_here
from support.store_scenes import BODY

import vibroimpact.orchestrator.campaign.formats as formats
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset.stores.converting import convert
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.rounds import Rounds
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

FREQUENCY, AMPLITUDE = "forcing.angular_frequency", "forcing.amplitude"
IMPACTING = swept_text(transient_periods=30)


def adaptive(path: str = "independent", at_most: int = 24) -> str:
    return IMPACTING + (
        f'"{FREQUENCY}" = {{ start = 1.2, stop = 1.6, points = 5, path = "{path}", '
        f"adaptive = {{ tolerance = 1e-3, at_most = {at_most}, jump = 0.02 }} }}\n"
    )


PLANE = (
    adaptive().replace("points = 5", "points = 3").replace("1e-3", "0.05")
    + '"stop[1].position" = { values = [0.6, 1.4], adaptive = { tolerance = 0.2 } }\n'
)
KINDS = {
    "rounds": adaptive(),
    "paths": adaptive("up-down"),
    "plane": PLANE,
    "lines": adaptive() + axis(AMPLITUDE, [0.5, 0.4]),
    "unordered": BODY + axis(AMPLITUDE, [0.5, 0.1, 0.4, 0.2, 0.9, 0.3, 0.7, 0.6, 0.8, 1.0]),
    "unordered paths": BODY
    + axis(AMPLITUDE, [0.5, 0.4, 0.6, 0.3])
    + "\n"
    + axis(FREQUENCY, [0.1, 0.2, 0.3, 0.4, 0.5], "up-down"),
}
SHORT = ("rounds", "unordered")


@pytest.fixture(autouse=True)
def _small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "SHARD_POINTS", 8)
    monkeypatch.setattr(schedule, "FIRST_POINTS", 3)


def campaign(
    patch: pytest.MonkeyPatch, text: str, folder: Path, format: str = "zarr", **more: int
) -> CampaignReport:
    return campaign_here(patch, text, folder, runner=DEFAULT_RUNNER, format=format, **more)  # type: ignore[arg-type]  # of tests


def seals_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "seals").glob("shard-*.json")}


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind in SHORT else pytest.mark.long) for kind in KINDS]
)
def test_a_store_of_runs_one_after_the_other_equals_the_file(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = campaign(monkeypatch, KINDS[kind], tmp_path / "store")
    assert len(seals_of(tmp_path / "store")) > 1
    campaign(monkeypatch, KINDS[kind], tmp_path / "file", "netcdf")
    assert_same_datasets(tmp_path / "store", tmp_path / "file")
    for source, target in (("store", "again.nc"), ("file", "again.zarr")):
        convert(tmp_path / source, tmp_path / target).close()
        assert_same_datasets(tmp_path / target, tmp_path / "file")
    again = campaign(monkeypatch, KINDS[kind], tmp_path / "store")
    assert (again.resumed, again.chunks) == (report.runs, [])


@pytest.mark.parametrize("kind", ["rounds", pytest.param("paths", marks=pytest.mark.long)])
def test_shards_are_sealed_as_rounds_end_and_stay_through_every_interruption(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, grew, report = tmp_path / "cut", list[int](), None
    before: dict[str, bytes] = {}
    while report is None:
        with suppress(CampaignInterrupted):
            report = campaign(monkeypatch, KINDS[kind], folder, most_chunks=5)
        sealed = seals_of(folder)
        assert sealed.items() >= before.items()
        before = sealed
        grew.append(len(sealed))
        if report is None:
            with pytest.raises(DatasetError, match="expected a finished store"):
                open_dataset(folder)
    assert 0 < grew[-2] < grew[-1]
    campaign(monkeypatch, KINDS[kind], tmp_path / "file", "netcdf")
    assert_same_datasets(folder, tmp_path / "file")


def test_a_campaign_of_this_process_seals_the_shards_of_its_rounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, found = scene_of(KINDS["paths"]), list[int]()
    stages = Rounds._stages

    def watched(rounds: Rounds, *others: object) -> object:
        for stage in stages(rounds, *others):  # type: ignore[arg-type]  # as given
            found.append(len(seals_of(tmp_path / "store")))
            yield stage

    monkeypatch.setattr(Rounds, "_stages", watched)
    assert run_campaign(scene, tmp_path / "store", format="zarr").workers == 0
    assert max(found) > 0
    run_campaign(scene, tmp_path / "file", format="netcdf")
    assert_same_datasets(tmp_path / "store", tmp_path / "file")


@pytest.mark.parametrize(
    "number", [pytest.param(0, marks=pytest.mark.long), 1, pytest.param(-1, marks=pytest.mark.long)]
)
def test_a_damaged_shard_of_rounds_comes_again(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, notes = tmp_path / "store", Notes()
    runs = campaign(monkeypatch, KINDS["rounds"], folder).runs
    campaign(monkeypatch, KINDS["rounds"], tmp_path / "file", "netcdf")
    damaged = sorted((folder / "dataset.zarr/final_velocity/c").iterdir(), key=lambda path: int(path.name))[
        number
    ]
    damaged.write_bytes(damaged.read_bytes()[:-7])
    report = campaign_here(monkeypatch, KINDS["rounds"], folder, runner=DEFAULT_RUNNER, notes=notes)
    assert "of the store was damaged; its points come again" in notes.lines[0]
    assert 0 < report.resumed < runs == report.runs
    assert_same_datasets(folder, tmp_path / "file")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (1.0, 3.0),
        (3.0, 1.0),
        pytest.param(1.0, 30.0, marks=pytest.mark.long),
        pytest.param(30.0, 1.0, marks=pytest.mark.long),
    ],
)
def test_rounds_that_come_out_otherwise_replace_the_shards_of_other_points(
    before: float, after: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, folder = Rounds._step, tmp_path / "store"

    def jump(factor: float) -> None:
        monkeypatch.setattr(Rounds, "_step", lambda rounds: factor * step(rounds))

    jump(before)
    first = campaign(monkeypatch, KINDS["rounds"], folder).runs
    (folder / "seals/finished.json").unlink()
    jump(after)
    second = campaign(monkeypatch, KINDS["rounds"], folder).runs
    assert (second > first) == (after < before)
    campaign(monkeypatch, KINDS["rounds"], tmp_path / "file", "netcdf")
    assert_same_datasets(folder, tmp_path / "file")


def test_values_are_read_when_they_are_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign(monkeypatch, KINDS["rounds"], tmp_path / "store")
    opened = open_dataset(tmp_path / "store")
    for path in (tmp_path / "store/dataset.zarr/final_velocity/c").iterdir():
        path.write_bytes(b"")
    assert np.isfinite(opened.final_phase.values).all()
    with pytest.raises(DatasetError, match=r"dataset\.zarr"):
        opened.final_velocity.load()
