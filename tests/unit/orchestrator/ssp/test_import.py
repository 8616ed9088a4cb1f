"""Systems of other tools as scenes: nested systems, units, start values, parameter sets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.ssp_files import (
    archive,
    changed,
    component,
    connection,
    connector,
    entry,
    factor,
    mapping,
    real,
    ssd,
    ssv,
    system,
    values,
)

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.packaging.description import UnitDefinition
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import export_system, import_system, load_system, opened_scene

MILLIMETRE = UnitDefinition("mm", {"m": 1}, 1e-3)
METRE = UnitDefinition("m", {"m": 1})
MM = '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'
BODY = connector("displacement", "output") + connector("force", "input")
GAIN = connector("input", "input") + connector("output", "output")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs without a mark of this package."""
    folder = tmp_path_factory.mktemp("fmus")
    units = {"input": MILLIMETRE, "output": MILLIMETRE}
    return {
        "resources/body.fmu": export_fmu("oscillator", folder / "body.fmu", fmi="2.0", starts={"mass": 2.0}),
        "resources/plain.fmu": export_fmu("gain", folder / "plain.fmu", fmi="2.0"),
        "resources/small.fmu": export_fmu("gain", folder / "small.fmu", fmi="2.0", units=units),
    }


def read(folder: Path, fmus: dict[str, Path], description: str) -> Scene:
    return load_system(archive(folder / "system.ssp", description, fmus)).scene


def body(bindings: str = "", name: str = "body") -> str:
    return component(name, "resources/body.fmu", BODY + connector("mass", "parameter"), bindings)


