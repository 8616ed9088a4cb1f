"""Mappings of values, units with two zeros and start times: in systems of other tools, in scenes, there and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.fmu_factory import redescribed, typed
from support.ssp_files import archive, component, connection, entry, factor, mapping, ssd, values

import vibroimpact as vi
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import export_system
from vibroimpact.orchestrator.ssp import load_system as load_any_system
from vibroimpact.orchestrator.ssp.importing import Imported

MODE = 'declaredType="Modes"'
INPUTS = (
    ('<Int32 name="p_Int32" valueReference="106" causality="parameter" variability="fixed" start="0"',
     '<Int32 name="p_Int32" valueReference="106" causality="input" variability="discrete" start="0"'),
    ('<Boolean name="p_Boolean" valueReference="110" causality="parameter" variability="fixed" start="false"',
     '<Boolean name="p_Boolean" valueReference="110" causality="input" variability="discrete" start="false"'),
    ('<Int64 name="p_Int64" valueReference="108" causality="parameter" variability="fixed" start="0"',
     f'<Enumeration name="p_Mode" valueReference="108" causality="input" variability="discrete" start="7" {MODE}'),
    ('<Int64 name="y_Int64" valueReference="208" causality="output" variability="discrete" initial="calculated"',
     f'<Enumeration name="y_Mode" valueReference="208" causality="output" variability="discrete" '
     f'initial="calculated" {MODE}'),
)  # fmt: skip
"""The parameters of some types as inputs."""
CELSIUS = (
    '<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit><Unit name="K"><BaseUnit K="1"/></Unit>'
    '<Unit name="degF"><BaseUnit K="1" factor="0.5555555555555556" offset="255.37222222222223"/></Unit>'
    "</UnitDefinitions><TypeDefinitions>"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("mapped")
    redescribed(typed(made), made / "typed.fmu", *INPUTS)
    for unit in ("degC", "K", "degF"):
        ends = [(f'name="{name}"', f'name="{name}" unit="{unit}"') for name in ("y_Float64", "input")]
        redescribed(made / "typed.fmu", made / f"{unit}.fmu", ("<TypeDefinitions>", CELSIUS), *ends)
    return made


def load_system(path: Path) -> Imported:
    """Load a system whose FMUs run in this process."""
    return load_any_system(path, ["execution.guard=false"])


def value(kind: str, name: str, causality: str) -> str:
    return f'<ssd:Connector name="{name}" kind="{causality}"><ssc:{kind}/></ssd:Connector>'


def table(kind: str, *pairs: tuple[str, str]) -> str:
    inner = "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in pairs)
    return f"<ssc:{kind}MappingTransformation>{inner}</ssc:{kind}MappingTransformation>"


def system_of(folder: Path, tmp_path: Path, name: str, kind: str, given: str, transformation: str) -> Path:
    """Write a system: the output `y_NAME` of one component feeds the input `p_NAME` of another."""
    inner = f"<ssv:{kind} value={given!r}/>".replace("'", '"')
    ends = value(kind, f"y_{name}", "output") + value(kind, f"p_{name}", "input")
    parts = component("a", "typed.fmu", ends, values({f"p_{name}": inner})) + component(
        "b", "typed.fmu", ends
    )
    joined = connection(f"a.y_{name}", f"b.p_{name}", transformation)
    return archive(tmp_path / "s.ssp", ssd(parts, joined), {"typed.fmu": folder / "typed.fmu"})


@pytest.mark.parametrize(
    ("name", "kind", "given", "pairs", "expected"),
    [
        ("Int32", "Integer", "-3", (("-3", "40"), ("40", "2")), 40),
        ("Boolean", "Boolean", "true", (("true", "false"), ("0", "1")), 0),
        ("Mode", "Enumeration", "ramp up", (("ramp up", "ü %s"), ("idle", "idle")), 9007199254740993),
    ],
)
def test_values_are_mapped_and_come_back_from_an_export(
    folder: Path,
    tmp_path: Path,
    name: str,
    kind: str,
    given: str,
    pairs: tuple[tuple[str, str], ...],
    expected: int,
) -> None:
    system = system_of(folder, tmp_path, name, kind, given, table(kind, *pairs))
    loaded = load_system(system).scene
    assert vi.run(loaded)[f"b_y_{name}"].values[-1] == expected
    export_system(loaded, tmp_path / "again.ssp", ssp="2.0")
    again = load_system(tmp_path / "again.ssp").scene
    assert again.connections == loaded.connections
    assert vi.run(again)[f"b_y_{name}"].values[-1] == expected


def test_a_value_that_a_mapping_lacks_is_an_error_of_the_run(folder: Path, tmp_path: Path) -> None:
    system = system_of(folder, tmp_path, "Int32", "Integer", "5", table("Integer", ("1", "2")))
    made = vi.run(load_system(system).scene)
    assert int(made.outcome) == Outcome.error
    assert "a.y_Int32 -> b.p_Int32: expected a value of its mapping (1), got 5" in str(made.message.values)


def test_parameters_are_mapped(folder: Path, tmp_path: Path) -> None:
    change = table("Integer", ("1", "7"))
    given = values({"w": '<ssv:Integer value="1"/>'}, "", mapping(entry("w", "p_Int32", change)))
    system = ssd(component("a", "typed.fmu", value("Integer", "y_Int32", "output"), given))
    path = archive(tmp_path / "p.ssp", system, {"typed.fmu": folder / "typed.fmu"})
    assert load_system(path).scene.components[0].parameters == {"p_Int32": 7}
    path = archive(
        tmp_path / "q.ssp", system.replace('value="1"', 'value="3"'), {"typed.fmu": folder / "typed.fmu"}
    )
    with pytest.raises(SceneError, match="expected a value of its mapping"):
        load_system(path)


@pytest.mark.parametrize(
    ("mapping_of", "expected"),
    [
        ('[[1, 2], [1, 3]]', "expected each value of the output once"),
        ('[[1, "a"]]', "expected a whole number"),
        ('[[1, 2, 3]]', "expected a pair of values"),
        ("[[1, 99999999999]]", "expected a whole number from -2147483648"),
        ("[[1, 2]]\ngain = 2.0", "expected no gain and no offset beside a mapping"),
    ],
)  # fmt: skip
def test_a_wrong_mapping_is_refused(folder: Path, mapping_of: str, expected: str) -> None:
    text = (
        '[component.a]\nfmu = "typed.fmu"\n[[connection]]\nfrom = "a.y_Int32"\nto = "a.p_Int32"\nmapping = '
    )
    (folder / "w.toml").write_text(
        f"{text}{mapping_of}\n[record]\nrecorded_time = 1.0\n[execution]\nmacro_step = 1.0"
    )
    with pytest.raises(SceneError) as refused:
        Scene.from_file(folder / "w.toml")
    assert expected in str(refused.value)


# ---- units with two zeros ----

UNITS = (
    '<ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>'
    '<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>'
)


@pytest.mark.parametrize(
    ("units", "change", "expected"),
    [
        (("degC", "K"), "", 293.15),
        (("K", "degC"), "", 20.0 - 273.15),
        (("degC", "degF"), "", 68.0),
        (("degC", "K"), factor(2.0, 1.0), 587.3),
    ],
)
def test_temperatures_are_converted(
    folder: Path, tmp_path: Path, units: tuple[str, str], change: str, expected: float
) -> None:
    ends = value("Real", "y_Float64", "output") + value("Real", "input", "input")
    given = values({"p_Float64": '<ssv:Real value="20"/>'})
    parts = component("a", f"{units[0]}.fmu", ends, given) + component("b", f"{units[1]}.fmu", ends)
    description = ssd(parts, connection("a.y_Float64", "b.input", change), units=UNITS)
    members = {f"{unit}.fmu": folder / f"{unit}.fmu" for unit in units}
    loaded = load_system(archive(tmp_path / "t.ssp", description, members)).scene
    (link,) = loaded.connections
    assert link.gain * 20.0 + link.offset == pytest.approx(expected, rel=1e-12)
    export_system(loaded, tmp_path / "again.ssp", gains="transformation")
    (again,) = load_system(tmp_path / "again.ssp").scene.connections
    assert (again.gain, again.offset) == (link.gain, link.offset)


def test_a_scene_converts_temperatures_itself(folder: Path) -> None:
    text = (
        '[component.a]\nfmu = "degC.fmu"\n[component.b]\nfmu = "K.fmu"\n[[connection]]\nfrom = "a.y_Float64"\n'
        'to = "b.input"\n{}\n[record]\nrecorded_time = 1.0\n[execution]\nmacro_step = 1.0'
    )
    (folder / "t.toml").write_text(text.format("offset = 273.15"))
    assert Scene.from_file(folder / "t.toml").connections[0].offset == 273.15
    (folder / "t.toml").write_text(text.format(""))
    with pytest.raises(
        SceneError, match=r"same unit at both ends.* Convert it: gain = 1.0, offset = 273.15."
    ):
        Scene.from_file(folder / "t.toml")


# ---- start times ----


def test_a_system_begins_at_its_start_time(folder: Path, tmp_path: Path) -> None:
    ends = value("Real", "y_Float64", "output")
    description = ssd(component("a", "typed.fmu", ends), times='startTime="5.0" stopTime="7.0"')
    path = archive(tmp_path / "s.ssp", description, {"typed.fmu": folder / "typed.fmu"})
    loaded = load_system(path).scene
    times = vi.run(loaded).time.values
    assert (times[0], times[-1]) == (5.0, 7.0)
    export_system(loaded, tmp_path / "again.ssp")
    again = load_system(tmp_path / "again.ssp").scene
    assert (again.start_time, again.record.recorded_time) == (5.0, 2.0)
    np.testing.assert_array_equal(vi.run(again).time.values, times)
