"""Scenes of several bodies: points, links and contacts, keys, and one line for each mistake."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from support.command_line import in_this_process

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.campaign.manifest import flat_scene
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene

Tables = dict[str, Any]
BEAM = {"name": "beam", "kind": "beam", "length": 1.0, "mass_per_length": 1.0, "flexural_rigidity": 1.0}
TWO: Tables = {
    "body": [
        {"name": "a", "mass": 1.0, "stiffness": 1.0},
        {"name": "b", "kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0},
    ],
    "link": [{"between": ["a", "b.1"], "stiffness": 0.5, "damping": 0.1}],
    "contact": [{"between": ["a", "b.2"], "restitution": 0.5, "clearance": 0.1}],
    "record": {"recorded_time": 3.0},
}
STOP = {"position": 1.0, "restitution": 0.5}
FORCED = {"record": {"recorded_periods": 3}}
FORCE = {"amplitude": 1.0, "angular_frequency": 1.0}


def scene(**changes: Any) -> Scene:
    return Scene.from_dict(deepcopy(TWO) | changes)


def line_of(tables: Tables) -> str:
    with pytest.raises(SceneError) as refused:
        Scene.from_dict(tables)
    (line,) = str(refused.value).splitlines()
    return line.removeprefix("scene: ")


def sets(table: str, place: int, **keys: Any) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        tables[table][place].update(keys)

    return change


def gives(**tables: Any) -> Callable[[Tables], None]:
    return lambda document: document.update(tables)


def drops(table: str, place: int, key: str) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        del tables[table][place][key]

    return change


MISTAKES: list[tuple[Callable[[Tables], None], str]] = [
    (sets("body", 1, name="a"), 'body[2].name: expected a name of its own, got "a", which body[1] has.'),
    (drops("body", 1, "name"), "body[2].name: expected a name of letters, digits, _ and -"),
    (sets("body", 0, name="ground"), 'body[1].name: expected another name, got "ground".'),
    (
        sets("contact", 0, between=["b", "b.2"]),
        "contact[1].between: expected two points that are not the same",
    ),
    (
        sets("contact", 0, between=["ground", "a"]),
        'contact[1].between[1]: expected a point of a body, got "ground"',
    ),
    (
        sets("link", 0, between=["a", "b.3"]),
        'link[1].between[2]: expected "b" for the last mass, or "b.1" to "b.2"',
    ),
    (sets("link", 0, between=["a", "c"]), "link[1].between[2]: expected a point of a body of this scene"),
    (
        sets("link", 0, between=["ground", "ground"]),
        "link[1].between: expected two points that are not the same",
    ),
    (sets("body", 1, masses=[1.0] * 64), "body: expected at most 64 modes in all, got 65."),
    (
        lambda t: t.update(contact=t["contact"] * 33),
        "contact: expected at most 32 stops and contacts in all, got 33.",
    ),
    (gives(stop=[STOP]), "stop[1].at: expected the point that it limits, got nothing."),
    (gives(stop=[STOP | {"at": "b", "mass": 1}]), "stop[1].mass: expected mass beside one body alone"),
    (sets("body", 0, displacement_start=1.0), "contact[1]: expected a start on the free side"),
    (
        lambda t: t["contact"].append({"between": ["b.2", "a"], "restitution": 0.5, "clearance": -0.2}),
        "contact[2]: expected room for motion between contact[1] and contact[2]",
    ),
    (sets("body", 1, modes=1), "body[2].modes: expected modes beside one body alone"),
    (lambda t: t["body"].append(BEAM | {"modes": "auto"}), "body[3].modes: expected a number of modes"),
    (
        lambda t: t["body"].append(BEAM | {"residual": True}),
        "body[3].residual: expected residual beside one body alone",
    ),
    (
        sets("body", 0, frequency_slope=1.0),
        "body[1].frequency_slope: expected frequency_slope beside one body",
    ),
    (gives(execution={"how": "coupled"}), 'execution.how: expected "auto" or "fused" beside [[body]]'),
    (gives(sensor={}), "sensor: expected [sensor] beside one body alone"),
    (gives(forcing=FORCE, **FORCED), "forcing.at: expected the point where the force acts, got nothing."),
    (
        gives(forcing=FORCE | {"at": "a", "amplitude": [1.0, 2.0]}, **FORCED),
        "forcing.amplitude: expected one number beside [[body]]",
    ),
    (
        gives(forcing=FORCE | {"at": "a", "kind": "base_acceleration"}, **FORCED),
        'forcing.at: expected it with kind = "force"',
    ),
    (
        gives(sweep={"body.mass": {"values": [1.0]}}),
        'sweep."body.mass": expected a numeric key of this scene',
    ),
    (
        gives(sweep={"body[3].mass": {"values": [1.0]}}),
        'sweep."body[3].mass": expected a numeric key of this scene',
    ),
    (
        gives(sweep={"link[1].stiffness": {"start": 1, "stop": 2, "points": 3, "path": "up"}}),
        'sweep."link[1].stiffness".path: expected "independent"',
    ),
    (sets("body", 1, dampings=[0.1] * 3), "body[2].dampings: expected an array of 2"),
    (
        sets("body", 0, damping=0.1, damping_ratio=0.1),
        "body[1].damping: expected damping or damping_ratio, got both.",
    ),
    (gives(body=[1, 2]), "body[1]: expected a table, got 1."),
]


@pytest.mark.parametrize(("change", "expected"), MISTAKES, ids=[each[1][:40] for each in MISTAKES])
def test_a_mistake_is_one_line_with_its_key(change: Callable[[Tables], None], expected: str) -> None:
    tables = deepcopy(TWO)
    change(tables)
    if tables["body"] == [1, 2]:
        with pytest.raises(SceneError, match="expected a table, got 1"):
            Scene.from_dict(tables)
        return
    assert line_of(tables).startswith(expected)


REFUSED = {
    "name of its own": (["a", "a"], ['["a", "b"]'], ""),
    "letters, digits": (["a", ""], [], ""),
    "not the same": (["a", "b"], ['["a", "a"]'], ""),
    "link[1].between[2]": (["a", "b"], [], '[[link]]\nbetween = ["a", "c"]\nstiffness = 1.0\n'),
    "at most 64": ([f"m{i}" for i in range(65)], [], ""),
    "at most 32": (["a", "b"], ['["a", "b"]'] * 33, ""),
}


@pytest.mark.parametrize("expected", REFUSED)
def test_the_command_line_refuses_bad_bodies_and_writes_nothing(expected: str, tmp_path: Path) -> None:
    names, pairs, more = REFUSED[expected]
    text = "".join(f'[[body]]\nname = "{name}"\nmass = 1.0\nstiffness = 1.0\n' for name in names)
    text += "".join(f"[[contact]]\nbetween = {pair}\nrestitution = 0.5\n" for pair in pairs)
    path = tmp_path / "bodies.toml"
    path.write_text(text + more + "[record]\nrecorded_time = 1.0\n", encoding="utf-8")
    done = in_this_process("run", path, "-o", tmp_path / "run.nc")
    assert (done.returncode, done.stdout) == (2, "")
    assert expected in done.stderr
    assert all(line.startswith(f"{path}: ") for line in done.stderr.splitlines())
    assert [*tmp_path.iterdir()] == [path]


def test_a_list_of_one_body_is_the_scene_with_one_body() -> None:
    chain = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0}
    listed = Scene.from_dict(
        {
            "body": [chain | {"name": "b"}],
            "stop": [STOP | {"at": "b.1"}],
            "forcing": {"kind": "base_acceleration", "amplitude": 1.0, "angular_frequency": 1.0},
            "sweep": {"body[1].masses[2]": {"values": [2.0, 3.0]}},
            **FORCED,
        }
    )
    single = Scene.from_dict(
        {
            "body": chain,
            "stop": [STOP | {"mass": 1}],
            "forcing": {"kind": "base_acceleration", "amplitude": 1.0, "angular_frequency": 1.0},
            "sweep": {"body.masses[2]": {"values": [2.0, 3.0]}},
            **FORCED,
        }
    )
    assert listed.body.FMU == "Chain"
    assert listed.model_dump(exclude={"text"}) == single.model_dump(exclude={"text"})


def test_one_body_beside_a_link_is_a_structure_of_one() -> None:
    body = {"name": "b", "kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0}
    for written in (body, [body]):
        found = scene(body=written, link=[], contact=[{"between": ["b.2", "b.1"], "restitution": 0.5}])
        assert found.body.FMU == "Structure"
        assert found.value("body[1].masses[2]") == 2.0


def test_numbers_of_several_bodies_have_keys() -> None:
    found = scene(stop=[STOP | {"at": "b"}])
    keys = dict(found.numbers())
    assert keys["body[2].masses[2]"] == 2.0
    assert keys["link[1].stiffness"] == 0.5
    assert keys["contact[1].clearance"] == 0.1
    assert "body[1].frequency_slope" not in keys
    assert found.stop_keys == ("stop[1]", "contact[1]")
    changed = found.with_values(
        {"body[1].damping_ratio": 0.1, "link[1].damping": 0.2, "contact[1].clearance": 0.3}
    )
    assert [changed.value(key) for key in ("body[1].damping_ratio", "link[1].damping")] == [0.1, 0.2]
    assert found.at({"body[2].masses[1]": 4.0, "contact[1].clearance": 0.2}).stops[1].position == 0.2
    swept = found.with_sweep(
        {"body[1].mass": [1.0, 2.0], "body[2].masses[1]": [1.0, 3.0], "stop[1].position": [1, 2]}
    )
    names = [swept.sweep_coordinate_name(axis.key) for axis in swept.sweep]
    assert names == ["mass", "masses_1", "position"]


def test_the_fmu_gets_modes_shapes_of_contacts_and_loads() -> None:
    found = scene(forcing=FORCE | {"at": "b.1"}, **FORCED)
    numbers, integers = float_parameters(found, None), integer_parameters(found)
    assert integers["modes"] == 3
    assert integers["coupled"] is True
    shapes = found.body.assembly.shapes
    assert [numbers[f"mode.contact_shape[1,{i}]"] for i in (1, 2, 3)] == pytest.approx(shapes[0] - shapes[2])
    assert [numbers[f"mode.forcing[{i}]"] for i in (1, 2, 3)] == pytest.approx(shapes[1])
    assert [numbers[f"mode.observed_shape[{i}]"] for i in (1, 2, 3)] == pytest.approx(shapes[0])
    base = [numbers[f"mode.base[{i}]"] for i in (1, 2, 3)]
    assert base == pytest.approx(-(shapes.T @ found.body.assembly.masses))
    assert numbers["contact[1].position"] == 0.1


def test_a_scene_whose_bodies_stay_keeps_the_modes_that_it_has_found() -> None:
    found = scene()
    assembly = found.body.assembly
    assert found.at({"contact[1].clearance": 0.2}).body.assembly is assembly
    assert found.at({"link[1].stiffness": 0.2}).body.assembly is not assembly


def test_scenes_of_one_body_are_identified_as_before_there_were_several() -> None:
    body = {"mass": 1.0, "stiffness": 1.0}
    flat = flat_scene(Scene.from_dict({"body": body, "stop": [STOP], "forcing": FORCE, **FORCED}))
    assert [key for key in flat if key.endswith((".at", "parts", "links", "names"))] == []
    assert {"body.mass", "stop[1].position", "forcing.amplitude"} <= flat.keys()
    assert {"body.parts[2].masses", "body.names", "stop[1].between"} <= flat_scene(scene()).keys()
