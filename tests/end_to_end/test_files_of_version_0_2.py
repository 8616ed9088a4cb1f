"""Datasets, folders, journals and services of version 0.2 keep working.

Version 0.2 wrote `version_0_2.zip`. `done` is a finished campaign; `half` was killed after three of its twelve points.
`service` was killed with a job done and another running. `rig.journal` has the samples of a program up to its death.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process, vibroimpact
from support.served import Served

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.analysis.recording import open_recording
from vibroimpact.orchestrator.run.point import ENGINE_OF_ONE_MASS

FILES = Path(__file__).with_name("version_0_2.zip")
with zipfile.ZipFile(FILES) as archive:
    DATASETS = sorted(name for name in archive.namelist() if name.endswith(".nc") and "/" not in name)


@pytest.fixture
def old(tmp_path: Path) -> Path:
    with zipfile.ZipFile(FILES) as archive:
        archive.extractall(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def only_read(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the files for tests that only read them."""
    folder = tmp_path_factory.mktemp("version_0_2")
    with zipfile.ZipFile(FILES) as archive:
        archive.extractall(folder)
    return folder


@pytest.mark.parametrize("name", [*DATASETS, "done"])
def test_a_file_of_each_kind_is_described_and_drawn(only_read: Path, tmp_path: Path, name: str) -> None:
    described = in_this_process("describe", only_read / name)
    assert described.returncode == 0, described.stderr
    drawn = in_this_process("plot", only_read / name, "-o", tmp_path / "figure.png")
    assert drawn.returncode == 0, drawn.stderr
    assert (tmp_path / "figure.png").stat().st_size > 5_000


@pytest.mark.parametrize("name", ["run", "beam", "general"])
def test_a_scene_gives_the_motion_that_it_gave(only_read: Path, tmp_path: Path, name: str) -> None:
    done = in_this_process("run", only_read / f"{name}.toml", "-o", tmp_path / "now.nc")
    assert done.returncode == 0, done.stderr
    before, now = read_flat(only_read / f"{name}.nc"), read_flat(tmp_path / "now.nc")
    assert before.sizes == now.sizes
    assert set(before.variables) == set(now.variables)
    for variable in before.variables:
        if before[variable].dtype.kind == "f" and variable != "point_seconds":
            np.testing.assert_allclose(now[variable], before[variable], rtol=1e-6, atol=1e-9)


def test_a_finished_campaign_has_nothing_left_to_do(old: Path, cluster: str) -> None:
    before = (old / "done" / "dataset.nc").read_bytes()
    done = vibroimpact("campaign", old / "campaign.toml", "-o", old / "done", "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    assert (old / "done" / "dataset.nc").read_bytes() == before


def test_a_half_done_campaign_goes_on_from_its_parts(old: Path, cluster: str) -> None:
    half = old / "half"
    assert json.loads((half / "campaign.json").read_text())["engine"] == ENGINE_OF_ONE_MASS
    [part] = (half / "parts").iterdir()
    kept = read_flat(part).impact_time.values
    done = vibroimpact("campaign", old / "half.toml", "-o", half, "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    resumed = read_flat(half / "dataset.nc")
    assert resumed.sizes["run"] == 12
    np.testing.assert_array_equal(resumed.impact_time[: len(kept)], kept)


def test_a_recording_is_made_of_a_journal(only_read: Path, tmp_path: Path) -> None:
    done = in_this_process("rig", "recover", only_read / "rig.journal", "-o", tmp_path / "now.nc")
    assert done.returncode == 0, done.stderr
    tip = open_recording(tmp_path / "now.nc").channel("tip")
    np.testing.assert_array_equal(tip.values, np.sin(np.arange(1000) / 20.0))


def test_a_service_goes_on_with_the_job_that_ran(old: Path, tmp_path: Path) -> None:
    served = Served(old / "service")
    try:
        with served.client() as service:
            jobs = {job.status["state"]: job for job in service.jobs()}
            assert "done" in jobs
            for job in service.jobs():
                assert job.wait().status["state"] == "done"
                fetched = tmp_path / f"{job.id}.nc"
                job.fetch(fetched)
                assert read_flat(fetched).sizes["run"] in (10, 12)
    finally:
        served.stop()
