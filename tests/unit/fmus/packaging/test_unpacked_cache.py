"""The cache of unpacked FMUs is bounded in size and age; FMUs in use by a living process stay, also under kill -9."""

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
    """Write an FMU whose unpacked size is a little above `size` bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("modelDescription.xml", DESCRIPTION)
        file.writestr("resources/z", path.name.encode() + bytes(size))
    return path


def folders_in(cache: Path) -> list[Path]:
    return sorted(path for path in cache.iterdir() if path.is_dir())


def forgotten(path: Path, age: float = 0.0) -> Path:
    """Unpack an FMU as a process did that ended `age` seconds ago."""
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
    assert folders_in(cache) == sorted([used, notes, new])
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
    assert folders_in(cache) == sorted([folders[0], new])


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
    assert folders_in(cache) == [other]


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
    assert folders_in(cache) == sorted(folders[-2:])


def test_a_folder_that_was_replaced_is_held_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 0)
    folder = unpack(fmu(tmp_path / "M.fmu")).folder
    folder.rename(tmp_path / "elsewhere")
    assert unpack(tmp_path / "M.fmu").folder == folder
    unpack(fmu(tmp_path / "other.fmu"))
    assert folder.exists()


def test_the_files_of_a_folder_are_counted_once(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cache of 3 GB has 330,000 files: counting them took 3.5 s of processor time for each FMU."""
    counted: list[Path] = []
    size = unpacked_cache._size
    monkeypatch.setattr(unpacked_cache, "_size", lambda folder: counted.append(folder) or size(folder))
    folders = [forgotten(fmu(tmp_path / f"{number}.fmu")) for number in range(4)]
    assert counted == folders[:3]
    monkeypatch.setattr(unpacked_cache, "MOST_BYTES", 6000)
    sizes = cache / unpacked_cache.SIZES
    sizes.write_text(
        "0" * 64 + " x\n" + "no\n" + "\x7f" * 9 + sizes.read_text() + f"{folders[0].name} 9" + "9" * 20
    )
    new = unpack(fmu(tmp_path / "new.fmu")).folder
    assert new in folders_in(cache)
    assert len(folders_in(cache)) < 5


def test_sizes_of_folders_that_are_gone_are_forgotten(tmp_path: Path, cache: Path) -> None:
    forgotten(fmu(tmp_path / "one.fmu"))
    sizes = cache / unpacked_cache.SIZES
    sizes.write_text("".join(f"{number:064x} 5\n" for number in range(200)))
    unpack(fmu(tmp_path / "two.fmu"))
    assert len(sizes.read_text().splitlines()) == 1
