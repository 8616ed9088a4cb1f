"""Scenes, datasets, recordings and campaign folders of version 0.1 keep working, or one line says what to do.

Version 0.1 wrote `version_0_1.zip`. `done` is a finished campaign; `half` lost a part before it was compacted.
`recording.nc` is a decay at 9 rad/s and .3 1/s, `estimates.nc` the estimates from it.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process, vibroimpact
from support.tolerance import SEQUENCE

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import constant_names, read_flat, take_runs, write_dataset
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.point import ENGINE_OF_ONE_MASS

FILES = Path(__file__).with_name("version_0_1.zip")


@pytest.fixture
def old(tmp_path: Path) -> Path:
    with zipfile.ZipFile(FILES) as archive:
        archive.extractall(tmp_path)
    return tmp_path


def test_a_dataset_opens_with_its_coordinates_and_rows(old: Path) -> None:
    campaign = open_dataset(old / "done")
    assert campaign.displacement_range.sizes == {"direction": 2, "angular_frequency": 5}
    np.testing.assert_array_equal(campaign.angular_frequency, [0.7, 0.75, 0.8, 0.85, 0.9])
    assert np.isfinite(campaign.displacement_range).all()
    assert campaign.vibroimpact.impacts(direction="up", angular_frequency=0.9).impact_velocity.min() > 0.0


@pytest.mark.parametrize("name", ["run.nc", "beam.nc", "done", "recording.nc", "estimates.nc"])
def test_a_file_of_each_kind_has_its_figure(old: Path, name: str) -> None:
    done = in_this_process("plot", old / name, "-o", old / "figure.png")
    assert done.returncode == 0, done.stderr
    assert (old / "figure.png").stat().st_size > 5_000


# the beam meets a Hertz stop: each contact has an own error of 1e-10, and later impacts amplify it
@pytest.mark.parametrize(("name", "tolerance"), [("run", SEQUENCE), ("beam", 1e-6)])
def test_a_scene_gives_the_motion_that_it_gave(old: Path, name: str, tolerance: float) -> None:
    done = in_this_process("run", old / f"{name}.toml", "-o", old / "now.nc")
    assert done.returncode == 0, done.stderr
    before, now = read_flat(old / f"{name}.nc"), read_flat(old / "now.nc")
    assert before.sizes["impact"] > 1
    for variable in ("impact_time", "impact_velocity", "displacement_max", "displacement_min"):
        np.testing.assert_allclose(now[variable], before[variable], rtol=tolerance, atol=tolerance)


def test_a_finished_campaign_has_nothing_left_to_do(old: Path, cluster: str) -> None:
    before = (old / "done" / "dataset.nc").read_bytes()
    done = vibroimpact("campaign", old / "campaign.toml", "-o", old / "done", "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    assert (old / "done" / "dataset.nc").read_bytes() == before


def components_of(campaign: Path) -> dict[str, Any]:
    """Return the content of a campaign's manifest."""
    content: dict[str, Any] = json.loads((campaign / "campaign.json").read_text())
    return content


def half_of_this_engine(old: Path, **more: Any) -> Path:
    """Return the half-done campaign with a manifest of the current engine, and `more` changes."""
    half = old / "half"
    (half / "campaign.json").write_text(
        json.dumps(components_of(half) | {"engine": ENGINE_OF_ONE_MASS} | more)
    )
    return half


def refused_with_its_parts_kept(half: Path, old: Path, cluster: str) -> str:
    """Return the one-line refusal of a half-done campaign, after checking that its folder is unchanged."""
    manifest = (half / "campaign.json").read_bytes()
    parts = {path: path.read_bytes() for path in (half / "parts").iterdir()}
    done = vibroimpact("campaign", old / "half.toml", "-o", half, "--scheduler", cluster)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "choose another folder" in done.stderr
    assert {path: path.read_bytes() for path in (half / "parts").iterdir()} == parts
    assert (half / "campaign.json").read_bytes() == manifest
    return done.stderr


def test_a_half_done_campaign_of_the_engine_before_is_refused_in_one_line(old: Path, cluster: str) -> None:
    assert f"engine was 1, is {ENGINE_OF_ONE_MASS}" in refused_with_its_parts_kept(old / "half", old, cluster)


def test_a_half_done_campaign_of_other_components_is_refused_in_one_line(old: Path, cluster: str) -> None:
    said = refused_with_its_parts_kept(half_of_this_engine(old), old, cluster)
    assert "fmu_hashes.body was" in said
    assert "restitution = 0.5) is stored as" in said


def test_a_half_done_campaign_of_another_build_goes_on_where_its_points_are_equal(
    old: Path, cluster: str
) -> None:
    half = half_of_this_engine(old)
    # fused, like the old run: "auto" now chooses lanes, whose last bits differ
    done = vibroimpact("run", old / "half.toml", "--set", "execution.how=fused", "-o", old / "now.nc")
    assert done.returncode == 0, done.stderr
    [part] = (half / "parts").iterdir()
    now = take_runs(read_flat(old / "now.nc"), np.arange(3))
    now = now.drop_vars(constant_names(now))
    write_dataset(now.assign_attrs(read_flat(part).attrs), part)
    done = vibroimpact("campaign", old / "half.toml", "-o", half, "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    assert "3 of its points computed again are equal bit for bit" in done.stderr
    resumed = read_flat(half / "dataset.nc")
    assert resumed.attrs["fmu_hashes"] == json.dumps(components_of(half)["fmu_hashes"])
    assert len(json.loads(resumed.attrs["continued_with"])) == 1
    again = vibroimpact("campaign", old / "half.toml", "-o", half, "--scheduler", cluster)
    assert again.returncode == 0, again.stderr


def test_a_half_done_campaign_goes_on_from_its_parts(old: Path, cluster: str) -> None:
    half = half_of_this_engine(old, fmu_hashes={"body": BodyDriver({}, {}).hashes["body"]})
    [part] = (half / "parts").iterdir()
    kept = read_flat(part).impact_time.values
    done = vibroimpact("campaign", old / "half.toml", "-o", half, "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    resumed = read_flat(half / "dataset.nc")
    assert resumed.sizes["run"] == 6
    np.testing.assert_array_equal(resumed.impact_time[: len(kept)], kept)


def test_a_recording_is_estimated_as_it_was(old: Path) -> None:
    done = in_this_process("estimate", "decay", old / "recording.nc", "-o", old / "now.nc")
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(old / "now.nc") as now, xr.open_dataset(old / "estimates.nc") as before:
        assert "angular_frequency" in before.quantity
        # values of pure rounding, an offset of 4e-9 for example, depend on the versions of numpy and scipy
        np.testing.assert_allclose(now.estimate, before.estimate, rtol=1e-6, atol=1e-12, equal_nan=True)
