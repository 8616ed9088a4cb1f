"""The program that runs an FMU's library without any tool, tried on this machine; `make exchange` tries the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from exchange._cases import difference, made
from exchange._machines import LIBRARIES, HostFailedError, Machine
from vibroimpact.fmus.packaging.platform_names import TARGETS, Platform, this_platform


@pytest.fixture(scope="module")
def here() -> Machine:
    machine = Machine(this_platform())
    if reason := machine.missing():
        pytest.skip(reason)
    return machine


@pytest.fixture(scope="module")
def host(here: Machine, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return here.host(tmp_path_factory.mktemp("host"))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_plain_c_program_runs_an_export_as_our_own_run(
    tmp_path: Path, here: Machine, host: Path, fmi: str
) -> None:
    it = made("oscillator, shaken base", fmi, tmp_path)
    rows = here.run(host, it.path, it.outputs, it.step, len(it.rows))
    assert rows.shape == it.rows.shape
    assert difference(rows, it.rows) <= 1e-9


def test_the_program_says_what_a_library_has_not(tmp_path: Path, here: Machine, host: Path) -> None:
    it = made("impact stop", "3.0", tmp_path)
    with pytest.raises(HostFailedError, match="fmi3DoStep: expected status 0, got 3"):
        here.run(host, it.path, it.outputs, -1.0, 1)


def test_a_machine_whose_programs_cannot_run_here_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows, arm = (
        Machine(Platform("x86_64-windows"), "wine"),
        Machine(Platform("aarch64-linux"), "qemu-aarch64"),
    )
    other = next(name for name in TARGETS if name != this_platform().name)
    assert Machine(Platform(other)).missing() == f"this is no {other}"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert windows.missing() == "wine is not on PATH"
    for runner in ("wine", "qemu-aarch64"):
        (tmp_path / runner).touch(mode=0o755)
    monkeypatch.setattr("exchange._machines.zig_compiler", lambda: ())
    monkeypatch.setenv(LIBRARIES, str(tmp_path / "none"))
    assert windows.missing() == ""
    assert (
        arm.missing() == f"{tmp_path / 'none'} has no C library of aarch64-linux, and {LIBRARIES} names none"
    )
