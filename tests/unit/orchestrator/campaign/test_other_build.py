"""A campaign goes on with another build of its components if points computed again are equal bit for bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.campaign_scenes import assert_same_rows, frequency_text, plane_text, scene_of
from support.serial_pool import Notes, campaign_here

import vibroimpact.orchestrator.campaign.other_build as other_build
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis.dataset import Outcome, read_flat, write_dataset
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted
from vibroimpact.orchestrator.campaign.manifest import read_manifest, scene_hash, write_manifest
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

BEGAN, OTHER = "support.busy_runner:SceneRunner", "support.busy_runner:OtherBuildRunner"
INDEPENDENT, UP = frequency_text(40, milliseconds=0.001), frequency_text(40, "up", milliseconds=0.001)
BRANCHES = plane_text(5, 4, milliseconds=0.001)
REAL = """
[body]
{body}
[forcing]
amplitude = {amplitude}
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 5
recorded_periods = 3
[sweep]
"forcing.angular_frequency" = {{ start = 0.7, stop = 0.9, points = 12, path = "up" }}
"""
OSCILLATOR = REAL.format(body="mass = 1.0\nstiffness = 1.0\ndamping_ratio = 0.05", amplitude=0.5)
CHAIN = REAL.format(body='kind = "chain"\nmasses = [1.0, 1.0]\nstiffnesses = 1.0', amplitude=[0.0, 0.5])
COMPONENTS = """
[component.one]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.1, displacement_start = 1.0 }
[component.two]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.1 }
[[connection]]
from = "one.displacement"
to = "two.force"
gain = 0.1
gain_unit = "N/m"
[record]
recorded_time = 2.0
variables = ["one.displacement", "two.displacement"]
rate = 20
[execution]
how = "coupled"
macro_step = 0.1
[sweep]
"one.mass" = { start = 1.0, stop = 2.0, points = 12 }
"""


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schedule, "FIRST_POINTS", 2)
    monkeypatch.setattr(schedule, "MOST_POINTS", 3)


def interrupted(patch: pytest.MonkeyPatch, text: str, folder: Path, runner: str = BEGAN) -> list[Path]:
    """Interrupt a campaign after two chunks of two or three points; return its parts."""
    with pytest.raises(CampaignInterrupted):
        campaign_here(patch, text, folder, runner=runner, most_chunks=2)
    return sorted((folder / "parts").glob("branch-*.nc"))


def change(part: Path, name: str, value: float) -> None:
    """Change the last value of a variable of a part, which stays a sound file."""
    rows = read_flat(part)
    rows[name].values.reshape(-1)[-1] = value
    write_dataset(rows, part)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("text", [INDEPENDENT, UP, BRANCHES])
def test_a_build_that_computes_the_same_goes_on_and_both_are_in_the_dataset(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = Notes()
    interrupted(monkeypatch, text, tmp_path / "campaign")
    campaign_here(monkeypatch, text, tmp_path / "campaign", runner=OTHER, notes=notes)
    campaign_here(monkeypatch, text, tmp_path / "new", runner=BEGAN)
    assert_same_rows(tmp_path / "campaign" / "dataset.nc", tmp_path / "new" / "dataset.nc")
    [line] = notes.lines
    assert line.startswith(
        'The components differ from those that began this campaign (fmu_hashes.Busy was "000'
    )
    attrs = read_flat(tmp_path / "campaign" / "dataset.nc").attrs
    [build] = json.loads(attrs["continued_with"])
    assert line.endswith(f"{build['points_compared']} of its points computed again are equal bit for bit.")
    assert json.loads(attrs["fmu_hashes"]) == {"Busy": "0" * 64}
    assert build["fmu_hashes"] == {"Busy": "1" * 64}
    assert build["versions"].keys() >= {"vibroimpact", "python"}


@pytest.mark.usefixtures("small_chunks")
def test_a_build_that_went_on_once_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = Notes()
    interrupted(monkeypatch, UP, tmp_path)
    with pytest.raises(CampaignInterrupted):
        campaign_here(monkeypatch, UP, tmp_path, runner=OTHER, notes=notes, most_chunks=8)
    for runner in (OTHER, BEGAN):
        with pytest.raises(CampaignInterrupted):
            campaign_here(monkeypatch, UP, tmp_path, runner=runner, notes=notes, most_chunks=1)
    assert len(notes.lines) == 1


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("wider", [INDEPENDENT, frequency_text(79, milliseconds=0.001)])
def test_an_extended_campaign_asks_the_points_that_it_keeps(
    wider: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = Notes()
    campaign_here(monkeypatch, frequency_text(40, milliseconds=0.001), tmp_path / "campaign", runner=BEGAN)
    campaign_here(monkeypatch, wider, tmp_path / "campaign", runner=OTHER, notes=notes)
    campaign_here(monkeypatch, wider, tmp_path / "new", runner=BEGAN)
    assert_same_rows(tmp_path / "campaign" / "dataset.nc", tmp_path / "new" / "dataset.nc")
    manifest = read_manifest(tmp_path / "campaign" / "campaign.json")
    assert manifest is not None
    assert len(manifest.continued_with) == (wider != INDEPENDENT)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("text", [INDEPENDENT, UP])
@pytest.mark.parametrize(
    ("name", "difference"),
    [
        ("final_velocity", "final_velocity of point"),
        ("impact_velocity", "impact_velocity of point"),
        ("displacement_max", "displacement_max of point"),
    ],
)
def test_a_build_that_computes_other_values_is_refused_with_the_first_and_nothing_is_touched(
    name: str, difference: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = interrupted(monkeypatch, text, tmp_path)[-1]
    stored = read_flat(part)[name].values.reshape(-1)[-1]
    last = int(read_flat(part).run_index[-1])
    change(part, name, np.nextafter(stored, 10.0))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(UsageError, match="expected the components and machine") as refused:
        campaign_here(monkeypatch, text, tmp_path, runner=OTHER)
    message = str(refused.value)
    assert f"{difference} {last} (angular_frequency = " in message
    assert f"is stored as {np.nextafter(stored, 10.0)}, computed again as {stored}" in message
    assert "choose another folder, or go on with" in message
    assert "\n" not in message
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.usefixtures("small_chunks")
def test_a_campaign_without_a_point_to_compare_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = interrupted(monkeypatch, INDEPENDENT, tmp_path)
    for part in stored:
        rows = read_flat(part)
        rows.outcome.values[:] = Outcome.crash
        write_dataset(rows, part)
    for _ in range(2):
        with pytest.raises(UsageError, match="no point that could be computed again"):
            campaign_here(monkeypatch, INDEPENDENT, tmp_path, runner=OTHER)
        for part in stored:
            part.unlink(missing_ok=True)


@pytest.mark.usefixtures("small_chunks")
def test_points_that_take_long_are_computed_again_once_at_least(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(other_build, "MOST_SECONDS", 1e-9)
    notes = Notes()
    interrupted(monkeypatch, INDEPENDENT, tmp_path)
    campaign_here(monkeypatch, INDEPENDENT, tmp_path, runner=OTHER, notes=notes)
    assert notes.lines[0].endswith("; 1 of its points computed again are equal bit for bit.")


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("text", [OSCILLATOR, CHAIN, COMPONENTS])
def test_fmus_of_which_only_the_recorded_hash_differs_go_on(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = Notes()
    interrupted(monkeypatch, text, tmp_path, DEFAULT_RUNNER)
    path = tmp_path / "campaign.json"
    manifest = read_manifest(path)
    assert manifest is not None
    hashes = dict.fromkeys(manifest.identity.fmu_hashes, "0" * 64)
    write_manifest(path, scene_of(text), replace(manifest.identity, fmu_hashes=hashes), manifest.runs)
    campaign_here(monkeypatch, text, tmp_path, runner=DEFAULT_RUNNER, notes=notes)
    assert "points computed again are equal bit for bit" in notes.lines[0]
    attrs = read_flat(tmp_path / "dataset.nc").attrs
    assert json.loads(attrs["fmu_hashes"]) == hashes
    assert attrs["scene_hash"] == scene_hash(scene_of(text))
