"""A lean description has nothing that other tools failed on, and it describes the unchanged binary."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import simulate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from support.component_fmu import VERSIONS, ComponentFmu
from support.exports import exported
from support.integrated import Integrated

from vibroimpact.fmus import components, fmu_path
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.build import read_components
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.description import TERMINALS_MEMBER
from vibroimpact.fmus.packaging.experiment import MOST_STEPS, default_experiment
from vibroimpact.fmus.packaging.export import STARTS_MEMBER, export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description, schema_folder
from vibroimpact.fmus.packaging.fmu_zip import write_fmu

BODIES = ("Oscillator", "Chain", "Beam", "Structure")
DESCRIBED = read_components()
SIGNALS = ("Replay", "Gain")
"""Components without a mass, a stop or a bound."""
POINTS = {
    **dict.fromkeys(("Gain", "Sensor", "Noise", "AnalogInput"), ("input", "output")),
    "LoadCell": ("force", "impulse", "impact_time", "load", "output"),
    "Exciter": ("input", "displacement", "force"),
}
"""Components with one terminal, and its members."""


def description(path: Path) -> ElementTree.Element:
    return ElementTree.parse(unpack(path).folder / "modelDescription.xml").getroot()


def simulated(path: Path, **options: Any) -> dict[str, Any]:
    result = simulate_fmu(str(path), fmi_type="CoSimulation", **options)
    return {name: result[name] for name in result.dtype.names}


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", components())
def test_a_lean_fmu_has_nothing_that_other_tools_stumble_over(tmp_path: Path, name: str, fmi: str) -> None:
    path = exported(name, tmp_path / "lean.fmu", fmi=fmi)
    assert check_fmu(path) == ()
    root = description(path)
    assert not [e.tag for e in root.iter() if e.tag in {"Dimension", "Enumeration", "EnumerationType"}]
    variables = read_description(path).modelVariables
    names = [v.name for v in variables]
    inside = ("record.", "applied_", "event_time", "last_time", "last_phase", "stick_")
    if name in BODIES:
        assert not [n for n in names if any(part in n for part in inside)]
        assert "contact[1].mass" not in names
    with ComponentFmu(path, version=fmi) as fmu:
        values = {v.name: fmu.get(v.name) for v in variables if v.causality != "independent"}
    assert not [n for n, value in values.items() if not math.isfinite(value)]


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", components())
def test_every_start_value_lies_in_its_range_and_every_unknown_says_its_knowns(
    tmp_path: Path, name: str, fmi: str
) -> None:
    path = exported(name, tmp_path / "lean.fmu", fmi=fmi)
    ranged = 0
    for variable in read_description(path).modelVariables:
        if variable.start is not None:
            for bound, sign in ((variable.min, 1.0), (variable.max, -1.0)):
                ranged += bound is not None
                assert bound is None or sign * float(variable.start) >= sign * float(bound), variable.name
    assert ranged or name in SIGNALS
    root = description(path)
    unknowns = [*root.iter("InitialUnknown"), *root.findall("ModelStructure/InitialUnknowns/Unknown")]
    assert unknowns
    assert all("dependencies" in unknown.attrib for unknown in unknowns)
    # equal recordings make equal files
    dated = set() if name == "Replay" else {"generationDateAndTime"}
    assert {"version", "copyright"} | dated <= root.attrib.keys()
    assert root.find("DefaultExperiment").get("tolerance")  # type: ignore[union-attr]


def test_no_displacement_waits_for_an_input_when_a_run_begins(tmp_path: Path) -> None:
    # a dependency would make a body and its stop an algebraic loop at the start in another tool
    for fmi in VERSIONS:
        root = description(export_fmu("oscillator", tmp_path / f"{fmi}.fmu", fmi=fmi, external=True))
        variables = list(root.find("ModelVariables"))  # type: ignore[arg-type]
        key = "valueReference" if fmi == "3.0" else "index"
        keys = {
            e.get("name"): e.get("valueReference") if fmi == "3.0" else str(place)
            for place, e in enumerate(variables, 1)
        }
        inputs = {keys[e.get("name")] for e in variables if e.get("causality") == "input"}
        unknowns = {
            e.get(key): set((e.get("dependencies") or "").split())
            for e in [*root.iter("InitialUnknown"), *root.findall("ModelStructure/InitialUnknowns/Unknown")]
        }
        for name in ("displacement", "velocity", "contact[1].displacement", "contact[1].velocity"):
            assert not unknowns[keys[name]] & inputs, name
        for name in ("contact[1].force", "contact[1].stuck"):
            assert unknowns[keys[name]] & inputs, name


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", BODIES)
def test_a_run_that_nobody_set_anything_for_shows_motion(tmp_path: Path, name: str, fmi: str) -> None:
    path = export_fmu(name, tmp_path / "plain.fmu", fmi=fmi)
    values = simulated(path, output=["displacement"])
    assert np.ptp(values["displacement"]) > 1e-3
    turns = np.count_nonzero(np.diff(np.sign(np.diff(values["displacement"]))))
    assert turns >= 20
    assert 100 <= len(values["time"]) <= 20_000


@pytest.mark.parametrize(
    "stops",
    [
        {"contact[1].law": "restitution"},
        {"contact[1].law": "restitution", "contact[1].side": "lower"},
        {"contact[1].law": "restitution", "contact[1].position": -0.005, "contact[2].law": "none"},
    ],
    ids=str,
)
def test_a_body_of_which_only_stops_are_set_is_displaced_to_where_they_leave_room(
    tmp_path: Path, stops: dict[str, str | float]
) -> None:
    path = export_fmu("oscillator", tmp_path / "rig.fmu", fmi="2.0", starts=stops)
    assert simulated(path, output=["contact[1].count"])["contact[1].count"][-1] > 20


def test_a_body_that_its_stops_hold_starts_where_it_is(tmp_path: Path) -> None:
    stops = {f"contact[{k}].law": "restitution" for k in (1, 2)} | {"contact[2].side": "lower"}
    stops |= {"contact[1].position": 1e-3, "contact[2].position": -1e-3}
    path = export_fmu("oscillator", tmp_path / "held.fmu", fmi="2.0", starts=stops)
    with ComponentFmu(path, version="2.0") as fmu:
        assert fmu.get("displacement") == 0.0
    stops["contact[1].position"] = -1e-3
    with pytest.raises(UsageError, match=r"contact\[2\]\.position: expected room between it"):
        export_fmu("oscillator", tmp_path / "none.fmu", starts=stops)
    assert not (tmp_path / "none.fmu").exists()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_start_values_of_an_export_are_those_of_the_description_and_of_the_binary(
    tmp_path: Path, fmi: str
) -> None:
    starts = {
        "mass": 2.0,
        "contact[1].law": "restitution",
        "contact[1].position": -0.1,
        "contact[1].side": "lower",
        "impact_limit": 12,
        "velocity_start": -1e-300,
    }
    path = export_fmu("oscillator", tmp_path / "rig.fmu", fmi=fmi, starts=starts)
    with ComponentFmu(path, version=fmi, initialize=False) as fmu:
        described = fmu.start_values()
        for _ in range(2):
            assert {name: fmu.get(name) for name in described} == described
            fmu.fmu.reset()
    expected = {**starts, "contact[1].law": 1, "contact[1].side": 2}
    assert {name: described[name] for name in expected} == expected
    assert described["displacement_start"] == 0.0


def test_names_of_an_enumeration_may_be_kept(tmp_path: Path) -> None:
    path = export_fmu("beam", tmp_path / "b.fmu", enumerations=True, starts={"boundary": "pinned_pinned"})
    assert check_fmu(path) == ()
    variable = next(v for v in read_description(path).modelVariables if v.name == "boundary")
    assert (variable.type, variable.start) == ("Enumeration", "4")


def test_more_is_described_where_start_values_speak_of_it(tmp_path: Path) -> None:
    path = export_fmu(
        "beam", tmp_path / "b.fmu", starts={"modes": 6, "contact[3].law": 1, "sensor[2].location": 0.5}
    )
    names = {v.name for v in read_description(path).modelVariables}
    assert {"damping_ratio[6]", "contact[3].law", "sensor[2].displacement"} <= names
    assert not {"damping_ratio[7]", "contact[4].law", "sensor[3].displacement"} & names


def test_external_ports_are_described_when_they_are_asked_for(tmp_path: Path) -> None:
    path = export_fmu("chain", tmp_path / "c.fmu", external=True)
    assert check_fmu(path) == ()
    variables = {v.name: v for v in read_description(path).modelVariables}
    assert {"contact[1].applied_force", "contact[1].mass", "contact[1].event_time"} <= variables.keys()
    assert "6 external_force" in variables["contact[1].law"].description
    plain = {v.name: v for v in read_description(export_fmu("chain", tmp_path / "p.fmu")).modelVariables}
    assert "external" not in plain["contact[1].law"].description
    assert plain["contact[1].law"].max == "4"


@pytest.mark.parametrize("name", components())
def test_terminals_obey_the_schema_and_have_the_variables_that_are_described(
    tmp_path: Path, name: str
) -> None:
    path = exported(name, tmp_path / "x.fmu", external=True)
    text = (unpack(path).folder / TERMINALS_MEMBER).read_bytes()
    etree.XMLSchema(file=str(schema_folder() / "fmi3" / "fmi3TerminalsAndIcons.xsd")).assertValid(
        etree.fromstring(text)
    )
    plugs = {
        plug.get("name"): {e.get("memberName"): e.get("variableName") for e in plug}
        for plug in ElementTree.fromstring(text).iter("Terminal")
    }
    names = {v.name for v in read_description(path).modelVariables}
    assert {variable for members in plugs.values() for variable in members.values()} <= names
    if name == "Replay":
        assert plugs["base"] == {"value": "base", "rate": "base_rate"}
        return
    if name in POINTS:
        assert plugs == {"point": {member: member for member in POINTS[name]}}
        return
    assert "displacement" in plugs["point"]
    if name != "ImpactStop":
        # the terminals of a contact and a stop fit together
        stop = {"displacement", "velocity", "applied_restitution"}
        stop |= {"applied_force", "applied_stiffness", "applied_damping"}
        assert stop <= plugs["contact[1]"].keys()
        assert plugs["contact[2]"]["force"] == "contact[2].force"
    if name == "Chain":
        assert plugs["mass[2]"] | {"force": "force[2]"} == plugs["mass[2]"]


@pytest.mark.parametrize(
    ("starts", "text"),
    [
        ({"mas": 2.0}, "mas: expected a parameter or an input, got none of this name. Did you mean mass?"),
        ({"mass": -1.0}, "mass: expected a number >= 0, got -1.0."),
        ({"mass": "heavy"}, "mass: expected a number >= 0, got 'heavy'."),
        ({"mass": math.nan}, "mass: expected a number >= 0, got nan."),
        ({"mass": 10**400}, "mass: expected a number >= 0"),
        ({"displacement": 1.0}, "displacement: expected a parameter or an input, got none of this name."),
        ({"contact[1].law": "sticky"}, "expected one of none, restitution, kelvin_voigt, hertz"),
        ({"contact[1].law": 8}, "contact[1].law: expected one of none"),
        ({"contact[3].law": 1}, "contact[3].law: expected contact 1 to 2, got 3."),
        ({"contact[1].restitution": 1.5}, "contact[1].restitution: expected a number from 0 to 1, got 1.5."),
        ({"impact_limit": 2.5}, "impact_limit: expected a whole number >= 0, got 2.5."),
        ({"record.impacts": "perhaps"}, "record.impacts: expected true or false, got 'perhaps'."),
    ],
)
def test_a_start_value_that_cannot_be_is_refused(tmp_path: Path, starts: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError) as caught:
        export_fmu("oscillator", tmp_path / "o.fmu", starts=starts)
    assert text in str(caught.value)
    assert not (tmp_path / "o.fmu").exists()


@pytest.mark.parametrize(
    ("name", "starts", "message"),
    [
        ("oscillator", {"mass": 0.0}, "Oscillator: mass: expected a finite number > 0, got 0."),
        ("impact_stop", {"law": "hertz"}, "ImpactStop: stiffness: expected a finite number > 0, got 0."),
        ("chain", {"contact[1].law": 1, "contact[1].position": -1.0}, "Chain: displacement_start: "),
        ("beam", {"length": 1e-300}, "Beam: "),
    ],
)
@pytest.mark.parametrize("full", [False, True])
def test_start_values_that_the_library_refuses_are_not_written(
    tmp_path: Path, name: str, starts: dict[str, Any], message: str, full: bool
) -> None:
    with pytest.raises(UsageError) as caught:
        export_fmu(name, tmp_path / "x.fmu", starts=starts, full=full)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(message)
    assert line.endswith("Nothing was written.")
    assert not list(tmp_path.iterdir())


def test_a_start_value_beyond_the_number_that_was_asked_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"contact\[2\]\.law: expected a variable of this description"):
        export_fmu("oscillator", tmp_path / "o.fmu", contacts=1, starts={"contact[2].law": 1})
    with pytest.raises(UsageError, match="Beam: modes: expected at most 4 in this description, got 6"):
        export_fmu("beam", tmp_path / "o.fmu", modes=4, starts={"modes": 6})
    with pytest.raises(UsageError, match=r"record\.impacts: .* or for the full description"):
        export_fmu("oscillator", tmp_path / "o.fmu", starts={"record.impacts": True})
    with pytest.raises(UsageError, match=r"law: expected at most 4 .*, got 5\. Ask for .* external ports"):
        export_fmu("oscillator", tmp_path / "o.fmu", starts={"contact[1].law": "external"})


def test_start_values_that_were_tampered_with_do_no_harm(tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu_path("Oscillator")) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = "999999999 0\n1 4000000000000000\n-1 0\n" + "1 zz\n" * 1000
    write_fmu(tmp_path / "o.fmu", {**members, STARTS_MEMBER: text.encode()})
    with ComponentFmu(tmp_path / "o.fmu") as fmu:
        assert fmu.get("mass") == 2.0


@pytest.mark.parametrize("name", BODIES)
def test_a_stop_that_a_tool_switches_on_is_hit(tmp_path: Path, name: str) -> None:
    path = export_fmu(name, tmp_path / "plain.fmu")
    values = simulated(path, start_values={"contact[1].law": 1}, output=["contact[1].count"])
    assert values["contact[1].count"][-1] >= 3


@given(st.sampled_from(BODIES), st.data())
@settings(max_examples=60)
def test_any_start_values_have_an_experiment_that_ends(name: str, data: st.DataObject) -> None:
    component = next(c for c in DESCRIBED if c.name == name)
    starts = {v.name: v.start for v in component.variables if v.start is not None}
    sizes = st.sampled_from((0.0, 5e-324, 1e-300, 1e-5, 1.0, 1e5, 1e300, 1.7e308))
    chosen = [v for v in starts if isinstance(starts[v], float) and not v.startswith(("contact", "sensor"))]
    starts |= data.draw(st.dictionaries(st.sampled_from(chosen), sizes, max_size=6))
    experiment = default_experiment(name, starts)
    assert 0.0 < experiment.step_size < experiment.stop_time < math.inf
    assert experiment.stop_time / experiment.step_size <= 1.1 * MOST_STEPS


@pytest.mark.parametrize(("external", "named"), [(False, False), (True, True)])
def test_a_law_that_there_is_not_is_refused_by_the_laws_of_the_description(
    tmp_path: Path, external: bool, named: bool
) -> None:
    path = export_fmu("oscillator", tmp_path / "o.fmu", external=external)
    it = Integrated("Oscillator", "3.0", path, "CoSimulation")
    it.set({"contact[1].law": 99})
    message = it.message(it.fmu.exitInitializationMode)
    assert "4 (hunt_crossley)" in message
    assert ("5 (external)" in message) == named
