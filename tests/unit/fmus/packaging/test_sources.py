"""The sources of an export: complete, for one version of FMI; FMPy compiles them to a binary with the same results."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.build import build_platform_binary
from support.component_fmu import VERSIONS
from support.exports import exported

from vibroimpact.fmus import components
from vibroimpact.fmus.packaging.export import Start, export_fmu

STARTS: dict[str, dict[str, Start]] = {
    "Oscillator": {"velocity_start": 0.2, "contact[1].law": "restitution", "contact[1].position": 0.1},
    "Beam": {"forcing.amplitude": 0.5, "forcing.angular_frequency": 150.0, "contact[1].law": "hertz"}
    | {"contact[1].stiffness": 1e6, "contact[1].position": 0.002},
}


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", components())
def test_every_file_that_is_named_is_there_and_nothing_is_included_that_is_not(
    tmp_path: Path, name: str, fmi: str
) -> None:
    path = exported(name, tmp_path / "x.fmu", fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        texts = {
            n.removeprefix("sources/"): archive.read(n).decode()
            for n in archive.namelist()
            if n.startswith("sources/")
        }
        if fmi == "3.0":
            root = ElementTree.fromstring(texts.pop("buildDescription.xml"))
            named = [e.get("name") for e in root.iter("SourceFile")]
        else:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
            lists = [[e.get("name") for e in files] for files in root.iter("SourceFiles")]
            named = lists[0]
            assert all(names == named for names in lists)
    assert sorted(named) == sorted(n for n in texts if n.endswith(".c"))  # type: ignore[type-var]
    assert f"fmi{fmi[0]}.c" in named
    assert not [n for n in texts if "door" in n or n.startswith(f"fmi{5 - int(fmi[0])}")]
    for place, text in texts.items():
        for line in text.splitlines():
            if line.startswith('#include "'):
                included = line.split('"')[1]
                beside = (Path(place).parent / included).as_posix()
                assert included in texts or beside in texts or included.startswith(f"fmi{fmi[0]}"), line


@pytest.mark.parametrize(
    ("name", "fmi"), [("Oscillator", "2.0"), pytest.param("Beam", "3.0", marks=pytest.mark.long)]
)
def test_fmpy_compiles_the_sources_to_the_same_results(tmp_path: Path, name: str, fmi: str) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("FMPy compiles by cmake, and there is none")
    path = export_fmu(name, tmp_path / "x.fmu", fmi=fmi, starts=STARTS[name])
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    # without optimization, which takes most of the time
    build_platform_binary(folder, tmp_path / "build", configuration="Debug")
    (built,) = (p for p in (folder / "binaries").rglob(f"{name}.*") if p.suffix in {".so", ".dylib", ".dll"})
    assert built.is_file()
    one, other = (
        simulate_fmu(str(p), output=["displacement", "contact[1].count"], stop_time=2.0, output_interval=0.01)
        for p in (path, folder)
    )
    assert one["contact[1].count"][-1] > 0
    scale = np.abs(one["displacement"]).max()
    assert np.abs(one["displacement"] - other["displacement"]).max() <= 1e-9 * scale
