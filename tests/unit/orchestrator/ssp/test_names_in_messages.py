"""Messages about a system name the archive and its members, never the folder in which their copies lie."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.fmu_factory import gain as gain_fmu
from support.ssp_files import archive, component, connector, ssd

import vibroimpact as vi
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.orchestrator.ssp import load_system


def written(folder: Path, fmu: Path) -> Path:
    system = ssd(component("a", "resources/x.fmu", connector("y", "output")))
    return archive(folder / "s.ssp", system, {"resources/x.fmu": fmu})


@pytest.mark.parametrize(
    ("member", "content", "expected"),
    [
        ("binaries", None, "s.ssp: resources/x.fmu: expected a binary for this machine"),
        (
            *("binaries", b"no library"),
            "s.ssp: resources/x.fmu: expected a binary that this system can load, got: binaries/",
        ),
    ],
)
def test_errors_of_a_run_name_the_member_of_the_archive(
    tmp_path: Path, member: str, content: bytes | None, expected: str
) -> None:
    whole, broken = gain_fmu(tmp_path), tmp_path / "broken.fmu"
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            text = content if name.startswith(member) else source.read(name)
            if text is not None:
                target.writestr(name, text)
    scene = load_system(written(tmp_path, broken), ["execution.guard=false"]).scene
    with pytest.raises(ComponentFileError) as refused:
        vi.run(scene)
    assert expected in str(refused.value)
    assert "scratch" not in str(refused.value)


def test_errors_of_the_scene_name_the_archive(tmp_path: Path) -> None:
    path = written(tmp_path, gain_fmu(tmp_path))
    more = ("record.rate=4e7", "record.recorded_time=2.0", 'record.variables=["a.y", "a.u", "a.k", "a.b"]')
    sets = [word for one in more for word in ("--set", one)]
    told = in_this_process("run", path, "-o", tmp_path / "x.nc", *sets)
    assert told.returncode == 2
    assert f"{path}: expected results of at most" in told.stderr
    assert "scratch" not in told.stderr
