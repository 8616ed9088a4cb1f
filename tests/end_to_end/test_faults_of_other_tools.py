"""Known faults of other tools, one by one: `run`, `check` and `fmu check` accept each alike, with its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from support import fmu_factory
from support.command_line import in_this_process
from support.fmu_factory import GAIN_SCENE, redescribed

from vibroimpact.analysis.dataset import read_flat

ROOT = '<fmiModelDescription fmiVersion="2.0"'
EXPERIMENT = '<DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>'
ANNOTATIONS = (
    '<VendorAnnotations><Tool name="Dymola"><GraphicsGroup coordinateSystem="1"/>'
    '<InputSmootherOptions a="1"/></Tool></VendorAnnotations>'
)
UNKNOWNS = """<InitialUnknowns>
      <Unknown index="2" dependencies="1 3 4"/>
    </InitialUnknowns>"""
ENUMERATION = (
    '<ScalarVariable name="mode" valueReference="9" causality="local"><Enumeration declaredType="E"/>'
    "</ScalarVariable>"
)
TYPES = (
    '<TypeDefinitions><SimpleType name="E"><Enumeration><Item name="a" value="1"/></Enumeration></SimpleType>'
    "</TypeDefinitions>"
)
OFFSET = 'name="b" valueReference="4" causality="parameter"'


@dataclass(frozen=True)
class Fault:
    """Changes of a description as a tool writes it, and the expected remark; empty without one."""

    changes: tuple[tuple[str, str], ...]
    remark: str = ""


FAULTS = {
    "namespaces of Dymola": Fault(
        ((ROOT, f'{ROOT} xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="x.xsd"'),)
    ),
    "annotations of Dymola": Fault(((EXPERIMENT, f"{EXPERIMENT}{ANNOTATIONS}"),)),
    "no InitialUnknowns": Fault(((UNKNOWNS, ""),), "expected its unknowns of initialization, got none of y"),
    "Enumeration of Simulink": Fault(
        ((EXPERIMENT, f"{TYPES}{EXPERIMENT}"), ("</ModelVariables>", f"{ENUMERATION}</ModelVariables>")),
        "of a local of type Enumeration, got none. Read as discrete.",
    ),
    "parameter of pythonfmu": Fault(
        (('causality="parameter" variability="tunable" initial="exact"', 'causality="parameter"'),),
        "of a parameter of type Real, got none. Read as fixed.",
    ),
    "parameter that is constant": Fault(
        ((f'{OFFSET} variability="tunable"', f'{OFFSET} variability="constant"'),),
        "variable b: expected a variability of a parameter, got constant. No value can be given to it.",
    ),
    "start of what is calculated": Fault(
        (("<Real/>", '<Real start="7"/>'),),
        "variable y: expected no start value of what is calculated, got one. It is not used.",
    ),
    "unit -": Fault(
        (("<Real/>", '<Real unit="-"/>'),),
        "variable y: expected a unit that is defined, got '-'. Read as a number without a unit.",
    ),
}  # fmt: skip


def commands_take(folder: Path, remark: str, *, by_loading: bool = False) -> None:
    """Run, check and strictly `fmu check` the FMU of a folder; each has to accept it, with remark and numbers."""
    scene, fmu = folder / "s.toml", folder / "g.fmu"
    scene.write_text(GAIN_SCENE)
    done = in_this_process("run", scene, "-o", folder / "r.nc", "--strict")
    assert done.returncode == 0, done.stderr
    has_note = "note: g.fmu: 1 remark on its description" in done.stderr
    assert has_note == bool(remark and not by_loading)
    assert read_flat(folder / "r.nc").g_y.values.tolist() == pytest.approx([6.0] * 11)
    assert in_this_process("check", scene, "--strict").returncode == 0
    checked = in_this_process("fmu", "check", fmu, "--strict")
    assert checked.returncode == 0, checked.stderr
    said = [line.removeprefix(f"{fmu}: ") for line in checked.stdout.splitlines() if "remark: " in line]
    assert len(said) == bool(remark)
    assert remark in "".join(said)
    assert "may run wrong" not in checked.stdout + done.stderr


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_of_a_tool_is_a_remark_at_most_in_every_command(kind: str, tmp_path: Path) -> None:
    redescribed(fmu_factory.gain(tmp_path), tmp_path / "g.fmu", *FAULTS[kind].changes)
    commands_take(tmp_path, FAULTS[kind].remark)


def test_an_fmu_that_does_not_check_its_token_is_a_remark_of_who_loads_it(tmp_path: Path) -> None:
    fmu_factory.gain(tmp_path, token=fmu_factory.ANY_TOKEN).rename(tmp_path / "g.fmu")
    remark = "expected no instance for a wrong token, got one: its token is not checked."
    commands_take(tmp_path, remark, by_loading=True)


@pytest.mark.parametrize("guard", ["false", "true"])
def test_an_fmu_of_another_token_is_refused_by_every_command_with_one_exit_code(
    guard: str, tmp_path: Path
) -> None:
    redescribed(fmu_factory.gain(tmp_path), tmp_path / "g.fmu", ('guid="{', 'guid="{another '))
    scene, dataset = tmp_path / "s.toml", tmp_path / "r.nc"
    scene.write_text(GAIN_SCENE.replace("guard = false", f"guard = {guard}"))
    for command in (("run", scene, "-o", dataset), ("check", scene), ("fmu", "check", tmp_path / "g.fmu")):
        refused = in_this_process(*command)
        assert refused.returncode == 2, refused.stderr
        assert "made no instance" in refused.stderr or "expected an instance for the token" in refused.stderr
    assert not dataset.exists()
