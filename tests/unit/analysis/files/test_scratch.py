"""Scratch folders: gone at the end of a process, or swept by the next one; all other folders stay."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from pathlib import Path

import pytest
from harness import warm

from vibroimpact.analysis.files.folder_lock import locked_folder
from vibroimpact.analysis.files.scratch import ScratchFolder, sweep

OWNER = """
import sys, time
from vibroimpact.analysis.files.scratch import ScratchFolder
folder = ScratchFolder("test")
print(folder.name, flush=True)
if sys.argv[1] == "wait":
    time.sleep(60.0)
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder for temporary files of this process and its child processes."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_the_folder_of_a_killed_process_is_swept_and_that_of_a_living_one_is_not(temporary: Path) -> None:
    with warm.start(OWNER, "wait") as owner:
        assert owner.stdout is not None
        folder = Path(owner.stdout.readline().strip())
        (folder / "data").write_text("of a living process")
        sweep()
        assert (folder / "data").exists()
        owner.kill()
    assert folder.exists()
    with ScratchFolder("next") as own:
        assert os.listdir(temporary) == [Path(own.name).name]
    assert not os.listdir(temporary)


def test_a_process_that_ends_leaves_no_folder(temporary: Path) -> None:
    done = warm.run(OWNER, "end")
    assert done.returncode == 0, done.stderr
    assert str(temporary) in done.stdout
    assert not os.listdir(temporary)


def test_a_sweep_takes_only_what_a_dead_owner_left(temporary: Path) -> None:
    campaign = temporary / "vibroimpact-scratch-of-thesis"
    campaign.mkdir()
    with locked_folder(campaign):
        (campaign / "dataset.nc").write_text("data")
    (temporary / "vibroimpact-scratch-file").write_text("of a person")
    ended = temporary / "elsewhere"
    ended.mkdir()
    (temporary / "vibroimpact-scratch-link").symlink_to(ended)
    (ended / ".owner-of-this-scratch-folder").touch()
    before = sorted(temporary.rglob("*"))
    sweep()
    assert sorted(temporary.rglob("*")) == before


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root gives files away")
def test_a_sweep_leaves_folders_of_other_users(temporary: Path) -> None:
    folder = temporary / "vibroimpact-scratch-theirs"
    folder.mkdir()
    (folder / ".owner-of-this-scratch-folder").touch()
    os.chown(folder, 65534, 65534)
    sweep()
    assert folder.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_folders_of_many_processes_that_start_and_die_at_once_do_not_disturb_each_other(
    temporary: Path,
) -> None:
    owners = [warm.start(OWNER, "wait") for _ in range(4)]
    folders = [Path(owner.stdout.readline().strip()) for owner in owners if owner.stdout]
    assert len(set(folders)) == 4
    owners[0].send_signal(signal.SIGTERM)
    owners[0].wait()
    sweep()
    assert sorted(temporary.iterdir()) == sorted(folders[1:])
    for owner in owners:
        owner.kill()
        owner.communicate()
    sweep()
    assert not os.listdir(temporary)
