"""Archives of scenes of every kind conform to SSP; scenes that SSP cannot express are refused."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd, read_ssv
from lxml import etree
from support.ssp_files import changed
from support.ssp_schema import missing_schema, problems

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.orchestrator.ssp import export_system, load_system

RECORD = {"recorded_time": 2.0, "variables": ["a.displacement", "b.contact[1].count"], "rate": 8}
TWO: dict[str, Any] = {
    "scene": {"title": "Two & more <bodies>"},
    "component": {
        "a": {"fmu": "Chain", "parameters": {"masses": 3, "displacement_start[1]": 0.5}},
        "b": {
            "fmu": "Oscillator",
            "fmi": "2.0",
            "parameters": {"contact[1].law": "restitution", "contact[1].position": 0.1, "mass": 2.0},
        },
    },
    "connection": [
        {"from": "a.displacement", "to": "b.force", "gain": 0.25, "gain_unit": "N/m"},
        {"from": "b.force", "to": "a.force[2]"},
    ],
    "record": RECORD,
    "sweep": {"b.mass": {"values": [2.0, 3.0]}, "connection[1].gain": {"values": [0.25, 0.5]}},
    "execution": {"macro_step": 0.125},
}
TWO["connection"][1] = {"from": "b.acceleration", "to": "a.base_acceleration"}


@pytest.fixture(scope="module", params=["transformation", "component"])
def system(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_system(
        vi.Scene.from_dict(TWO), tmp_path_factory.mktemp("ssp") / "two.ssp", gains=request.param
    )


def test_an_archive_is_valid_and_fmpy_reads_what_the_scene_says(system: Path) -> None:
    described = read_ssd(str(system))
    assert described.name == "Two___more__bodies_"
    parts = {element.name: element for element in described.system.elements}
    assert {name for name in parts if not name.startswith("gain_")} == {"a", "b"}
    assert [(c.name, c.kind) for c in parts["b"].connectors] == [
        ("force", "input"),
        ("acceleration", "output"),
        ("contact[1].count", "output"),
    ]
    given = {
        p.name: (p.type, p.value)
        for p in read_ssv(str(system), parts["b"].parameterBindings[0].source).parameters
    }
    assert given == {
        "contact[1].law": ("Integer", "1"),
        "contact[1].position": ("Real", "0.1"),
        "mass": ("Real", "2.0"),
    }
    names = zipfile.ZipFile(system).namelist()
    assert all(name == "SystemStructure.ssd" or name.startswith("resources/") for name in names)


@pytest.mark.parametrize("variable", ["modal_displacement[1]", "displacement"])
def test_a_structure_has_the_states_that_a_connection_takes(tmp_path: Path, variable: str) -> None:
    ends = {"from": f"a.{variable}", "to": "b.force", "gain": 0.25}
    if variable == "displacement":
        ends["gain_unit"] = "N/m"
    tables = {
        "component": {"a": {"fmu": "Structure"}, "b": {"fmu": "Oscillator"}},
        "connection": [ends],
        "record": {"recorded_time": 1.0, "variables": ["b.displacement"], "rate": 8},
        "execution": {"macro_step": 0.125},
    }
    path = export_system(vi.Scene.from_dict(tables), tmp_path / "system.ssp")
    with zipfile.ZipFile(path) as archive:
        archive.extract("resources/a.fmu", tmp_path)
    names = {v.name for v in read_description(tmp_path / "resources" / "a.fmu").modelVariables}
    assert variable in names
    assert ("modal_displacement[1]" in names) == (variable != "displacement")


def test_an_archive_fits_the_schema_and_leads_nowhere_else(system: Path, tmp_path: Path) -> None:
    assert problems(system, "1.0") == []
    text = zipfile.ZipFile(system).read("SystemStructure.ssd").decode()
    for old, new, told in (
        ('kind="output"', 'kind="outlet"', "outlet"),
        ('source="resources/a.ssv"', 'source="resources/c.ssv"', "source resources/c.ssv"),
        ('endConnector="force"', 'endConnector="mass"', "-> ('b', 'mass')"),
        ('unit="m"', 'unit="cubit"', "unit cubit"),
    ):
        spoilt = changed(system, tmp_path / "s.ssp", "SystemStructure.ssd", text.replace(old, new).encode())
        assert told in "\n".join(problems(spoilt, "1.0")), new


def test_an_archive_of_ssp_2_fits_its_schema_with_local_variables_too(tmp_path: Path) -> None:
    if reason := missing_schema("2.0"):
        pytest.skip(reason)
    recorded = [*RECORD["variables"], "b.relative_acceleration"]
    tables = {**TWO, "record": {**RECORD, "variables": recorded}}
    path = export_system(vi.Scene.from_dict(tables), tmp_path / "s.ssp", ssp="2.0")
    assert problems(path, "2.0") == []
    assert b'name="relative_acceleration" kind="local"' in zipfile.ZipFile(path).read("SystemStructure.ssd")
    assert "resources/a.ssv: version 2.0" in problems(path, "1.0")


def test_what_is_swept_is_one_parameter_set_of_the_system_mapped_to_its_components(
    system: Path, tmp_path: Path
) -> None:
    (binding,) = read_ssd(str(system)).system.parameterBindings
    given = {p.name: float(p.value) for p in read_ssv(str(system), binding.source).parameters}
    springs = {"gain": 0.25} if "resources/gain_1.fmu" in zipfile.ZipFile(system).namelist() else {}
    assert given == {"mass": 2.0, **springs}
    changed = tmp_path / "changed.ssp"
    with zipfile.ZipFile(system) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "resources/system.sweep.ssv":
                content = content.replace(b'"2.0"', b'"7.0"').replace(b'"0.25"', b'"0.75"')
            new.writestr(name, content)
    scene = load_system(changed).scene
    assert {c.name: c for c in scene.components}["b"].parameters["mass"] == 7.0
    assert scene.connections[0].gain == (0.75 if springs else 0.25)


def test_copies_of_the_swept_set_are_a_sweep_and_one_of_them_is_a_point(system: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(system) as archive:
        text = archive.read("resources/system.sweep.ssv").decode()
    springs = "gain" in text
    sets = []
    for mass in ("3.0", "5.0"):
        for gain in ("0.5", "0.75") if springs else ("0.25",):
            sets.append(tmp_path / f"{mass} {gain}.ssv")
            sets[-1].write_text(text.replace('"2.0"', f'"{mass}"').replace('"0.25"', f'"{gain}"'))
    gains = {"connection[1].gain": [0.5, 0.75]} if springs else {}
    swept = {axis.key: list(axis.values) for axis in load_system(system, (), sets).scene.sweep}
    assert swept == {**gains, "b.mass": [3.0, 5.0]}
    one = load_system(system, (), sets[-1:]).scene
    assert one.components[1].parameters["mass"] == 5.0
    assert one.connections[0].gain == (0.75 if springs else 0.25)
    # keys in the set are swept no more; a gain that is no component is in no set
    assert [axis.key for axis in one.sweep] == ([] if springs else ["connection[1].gain"])


def test_the_scene_comes_back_with_its_sweep_and_gives_the_same_dataset(system: Path) -> None:
    ours, theirs = vi.Scene.from_dict(TWO), load_system(system).scene
    assert theirs.sweep == ours.sweep
    before, after = (vi.run(scene, progress=False) for scene in (ours, theirs))
    assert before.sizes["mass"] == 2
    for name in ("a_displacement", "b_contact_1_count", "event_time"):
        assert np.array_equal(before[name], after[name], equal_nan=True), name


def test_every_component_is_self_contained_with_the_start_of_the_scene(system: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(system) as archive:
        archive.extractall(tmp_path)
    a, b = (read_description(tmp_path / "resources" / f"{name}.fmu") for name in "ab")
    assert a.fmiVersion == b.fmiVersion == "2.0"
    starts = {v.name: v.start for v in a.modelVariables}
    assert (starts["masses"], float(starts["displacement_start[1]"])) == ("3", 0.5)
    # b rests in the scene: an export by itself would start displaced, to show motion
    assert float({v.name: v.start for v in b.modelVariables}["displacement_start"]) == 0.0
    # the importer's own ports are left out
    assert not any(v.name.startswith("record.") for v in b.modelVariables)


def test_a_gain_as_a_component_has_the_units_of_its_ends(tmp_path: Path) -> None:
    path = export_system(vi.Scene.from_dict(TWO), tmp_path / "two.ssp", gains="component", fmi="3.0")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
        tree = etree.fromstring(archive.read("SystemStructure.ssd"))
    assert not tree.findall(".//{*}LinearTransformation")
    gain = read_description(tmp_path / "resources" / "gain_1.fmu")
    assert {v.name: v.unit for v in gain.modelVariables} == {
        "gain": "N/m",
        "input": "m",
        "output": "N",
    }
    # always FMI 2.0: for OMSimulator a circle of FMI 3.0 is an algebraic loop, which it cannot solve
    versions = [unpack(tmp_path / "resources" / f"{name}.fmu").fmi_version for name in ("a", "gain_1")]
    assert versions == ["3.0", "2.0"]


def test_one_file_travels_once_and_names_stay_apart_where_case_does_not_count(tmp_path: Path) -> None:
    files = {"one/Gain.fmu": 2.0, "two/gain.fmu": 3.0}
    for name, start in files.items():
        (tmp_path / name).parent.mkdir()
        vi.fmus.export("gain", tmp_path / name, starts={"gain": start})
    tables = {
        "component": {
            "a": {"fmu": str(tmp_path / "one/Gain.fmu")},
            "b": {"fmu": str(tmp_path / "two/gain.fmu")},
            "c": {"fmu": str(tmp_path / "one/Gain.fmu")},
        },
        "record": {"recorded_time": 1.0},
    }
    path = export_system(vi.Scene.from_dict(tables), tmp_path / "s.ssp")
    assert [name for name in zipfile.ZipFile(path).namelist() if name.endswith(".fmu")] == [
        "resources/Gain.fmu",
        "resources/gain_2.fmu",
    ]
    scene = load_system(path).scene
    assert [c.fmu.name for c in scene.components] == ["Gain.fmu", "gain_2.fmu", "Gain.fmu"]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"ssp": "1.1"}, "expected 1.0 or 2.0, got '1.1'"),
        ({"fmi": "1.0"}, "expected 3.0 or 2.0, got '1.0'"),
        ({"gains": "none"}, "expected component or transformation"),
    ],
)
def test_other_versions_are_refused(tmp_path: Path, options: dict[str, str], expected: str) -> None:
    with pytest.raises(UsageError, match=expected):
        export_system(vi.Scene.from_dict(TWO), tmp_path / "s.ssp", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_of_one_body_is_sent_to_the_other_export(tmp_path: Path) -> None:
    scene = vi.Scene.from_dict({"body": {"mass": 1.0, "stiffness": 1.0}, "record": {"recorded_time": 1.0}})
    with pytest.raises(UsageError, match="vibroimpact fmu export"):
        export_system(scene, tmp_path / "s.ssp")


def test_a_connection_from_what_is_no_output_is_refused(tmp_path: Path) -> None:
    tables = {**TWO, "connection": [{"from": "a.damping[1]", "to": "b.force"}], "sweep": {}}
    tables["connection"][0]["gain_unit"] = "N.m/(N.s)"
    with pytest.raises(UsageError, match=r"connection\[1\]\.from: expected an output in SSP 1\.0"):
        export_system(vi.Scene.from_dict(tables), tmp_path / "s.ssp")


def test_a_system_in_python_is_a_scene_with_its_own_fmus(tmp_path: Path) -> None:
    vi.fmus.export("oscillator", tmp_path / "body.fmu", starts={"displacement_start": 0.5})
    tables = {
        "component": {"body": {"fmu": str(tmp_path / "body.fmu")}},
        "record": {"recorded_time": 1.0, "variables": ["body.displacement"], "rate": 4},
        "execution": {"guard": False},
    }
    path = vi.export_ssp(tables, tmp_path / "s.ssp", ssp="2.0")
    swept = vi.import_ssp(path).with_sweep({"body.mass": [1.0, 2.0]})
    assert swept.runs == 2
    written = vi.import_ssp(path, tmp_path / "back.toml")
    assert written.source == str(tmp_path / "back.toml")
    expected = vi.run(tables, progress=False).body_displacement.values
    assert expected[0] == 0.5
    for scene in (path, written, swept.with_sweep({})):
        assert np.array_equal(vi.run(scene, progress=False).body_displacement.values, expected)
    with pytest.raises(UsageError, match="scheduler"):
        vi.campaign(path, tmp_path / "campaign", scheduler="tcp://127.0.0.1:9")


def test_model_exchange_comes_back_as_it_left(tmp_path: Path) -> None:
    tables = {
        "component": {"m": {"fmu": "Oscillator", "run_as": "model_exchange", "parameters": {"mass": 2.0}}},
        "record": {"recorded_time": 1.0, "variables": ["m.displacement"], "rate": 8},
        "execution": {"macro_step": 0.125},
    }
    scene = vi.Scene.from_dict(tables)
    written = export_system(scene, tmp_path / "one.ssp")
    with zipfile.ZipFile(written) as archive:
        assert b'implementation="ModelExchange"' in archive.read("SystemStructure.ssd")
    read = load_system(written).scene
    assert read.components[0].run_as == "model_exchange"
    np.testing.assert_array_equal(*(vi.run(each)["m_displacement"].values for each in (scene, read)))
