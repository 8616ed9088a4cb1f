"""A campaign goes on by its own folder where the files of its bodies are not there any more."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign.manifest import kept_scene

SWEEP = ("--set", 'sweep={"forcing.frequency"={values=[940,950,960]}}', "--set", "record.transient_periods=2")


def test_a_campaign_goes_on_by_its_folder_without_the_files_of_matrices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(EXAMPLES / "bracket", "bracket")
    shutil.copy(EXAMPLES / "bracket.toml", "bracket.toml")
    done = in_this_process("campaign", "bracket.toml", "-o", "out", *SWEEP)
    assert done.returncode == 0, done.stderr
    with xr.open_dataset("out/dataset.nc") as before:
        before.load()
    shutil.rmtree("bracket")
    done = in_this_process("campaign", "bracket.toml", "-o", "out", *SWEEP)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "bracket/bracket.sti.gz: expected a file that can be read" in done.stderr
    assert "`vibroimpact campaign out -o out` goes on without it" in done.stderr
    done = in_this_process("campaign", "bracket.toml", "-o", "new", *SWEEP)
    assert "goes on" not in done.stderr  # nothing is kept there
    done = in_this_process("campaign", "out", "-o", "out")
    assert "Nothing to do: all 3 points" in done.stdout
    Path("out/dataset.nc").unlink()
    done = in_this_process("campaign", "out", "-o", "out")
    assert "3 points computed" in done.stdout
    with xr.open_dataset("out/dataset.nc") as after:
        xr.testing.assert_equal(before.drop_vars("point_seconds"), after.load().drop_vars("point_seconds"))
    kept = kept_scene(Path("out"), ["sweep={}"])
    assert vi.run(kept).displacement_range.size > 0


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match="expected a scene file or the folder of a campaign, got another folder"
    ):
        kept_scene(tmp_path)
    done = in_this_process("campaign", str(tmp_path), "-o", str(tmp_path / "out"))
    assert done.returncode == 2
    assert not (tmp_path / "out").exists()
