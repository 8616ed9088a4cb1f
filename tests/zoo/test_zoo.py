"""The zoo: each FMU has its row, whatever it does, and each system is tried."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from support import ssp_files
from support.fmu_factory import bouncing_ball, gain

from vibroimpact.fmus.packaging.compiler import compile_library
from vibroimpact.fmus.packaging.platform_names import library_suffix
from zoo.__main__ import fmu_row, write
from zoo._collection import fmus, systems
from zoo._guarded import HANGS, tried
from zoo._table import OTHER, Row, beside_reference, cause_of, difference, table_of_systems, table_of_tools

AT_LOADING = {"crash": "abort();", "hang": "for (;;) {}"}
"""Statements in C that the library of an FMU executes when it is loaded."""
OLD = '<fmiModelDescription fmiVersion="1.0" modelName="old" modelIdentifier="old" generationTool="Dymola 6.0"/>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("zoo")
    gain(made).rename(made / "gain.fmu")
    (made / "again.fmu").write_bytes((made / "gain.fmu").read_bytes())
    bouncing_ball(made).rename(made / "ball.fmu")
    for name, begins in AT_LOADING.items():
        _with_library(made / "gain.fmu", made / f"{name}.fmu", begins)
    with zipfile.ZipFile(made / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", OLD)
    (made / "no.fmu").write_text("no archive")
    (made / "system").mkdir()
    ends = ssp_files.connector("u", "input") + ssp_files.connector("y", "output")
    one = ssp_files.component("one", "../gain.fmu", ends)
    (made / "system" / "SystemStructure.ssd").write_text(ssp_files.ssd(one))
    (made / "gain_ref.csv").write_text("time,y\n0,0\n1,0.5\n")
    return made


def _with_library(source: Path, target: Path, begins: str) -> None:
    """Write a copy of an FMU with another library."""
    code, library = target.with_suffix(".c"), target.with_suffix(library_suffix())
    code.write_text(
        f"#include <stdlib.h>\n__attribute__((constructor)) static void begin(void) {{ {begins} }}"
    )
    compile_library(library, [code], [], strict=False)
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as changed:
        for name in archive.namelist():
            binary = name.startswith("binaries/")
            changed.writestr(name, library.read_bytes() if binary else archive.read(name))


def test_each_content_is_tried_once(folder: Path) -> None:
    names = [path.name for path in fmus(folder)]
    assert names == ["again.fmu", "ball.fmu", "crash.fmu", "hang.fmu", "no.fmu", "old.fmu"]


def test_an_fmu_that_runs_equals_fmpy_bit_by_bit(folder: Path) -> None:
    row = fmu_row(folder / "ball.fmu", folder)
    assert (row.refusal, row.peer_refusal, row.difference, row.passes) == ("", "", 0.0, True)


@pytest.mark.parametrize(
    ("name", "cause"),
    [("crash", "crashes"), ("old", "FMI 1.0"), ("no", "no FMU inside")],
)
def test_what_does_not_run_has_its_cause(folder: Path, name: str, cause: str) -> None:
    row = fmu_row(folder / f"{name}.fmu", folder)
    assert row.cause == cause, row.refusal


def test_a_crash_and_a_hang_end_their_trial_alone(folder: Path) -> None:
    crash = tried("fmpy", folder / "crash.fmu")["refusal"]
    assert (crash, cause_of(crash)) == ("the process ended by SIGABRT", "crashes")
    assert tried("fmpy", folder / "hang.fmu", 3.0)["refusal"] == HANGS.format(3.0)


def test_a_system_in_a_folder_takes_the_fmus_that_it_names_outside(folder: Path, tmp_path: Path) -> None:
    ((name, path),) = systems(folder, tmp_path)
    assert name == "system"
    assert tried("system", path).get("components") == 1


def test_a_difference_is_relative_and_an_event_has_two_right_values() -> None:
    time, twice = np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0, 2.0])
    mine = {"x": np.array([0.0, 7.0, -10.0])}
    assert difference(time, mine, twice, {"x": np.array([0.0, 3.0, 7.0, -10.0])}) == (0.0, "")
    assert difference(time, mine, twice, {"x": np.array([0.0, 3.0, 8.0, -10.0])}) == (0.1, "x")
    assert difference(time, mine, time, {"x": np.zeros(3)}) == (1.0, "x")
    assert difference(time, mine, time, {"x": np.array([0.0, np.nan, -10.0])})[0] == np.inf


def test_a_reference_beside_an_fmu_is_compared(folder: Path) -> None:
    path, time = folder / "gain.fmu", np.array([0.0, 1.0])
    assert beside_reference(path, time, {"y": np.array([0.0, 0.5])}) == 0.0
    assert beside_reference(path, time, {"y": np.array([0.0, 0.75])}) == 0.5
    assert beside_reference(folder / "ball.fmu", time, {"y": time}) is None


def test_tables_count_tools_and_causes(tmp_path: Path) -> None:
    rows = [
        Row("a.fmu", "Dymola", difference=0.0),
        Row("b.fmu", "Dymola", difference=1e-3, passes=False),
        Row("c.fmu", "20-sim", refusal="got FMI 1.0", passes=False),
    ]
    lines = table_of_tools(rows)
    assert lines[2] == "| Dymola | 2 | 1 | 2 | 1 | 1 | 1e-03 |  |  |"
    assert lines[3] == "| 20-sim | 1 | 0 | 0 | 0 | 0 |  |  | 1 FMI 1.0 |"
    assert lines[-1] == "| all | 3 | 1 | 2 | 1 | 1 | 1e-03 |  | 1 FMI 1.0 |"
    assert table_of_systems(["", "", "got FMI 1.0"])[-1] == "| 3 | 2 | 1 FMI 1.0 |"
    assert (
        cause_of("expected a safe FMU, got: member 'a\\b' has a backslash")
        == "names of members with backslashes"
    )
    assert cause_of("a line of no known cause") == OTHER
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- zoo: written by make zoo -->\nold\n<!-- end of zoo -->\nafter\n")
    write(page, "zoo", ["new"])
    assert page.read_text() == "before\n<!-- zoo: written by make zoo -->\nnew\n<!-- end of zoo -->\nafter\n"
