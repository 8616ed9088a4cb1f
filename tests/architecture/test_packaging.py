"""The wheel made from the sdist is complete, and works without the rest of the project."""

import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from support.places import ROOT

from vibroimpact.fmus import components
from vibroimpact.fmus.packaging.build import BUILT, NATIVE, compile_component, read_components

PACKAGES = ("fmus", "orchestrator", "analysis", "hardware", "service")


def run(*command: str, cwd: Path, **environment: str) -> str:
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    result = subprocess.run(command, cwd=cwd, env=inherited | environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(folder), cwd=ROOT)
    (path,) = folder.glob("*.tar.gz")
    return path


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (source,) = (path for path in folder.iterdir() if path.is_dir())
    shutil.copytree(
        BUILT, source / "fmus" / "built"
    )  # current: an installation of this checkout has compiled it
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder), cwd=source)
    (path,) = folder.glob("*.whl")
    return path


def test_the_sdist_has_the_sources_of_all_packages_and_nothing_built(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    for package in PACKAGES:
        assert f"{package}/__init__.py" in names
    assert "fmus/native/oscillator/variables.toml" in names
    assert {"LICENSE", "CHANGELOG.md"} <= set(names)
    left_out = (".editable", ".venv", "fmus/built", ".git/")
    assert [name for name in names if name.startswith(left_out)] == []


def test_the_wheel_has_all_packages_and_the_fmus_and_is_for_one_platform(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for package in PACKAGES:
        assert f"vibroimpact/{package}/__init__.py" in names
    for component in components():
        assert f"vibroimpact/fmus/built/fmi3/{component}.fmu" in names
        assert f"vibroimpact/fmus/built/fmi2/{component}.fmu" in names
    assert "vibroimpact/fmus/LICENSE" in names
    for path in (ROOT / "service" / "page").iterdir():
        assert f"vibroimpact/service/page/{path.name}" in names
    for path in (ROOT / "examples").glob("*.toml"):
        assert f"vibroimpact/service/examples/{path.name}" in names
    assert {"vibroimpact/__init__.py", "vibroimpact/simulation.py", "vibroimpact/py.typed"} <= names
    # the binaries bind it to a platform, but to no version of Python
    assert "-py3-none-" in wheel.name
    assert not wheel.name.endswith("-any.whl")


@pytest.mark.parametrize("name", [pytest.param("Oscillator", marks=pytest.mark.long), "Gain"])
def test_a_library_compiled_twice_in_different_places_has_the_same_bytes(name: str, tmp_path: Path) -> None:
    # one set of files that are optimized together, and one set of others
    elsewhere = tmp_path / "native"
    shutil.copytree(NATIVE, elsewhere)
    (component,) = (each for each in read_components(elsewhere) if each.name == name)
    with zipfile.ZipFile(BUILT / "fmi3" / f"{name}.fmu") as archive:
        (library,) = (member for member in archive.namelist() if member.startswith("binaries/"))
        assert archive.read(library) == compile_component(component, elsewhere)


def test_the_wheel_works_in_a_fresh_environment(wheel: Path, tmp_path: Path) -> None:
    environment = tmp_path / "venv"
    venv.create(environment)
    python = str(environment / ("Scripts" if sys.platform == "win32" else "bin") / "python")
    # the pip of these tests: a pip of the environment's own would take longer than all else here
    pip = (sys.executable, "-m", "pip", "--python", python)
    run(*pip, "install", "--quiet", "--no-index", "--no-deps", str(wheel), cwd=tmp_path)
    # finding the FMUs takes only the standard library, so the other dependencies may be missing
    code = (
        "from vibroimpact.fmus import components, fmu_path; "
        "print(*(fmu_path(name, version) for name in components() for version in ('3.0', '2.0')))"
    )
    paths = [Path(p) for p in run(python, "-c", code, cwd=tmp_path).split()]
    assert len(paths) == 2 * len(components())
    assert all(path.is_file() and path.is_relative_to(environment) for path in paths)