def test_systems_in_systems_become_one_with_the_product_of_their_gains(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    inner = system(
        "rig",
        body(),
        # ends may be written in either order
        connection("body.force", "push", factor(3.0)) + connection("body.displacement", "moved", factor(0.5)),
        connectors=connector("push", "input") + connector("moved", "output"),
    )
    outer = inner + component("law", "resources/plain.fmu", GAIN)
    joined = connection("rig.moved", "law.input", factor(2.0)) + connection("law.output", "rig.push")
    general = read(tmp_path, fmus, ssd(outer, joined))
    assert [(c.name, c.fmu.name) for c in general.components] == [
        ("rig_body", "body.fmu"),
        ("law", "plain.fmu"),
    ]
    assert {(c.source, c.target): c.gain for c in general.connections} == {
        (("rig_body", "displacement"), ("law", "input")): 1.0,
        (("law", "output"), ("rig_body", "force")): 3.0,
    }


def test_a_number_changes_its_unit_with_the_units_of_its_ends(tmp_path: Path, fmus: dict[str, Path]) -> None:
    elements = body() + component("law", "resources/small.fmu", GAIN)
    joined = connection("body.displacement", "law.input", factor(3.0))
    (link,) = read(tmp_path, fmus, ssd(elements, joined)).connections
    assert (link.gain, link.gain_unit) == (3000.0, "mm/m")
    suppressed = connection("body.displacement", "law.input", factor(3.0), 'suppressUnitConversion="true"')
    (link,) = read(tmp_path, fmus, ssd(elements, suppressed)).connections
    assert (link.gain, link.gain_unit) == (3.0, "mm/m")


def test_units_of_connectors_on_the_way_are_passed_through(tmp_path: Path, fmus: dict[str, Path]) -> None:
    inner = system(
        "rig",
        body(),
        connection("body.displacement", "moved"),
        connectors=connector("moved", "output", "mm"),
    )
    outer = inner + component("law", "resources/small.fmu", GAIN)
    (link,) = read(tmp_path, fmus, ssd(outer, connection("rig.moved", "law.input"), units=MM)).connections
    assert link.gain == pytest.approx(1000.0, rel=1e-15)


def test_a_gain_from_metres_to_newtons_is_taken_as_it_is(tmp_path: Path, fmus: dict[str, Path]) -> None:
    elements = body(name="a") + body(name="b")
    joined = connection("a.displacement", "b.force", factor(0.1))
    (link,) = read(tmp_path, fmus, ssd(elements, joined)).connections
    assert (link.gain, link.gain_unit) == (0.1, "N/m")


def test_an_outer_binding_goes_before_an_inner_one_and_a_later_one_before_an_earlier(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    own = values({"mass": real(1.0), "stiffness": real(5.0), "damping": real(0.1)})
    inner = system("rig", body(own), bindings=values({"body.mass": real(2.0), "body.stiffness": real(6.0)}))
    outermost = values({"stiffness": real(7.0)}, prefix="rig.body.") + values({"rig.body.mass": real(3.0)})
    general = read(tmp_path, fmus, ssd(inner, bindings=outermost))
    assert dict(general.components[0].parameters) == {"mass": 3.0, "stiffness": 7.0, "damping": 0.1}


def test_a_parameter_is_renamed_converted_and_handed_on_by_a_connector(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    renamed = mapping(entry("m", "mass", factor(2.0)), entry("start", "displacement_start"))
    given = values({"m": real(1.5), "start": real(4.0, "mm"), "stiffness": real(9.0)}, "", renamed, MM)
    general = read(tmp_path, fmus, ssd(body(given)))
    # with a mapping only the mapped parameters are applied
    assert dict(general.components[0].parameters) == {"mass": 3.0, "displacement_start": 0.004}
    inner = system(
        "rig",
        body(),
        connection("heaviness", "body.mass", factor(10.0)),
        connectors=connector("heaviness", "parameter"),
    )
    general = read(tmp_path, fmus, ssd(inner, bindings=values({"rig.heaviness": real(0.5)})))
    assert dict(general.components[0].parameters) == {"mass": 5.0}


@pytest.mark.parametrize("first", ["heaviness", "body.mass"])
def test_a_connected_parameter_takes_the_value_of_its_connection_and_the_other_is_said(
    tmp_path: Path, fmus: dict[str, Path], first: str
) -> None:
    both = {"heaviness": real(30.0), "body.mass": real(10.0)}
    given = {name: both[name] for name in (first, *both.keys() - {first})}
    description = ssd(
        body(values({"mass": real(20.0)})),
        connection("heaviness", "body.mass"),
        connectors=connector("heaviness", "parameter"),
        bindings=values(given),
    )
    path = archive(tmp_path / "s.ssp", description, fmus)
    imported = load_system(path)
    assert imported.scene.components[0].parameters["mass"] == 30.0
    said = [note for note in imported.notes if "of its connection" in note]
    assert "body.mass: 30.0 of its connection was taken, not 10.0 of a parameter set" in said
    other = tmp_path / "set.ssv"
    other.write_text(ssv({"body.mass": real(40.0)}))
    again = load_system(path, parameters=[other])
    assert again.scene.components[0].parameters["mass"] == 30.0
    other.write_text(ssv({"heaviness": real(50.0)}))
    again = load_system(path, parameters=[other])
    assert again.scene.components[0].parameters["mass"] == 50.0


def test_types_fit_their_variables_and_what_no_variable_takes_is_noted(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    given = {
        "mass": '<ssv:Integer value="4"/>',
        "contact[1].law": '<ssv:Real value="1.0"/>',
        "no such": real(1.0),
        "velocity": real(1.0),
    }
    imported = load_system(archive(tmp_path / "my rig.ssp", ssd(body(values(given))), fmus))
    assert dict(imported.scene.components[0].parameters) == {"mass": 4.0, "contact[1].law": 1}
    # remarks of a run on the FMU name the system, not the folder of its unpacked files
    assert imported.scene.components[0].fmu.parts[-2:] == ("my_rig_fmus", "body.fmu")
    (left_out, recorded) = imported.notes
    assert "body.no such, body.velocity" in left_out
    assert "record.variables" in recorded


def test_parameters_that_nothing_has_are_said_wherever_a_system_is_opened(
    tmp_path: Path, fmus: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    renamed = mapping(entry("weight", "mass"), entry("wieght", "stiffness"))
    given = values({"weight": real(2.0), "label": '<ssv:String value="x"/>'}, mapping=renamed)
    elements = body(given) + body(values({"no_such_parameter": real(250.0)}), "other")
    path = archive(tmp_path / "wild.ssp", ssd(elements), fmus)
    other = tmp_path / "set.ssv"
    other.write_text(ssv({"body.mass": real(3.0), "body.mas": real(4.0)}))
    expected = "parameters of no variable, which were left out: body.wieght, other.no_such_parameter"
    for opened in (opened_scene, vi.import_ssp):
        opened(path)
        assert f"note: {expected}\n" in capsys.readouterr().err
    vi.import_ssp(path, tmp_path / "wild.toml", parameters=other)
    assert f"note: {expected}, body.mas\n" in capsys.readouterr().err


def test_files_of_values_and_types_of_ssp_2_are_read(tmp_path: Path, fmus: dict[str, Path]) -> None:
    binding = '<ssd:ParameterBinding source="resources/body.ssv"/>'
    written = ssv({"mass": '<ssv:Float64 value="2.5"/>'}).replace('version="1.0"', 'version="2.0"')
    local = component(
        "a", "resources/body.fmu", '<ssd:Connector name="displacement" kind="output"/>', binding
    )
    path = archive(
        tmp_path / "s.ssp", ssd(local, version="2.0"), {**fmus, "resources/body.ssv": written.encode()}
    )
    scene = load_system(path).scene
    assert scene.components[0].parameters["mass"] == 2.5


def test_a_system_without_an_end_or_a_step_says_which_keys_to_give(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    path = archive(tmp_path / "s.ssp", ssd(body(), times=""), fmus)
    with pytest.raises(SceneError, match=r"s\.ssp: .*stopTime: expected .*--set record\.recorded_time=10"):
        load_system(path)
    scene = load_system(path, ["record.recorded_time=4.0"]).scene
    assert (scene.record.recorded_time, scene.sampling_rate) == (4.0, 250.0)
    for wrong, told in (("long", '"long"'), ("1" + "0" * 400, "a number near 1e400")):
        with pytest.raises(SceneError, match=f"recorded_time: expected .*got {told}"):
            load_system(path, [f"record.recorded_time={wrong}"])


def test_the_step_is_that_of_the_master_or_the_smallest_that_an_fmu_proposes(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    elements = body() + component("law", "resources/plain.fmu", GAIN)
    joined = connection("body.displacement", "law.input")
    assert read(tmp_path, fmus, ssd(elements, joined, step=0.25)).macro_step == 0.25
    # an empty element name means the system, as older versions of OMSimulator write it
    oms = 'xmlns:oms="https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"'
    note = f'<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:FixedStepMaster {oms} stepSize="0.0625"/>'
    note += "</ssc:Annotation></ssd:Annotations>"
    push = '<ssd:Connection startElement="" startConnector="push" endElement="body" endConnector="force"/>'
    outer = ssd(elements, joined + push, connectors=connector("push", "input"), step=None, more=note)
    general = read(tmp_path, fmus, outer)
    assert (general.macro_step, len(general.connections)) == (0.0625, 1)
    imported = load_system(archive(tmp_path / "t.ssp", ssd(elements, joined, step=None), fmus))
    assert 0.0 < imported.scene.macro_step < 1.0
    assert "execution.macro_step" in imported.notes[0]


def test_parameter_sets_are_the_points_of_a_sweep(tmp_path: Path, fmus: dict[str, Path]) -> None:
    path = archive(tmp_path / "s.ssp", ssd(body(), step=0.5), fmus)
    sets = []
    for number, (mass, stiffness) in enumerate([(1.0, 4.0), (2.0, 4.0), (1.0, 9.0), (2.0, 9.0)]):
        sets.append(tmp_path / f"{number}.ssv")
        sets[-1].write_text(ssv({"body.mass": real(mass), "body.stiffness": real(stiffness)}))
    scene = load_system(path, (), sets).scene
    assert {axis.key: axis.values for axis in scene.sweep} == {
        "body.mass": (1.0, 2.0),
        "body.stiffness": (4.0, 9.0),
    }
    one = load_system(path, (), sets[1:2]).scene
    assert one.sweep == ()
    assert one.components[0].parameters["mass"] == 2.0
    with pytest.raises(UsageError, match="all combinations of several"):
        load_system(path, (), sets[:3])
    same = tmp_path / "same.ssv"
    same.write_bytes(sets[0].read_bytes())
    with pytest.raises(UsageError, match="two that say the same"):
        load_system(path, (), [sets[0], same])
    other = tmp_path / "other.ssv"
    other.write_text(ssv({"body.weight": real(1.0)}))
    with pytest.raises(UsageError, match=r"expected a parameter of this system such as body\."):
        load_system(path, (), [other])


def scene_of_two(folder: Path) -> Path:
    (folder / "two.toml").write_text(
        """
        [component.a]
        fmu = "Oscillator"
        parameters = { displacement_start = 1.0 }
        [component.b]
        fmu = "Oscillator"
        [[connection]]
        from = "a.displacement"
        to = "b.force"
        gain = 0.1
        gain_unit = "N/m"
        [record]
        recorded_time = 2.0
        variables = ["b.displacement"]
        rate = 8
        [execution]
        macro_step = 0.125
        """
    )
    return folder / "two.toml"


def test_what_another_tool_has_changed_in_an_archive_of_ours_counts(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    path = export_system(vi.Scene.from_file(scene_of_two(tmp_path)), tmp_path / "two.ssp")
    heavier = ssv({"displacement_start": real(1.0), "mass": real(5.0)})
    again = load_system(changed(path, tmp_path / "m.ssp", "resources/a.ssv", heavier.encode())).scene
    assert again.components[0].parameters == {"displacement_start": 1.0, "mass": 5.0}
    # another FMU in the place of ours is the one that runs
    gain = fmus["resources/plain.fmu"].read_bytes()
    with pytest.raises(SceneError, match=r"Known here: gain, input, output"):
        load_system(changed(path, tmp_path / "g.ssp", "resources/a.fmu", gain))


def test_an_imported_scene_lies_beside_its_fmus_and_overwrites_nothing(
    tmp_path: Path, fmus: dict[str, Path]
) -> None:
    path = archive(tmp_path / "s.ssp", ssd(body()), fmus)
    target = tmp_path / "rig.toml"
    unguarded = ["execution.guard=false"]
    import_system(path, target, unguarded)
    assert [file.name for file in (tmp_path / "rig_fmus").iterdir()] == ["body.fmu"]
    ours = vi.run(target, progress=False)
    theirs = vi.run(load_system(path, unguarded).scene, progress=False)
    assert np.array_equal(ours.body_displacement, theirs.body_displacement)
    import_system(path, target, unguarded)
    target.write_text("mine")
    with pytest.raises(UsageError, match="--force"):
        import_system(path, target)
    assert target.read_text() == "mine"
