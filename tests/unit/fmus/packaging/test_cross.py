"""FMUs for several machines: choice and place of the libraries, and messages when there are none."""

from __future__ import annotations

import importlib.util
import struct
import zipfile
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.component_fmu import VERSIONS

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging import cross, members
from vibroimpact.fmus.packaging.build import read_components
from vibroimpact.fmus.packaging.cross import chosen_platforms, library_for, universal
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.platform_names import TARGETS, Platform

FOLDERS = {
    "3.0": {name: {name} for name in TARGETS},
    "2.0": {
        "x86_64-linux": {"linux64"},
        "aarch64-linux": {"aarch64-linux"},
        "x86_64-windows": {"win64"},
        "x86_64-darwin": {"darwin64"},
        "aarch64-darwin": {"darwin64"},
    },
}


@pytest.fixture
def release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Pretend that the package contains libraries; their contents do not matter here."""
    folder = tmp_path / "platforms"
    for name in TARGETS:
        (folder / name).mkdir(parents=True)
        (folder / name / f"Oscillator{Platform(name).suffix}").write_bytes(name.encode())
    for module in (cross, members):
        monkeypatch.setattr(module, "SHIPPED", folder)
    return folder


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("names", ["all", "x86_64-windows", " aarch64-linux ,x86_64-darwin,aarch64-linux"])
def test_an_export_has_the_libraries_of_the_platforms_asked_for(
    tmp_path: Path, release: Path, fmi: str, names: str
) -> None:
    path = export_fmu("oscillator", tmp_path / "x.fmu", fmi=fmi, platform=names)
    with zipfile.ZipFile(path) as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    chosen = [platform.name for platform in chosen_platforms(names)]
    assert folders == set().union(*(FOLDERS[fmi][name] for name in chosen))


def test_a_release_makes_exports_for_all_platforms(tmp_path: Path, release: Path) -> None:
    path = export_fmu("oscillator", tmp_path / "x.fmu")
    with zipfile.ZipFile(path) as archive:
        read = {p: archive.read(f"binaries/{p}/Oscillator{Platform(p).suffix}").decode() for p in TARGETS}
    assert read == dict(zip(TARGETS, TARGETS, strict=True))


def test_one_file_of_macos_holds_both_processors() -> None:
    parts = {Platform("x86_64-darwin"): b"intel" * 5000, Platform("aarch64-darwin"): b"arm" * 7}
    whole = universal(parts)
    magic, count = struct.unpack_from(">II", whole)
    assert (magic, count) == (0xCAFEBABE, 2)
    for place, (platform, part) in enumerate(parts.items()):
        processor, _, offset, size, alignment = struct.unpack_from(">5I", whole, 8 + 20 * place)
        assert processor & 0xFF == {"x86_64": 7, "aarch64": 12}[platform.name.split("-")[0]]
        assert offset % (1 << alignment) == 0
        assert whole[offset : offset + size] == part


@pytest.mark.parametrize("names", ["", "windows", "x86_64-linux,amiga", "all,x86_64-linux"])
def test_a_platform_that_is_none_is_refused(names: str) -> None:
    with pytest.raises(UsageError, match="platform: expected all, or some of x86_64-linux"):
        chosen_platforms(names)


def test_without_a_library_and_without_zig_it_is_said_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    find = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "ziglang" else find(name))
    done = in_this_process(
        "fmu", "export", "oscillator", "--platform", "x86_64-windows", "-o", tmp_path / "x.fmu"
    )
    assert done.returncode != 0
    assert "pip install 'vibroimpact[cross]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "x.fmu").exists()


@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="the extra cross is not installed")
@pytest.mark.parametrize("name", TARGETS)
def test_zig_compiles_a_library_for_each_platform_and_it_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    stop = next(c for c in read_components() if c.name == "ImpactStop")
    notes: list[str] = []
    library = library_for(stop, Platform(name), notes.append)
    assert notes == [f"{name}: compiling ImpactStop"]
    assert library_for(stop, Platform(name), notes.append) == library
    assert len(notes) == 1
    starts = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}
    assert library.startswith(starts[Platform(name).system])
    assert b"fmi3DoStep" in library
    assert b"vi_door" not in library


def test_an_error_of_the_compiler_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))

    def fail(*_: object, **__: object) -> bytes:
        raise ComponentError("Oscillator.dll: expected zig to compile it")

    monkeypatch.setattr(cross, "compile_component", fail)
    monkeypatch.setattr(cross, "zig_compiler", lambda: ())
    with pytest.raises(ComponentError, match=r"Oscillator\.dll"):
        library_for(next(c for c in read_components() if c.name == "Oscillator"), Platform("x86_64-windows"))
    assert not list((tmp_path / "cache").rglob("Oscillator*"))
