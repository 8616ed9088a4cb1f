"""Every lean FMU in every tool for its version gives our own run to 1e-9, with nothing set and nothing edited."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from exchange._cases import (
    CASES,
    COUNT,
    IMPACT_STOP,
    NAMES,
    PAIRS,
    RATE,
    REPLAY,
    difference,
    made,
    made_pair,
    our_run,
)
from exchange._model_exchange import ALLOWED, STEPS, TOLERANCES, USUAL
from exchange._tools import TOOLS, Tool, run, run_coupled, run_integrated
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description

# tools outside of the extra `exchange` are tried by `make exchange` alone
TRIED = [tool for tool in TOOLS if tool.package and tool.name != "PyFMI"]
QUICK = ("oscillator", "chain of 3", IMPACT_STOP, REPLAY)
SINGLE = [(tool, fmi, name) for tool in TRIED for fmi in tool.versions for name in NAMES]
# FMPy runs all cases here, other tools the quick ones; `make exchange` runs all cases in all tools
SINGLE = [(tool, fmi, name) for tool, fmi, name in SINGLE if tool.name == "FMPy" or name in QUICK]
INTEGRATED = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in STEPS]
COUPLED = [(tool, fmi) for tool in TRIED for fmi in tool.couples]


def skip_where_missing(tool: Tool) -> None:
    if reason := tool.missing():
        pytest.skip(reason)


@pytest.mark.parametrize(
    ("tool", "fmi", "name"), SINGLE, ids=[f"{tool.name}, FMI {fmi}, {name}" for tool, fmi, name in SINGLE]
)
def test_an_export_in_another_tool_is_our_own_run(tmp_path: Path, tool: Tool, fmi: str, name: str) -> None:
    skip_where_missing(tool)
    it = made(name, fmi, tmp_path).read_by(tool, fmi)
    answer = run(tool, it.path, it.outputs, it.step, len(it.rows), tmp_path)
    rows = np.array(answer.rows)
    assert rows.shape == it.rows.shape
    assert np.ptp(it.rows[:, 0]) > 0.0 or name == "impact stop"
    assert difference(rows, it.rows) <= 1e-9
    assert not answer.complaints


@pytest.mark.parametrize("name", CASES)
def test_the_counts_and_speeds_of_a_case_are_those_of_the_impacts_of_its_dataset(name: str) -> None:
    # outputs beyond the time series come from our importer: here they are checked by the table of impacts
    ours, case = our_run(name), CASES[name]
    inside = ours.impacts["impact_time"] <= case.count / case.rate
    assert inside.sum() > 2
    for k in range(1, len(case.tables["stop"]) + 1):
        met = (ours.impacts["impact_contact"] == k) & inside
        speeds = [0.0, *ours.impacts["impact_velocity"].values[met]]
        assert ours.found[f"contact[{k}].count"][-1] == met.sum()
        assert ours.found[f"contact[{k}].last_velocity"][-1] == pytest.approx(speeds[-1], rel=1e-9)


@pytest.mark.parametrize("name", INTEGRATED)
def test_an_integrator_comes_to_our_own_run_as_its_tolerance_falls(tmp_path: Path, name: str) -> None:
    tool = next(tool for tool in TRIED if tool.name == "FMPy")
    skip_where_missing(tool)
    it = made(name, "2.0", tmp_path).integrated(STEPS[name])
    arguments = (tool, it.path, it.outputs, it.step, len(it.rows), tmp_path)
    found = [np.array(run_integrated(*arguments, tolerance).rows) for tolerance in TOLERANCES]
    errors = [difference(rows[it.quiet], it.rows[it.quiet]) for rows in found]
    judged = [
        (error, tolerance) for error, tolerance in zip(errors, TOLERANCES, strict=True) if tolerance < USUAL
    ]
    assert all(error <= ALLOWED * tolerance for error, tolerance in judged)
    assert errors[2] < 0.1 * errors[1] < 0.01 * errors[0]


@pytest.mark.parametrize(("tool", "fmi"), COUPLED, ids=[f"{tool.name}, FMI {fmi}" for tool, fmi in COUPLED])
def test_two_exports_that_another_tool_couples_are_our_own_run(tmp_path: Path, tool: Tool, fmi: str) -> None:
    skip_where_missing(tool)
    name = "a spring between them"  # its ends are both inputs; `make exchange` has the other pair too
    it = made_pair(name, tool, fmi, tmp_path)
    answer = run_coupled(tool, it.fmus, PAIRS[name].connections, it.outputs, 1.0 / RATE, COUNT, tmp_path)
    rows = np.array(answer.rows)
    assert rows.shape == it.rows.shape
    jumps = np.abs(np.diff(it.rows[:, it.outputs.index("b.velocity")]))
    assert jumps.max() > 10.0 * np.median(jumps), "b is expected to hit its stops"
    assert difference(rows, it.rows) <= 1e-9
    assert not answer.complaints


SYSTEM = """\
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="pair" version="1.0"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription">
  <ssd:System name="pair"><ssd:Elements>
    <ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="resources/1.fmu"/>
    <ssd:Component name="b" type="application/x-fmu-sharedlibrary" source="resources/2.fmu"/>
  </ssd:Elements></ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="1"/>
</ssd:SystemStructureDescription>
"""

BOTH_STARTS = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
execution = CosimExecution.from_ssp_file(sys.argv[1], step_size=10**7)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.step()
print(*(observer.last_real_values(index, [int(sys.argv[2])])[0] for index in (0, 1)))
"""


def test_two_exports_of_one_component_are_two_fmus_in_a_system_of_libcosim(tmp_path: Path) -> None:
    # libcosim identifies FMUs by their token, and gave both FMUs the resources, and so the start values, of one
    pytest.importorskip("libcosimpy")
    with zipfile.ZipFile(tmp_path / "pair.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", SYSTEM)
        for place in (1, 2):
            starts = {"displacement_start": float(place), "stiffness": 0.0}
            path = export_fmu("oscillator", tmp_path / f"{place}.fmu", fmi="2.0", starts=starts)
            archive.write(path, f"resources/{place}.fmu")
    (reference,) = (
        v.valueReference for v in read_description(path).modelVariables if v.name == "displacement"
    )
    command = [sys.executable, "-c", BOTH_STARTS, str(tmp_path / "pair.ssp"), str(reference)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert "1.0 2.0" in done.stdout.splitlines()


@pytest.mark.parametrize("named", ["", "/no/such/program"])
def test_a_tool_that_is_not_here_says_where_it_was_looked_for(
    monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    monkeypatch.setenv("PATH", os.devnull)
    monkeypatch.setenv("VIBROIMPACT_NOSUCH", named)
    expected = (
        "VIBROIMPACT_NOSUCH names /no/such/program, which is no program"
        if named
        else "nosuch.linux64 is not on PATH, nor named by VIBROIMPACT_NOSUCH"
    )
    assert Tool("X", ("2.0",), program="nosuch.linux64").missing() == expected
