"""The cache of unpacked FMUs is bounded in size and age, and what a living process uses stays, also under kill -9."""

from __future__ import annotations

import os
import sys
import time
import zipfile
from pathlib import Path

import pytest
from harness import warm

from vibroimpact.fmus.packaging import archive, unpacked_cache
from vibroimpact.fmus.packaging.archive import unpack

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked on Windows")

DESCRIPTION = """<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{t}">
  <CoSimulation modelIdentifier="M"/>
  <ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
  </ModelVariables><ModelStructure/>
</fmiModelDescription>
"""
USER = """
import sys, time
from pathlib import Path
from vibroimpact.fmus.packaging.archive import unpack
print(unpack(Path(sys.argv[1])).folder, flush=True)
time.sleep(60.0)
"""
HALF = """
import sys, time
from pathlib import Path
from vibroimpact.fmus.packaging import archive
def half(path, members, opened, folder):
    print(folder, flush=True)
    time.sleep(60.0)
archive._extract = half
archive.unpack(Path(sys.argv[1]))
"""
FORKED = """
import os, sys, time
from pathlib import Path
from vibroimpact.fmus.packaging.archive import unpack
folder = unpack(Path(sys.argv[1])).folder
if os.fork():
    os._exit(0)
print(os.getpid(), folder, flush=True)
time.sleep(60.0)
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(archive, "ABANDONED_AFTER", -1.0)
    return tmp_path / "cache" / "fmus"


def fmu(path: Path, size: int = 1000) -> Path:
    """Write an FMU whose unpacked size is a little above so many bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("modelDescription.xml", DESCRIPTION)
        file.writestr("resources/z", path.name.encode() + bytes(size))
    return path


def forgotten(path: Path, age: float = 0.0) -> Path:
    """Unpack an FMU as a process that has ended did, so many seconds ago."""
    folder = unpack(path).folder
    unpacked_cache.let_go(folder)
    os.utime(folder, (time.time() - age,) * 2)
    return folder


def test_what_was_not_used_for_a_month_goes_and_what_was_used_stays(tmp_path: Path, cache: Path) -> None:
    old = forgotten(fmu(tmp_path / "old.fmu"), unpacked_cache.MOST_AGE + 100.0)
    used = forgotten(fmu(tmp_path / "used.fmu"), unpacked_cache.MOST_AGE - 100.0)
    notes = cache / "notes"
    notes.mkdir()
    os.utime(notes, (0.0, 0.0))
    new = unpack(fmu(tmp_path / "new.fmu")).folder
    assert sorted(cache.iterdir()) == sorted([used, notes, new])
    assert not old.exists()
    assert unpack(tmp_path / "old.fmu").folder == old
    assert (old / "resources" / "z").read_bytes().startswith(b"old.fmu")


def test_the_longest_unused_go_where_there_is_too_much(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 2_500_000)
    folders = [forgotten(fmu(tmp_path / f"{age}.fmu", 1_000_000), age) for age in (30.0, 10.0)]
    forgotten(tmp_path / "30.0.fmu", 5.0)  # used again
    new = unpack(fmu(tmp_path / "new.fmu", 1_000_000)).folder
    assert sorted(cache.iterdir()) == sorted([folders[0], new])


def test_what_a_living_process_uses_stays_until_it_is_killed(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 0)
    with warm.start(USER, fmu(tmp_path / "used.fmu")) as user:
        assert user.stdout is not None
        folder = Path(user.stdout.readline().strip())
        os.utime(folder, (0.0, 0.0))
        forgotten(fmu(tmp_path / "one.fmu"))
        assert (folder / "resources" / "z").exists()
        user.kill()
    os.utime(folder, (0.0, 0.0))
    other = unpack(fmu(tmp_path / "other.fmu")).folder
    assert list(cache.iterdir()) == [other]


def test_what_a_process_unpacks_stays_until_it_is_killed(tmp_path: Path, cache: Path) -> None:
    with warm.start(HALF, fmu(tmp_path / "half.fmu")) as unpacking:
        assert unpacking.stdout is not None
        folder = Path(unpacking.stdout.readline().strip())
        unpack(fmu(tmp_path / "one.fmu"))
        assert folder.exists()
        unpacking.kill()
    other = unpack(fmu(tmp_path / "other.fmu")).folder
    assert not folder.exists()
    assert other.exists()


def test_a_child_of_a_process_that_has_ended_keeps_what_it_uses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 0)
    with warm.start(FORKED, fmu(tmp_path / "used.fmu")) as parent:
        assert parent.stdout is not None
        child, folder = parent.stdout.readline().split()
        unpack(fmu(tmp_path / "one.fmu"))
        assert Path(folder).exists()
        os.kill(int(child), 9)


def test_a_process_that_runs_no_fmu_holds_the_last_few(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 0)
    monkeypatch.setattr(unpacked_cache, "_most_held", [2])
    folders = [unpack(fmu(tmp_path / f"{number}.fmu")).folder for number in range(5)]
    assert sorted(cache.iterdir()) == sorted(folders[-2:])


def test_a_folder_that_was_replaced_is_held_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 0)
    folder = unpack(fmu(tmp_path / "M.fmu")).folder
    folder.rename(tmp_path / "elsewhere")
    assert unpack(tmp_path / "M.fmu").folder == folder
    unpack(fmu(tmp_path / "other.fmu"))
    assert folder.exists()
