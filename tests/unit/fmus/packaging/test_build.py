"""Building: choice of the compiler, messages of failures, and dependence on the sources alone."""

import ctypes
import shutil
import zipfile
from functools import partial
from pathlib import Path

import pytest

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging import build as building
from vibroimpact.fmus.packaging.build import (
    BUILT,
    CORE_LIBRARY,
    NATIVE,
    build,
    fingerprint,
    is_current,
    main,
    read_components,
)
from vibroimpact.fmus.packaging.compiler import compile_library, find_compiler
from vibroimpact.fmus.packaging.platform_names import library_suffix


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    return Path(shutil.copytree(NATIVE, tmp_path / "native"))


def keep_one_component(sources: Path) -> None:
    """Reduce a copy of the sources to the Sensor and its part of the core: all sources take twenty times as long."""
    for description in sources.glob("*/variables.toml"):
        if description.parent.name != "sensor":
            shutil.rmtree(description.parent)
    (sensor,) = read_components(sources)
    for path in (sources / "core").rglob("*.c"):
        if not sensor.uses(path.relative_to(sources / "core").as_posix()):
            path.unlink()


def test_an_edit_of_the_c_makes_the_build_out_of_date(sources: Path) -> None:
    assert is_current(BUILT, native=sources)
    source = next((sources / "core").rglob("*.c"))
    source.write_text(source.read_text() + "\n")
    assert not is_current(BUILT, native=sources)
    assert fingerprint(sources) != fingerprint()


def test_a_source_that_moves_makes_the_build_out_of_date(sources: Path) -> None:
    header = sources / "core" / "motion" / "flow.h"
    header.rename(sources / "core" / "contact" / "flow.h")
    assert not is_current(BUILT, native=sources)


def test_an_error_in_the_c_is_told_in_the_compilers_words(sources: Path, tmp_path: Path) -> None:
    keep_one_component(sources)
    (sources / "core" / "zz_wrong.c").write_text("int wrong(void) { return undeclared_name; }\n")
    with pytest.raises(ComponentError, match="undeclared_name"):
        build(tmp_path / "built", native=sources)
    # a failed build does not count as current
    assert not is_current(tmp_path / "built", native=sources)


def test_warnings_stop_the_project_but_not_a_user(tmp_path: Path) -> None:
    source = tmp_path / "warns.c"
    source.write_text("int narrow(double x);\nint narrow(double x) { return x; }\n")
    target = tmp_path / f"warns{library_suffix()}"
    with pytest.raises(ComponentError, match="conversion"):
        compile_library(target, [source], [])
    compile_library(target, [source], [], strict=False)
    assert target.is_file()


def test_a_chosen_compiler_that_does_not_work_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CC", "no-such-compiler --flag")
    with pytest.raises(
        ComponentError, match="VIBROIMPACT_CC: expected a C compiler that works, got 'no-such"
    ):
        find_compiler()


def test_a_machine_without_a_compiler_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VIBROIMPACT_CC", raising=False)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ComponentError, match="pip install ziglang"):
        find_compiler()


def test_the_command_builds_says_what_is_out_of_date_and_exports_what_the_fmu_hides(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    keep_one_component(sources)
    (sources / "core" / "zz_probe.c").write_text("int vi_probe(void);\nint vi_probe(void) { return 42; }\n")
    description = sources / "sensor" / "variables.toml"
    description.write_text(description.read_text().replace("core = [", 'core = ["zz_probe", '))
    monkeypatch.setattr(building, "update_readmes", lambda write=True: ())
    monkeypatch.setattr(building, "build", partial(build, native=sources))
    monkeypatch.setattr(building, "is_current", partial(is_current, native=sources))
    built = tmp_path / "built"
    codes = [main(["--output", str(built), *more]) for more in (["--check"], [], ["--check"])]
    assert codes == [1, 0, 0]
    out, err = capsys.readouterr()
    assert len(err.splitlines()) == 1
    assert "out of date" in err
    written = [Path(line) for line in out.splitlines()]
    assert all(path.is_file() for path in written)

    library, fmu = built / f"{CORE_LIBRARY}{library_suffix()}", built / "fmi3" / "Sensor.fmu"
    assert {library, fmu} <= set(written)
    assert ctypes.CDLL(str(library)).vi_probe() == 42
    with zipfile.ZipFile(fmu) as archive:
        (binary,) = (name for name in archive.namelist() if name.startswith("binaries/"))
        component = ctypes.CDLL(archive.extract(binary, tmp_path))
    assert hasattr(component, "fmi3DoStep")
    assert not hasattr(component, "vi_probe")
