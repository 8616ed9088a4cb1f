"""`[[contact]]` between two bodies: their ports, their sweepable numbers, and refused scenes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import xarray as xr
from support.fmu_factory import mass

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.importer.specification import BodyPoint, PairSpec
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene

SCENE = """
[component.a]
fmu = "Oscillator"
parameters = { displacement_start = -1.0 }
[component.b]
fmu = "Beam"
parameters = { length = 1.0, flexural_rigidity = 50.0, mass_per_length = 1.0 }
[component.c]
fmu = "Chain"
parameters = { masses = 3, "contact[1].law" = "restitution", "contact[1].position" = 9.0 }
[[contact]]
between = ["a", "c.mass[2]"]
restitution = 0.5
[[contact]]
between = ["c.mass[2]", "b.tip"]
law = "hunt_crossley"
stiffness = 1e4
clearance = 0.5
[record]
recorded_time = 1.0
[execution]
macro_step = 0.1
"""


def scene_of(text: str) -> Scene:
    return parse_scene(text, "pairs.toml")


def problem_of(text: str) -> str:
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "pairs.toml")
    assert len(caught.value.problems) == 1, caught.value.problems
    return str(caught.value.problems[0])


def test_points_take_the_free_ports_and_one_point_takes_one() -> None:
    scene = scene_of(SCENE)
    assert scene.pairs == (
        PairSpec(("a", "contact[1]"), ("c", "contact[2]"), 0.0, "restitution", 0.5),
        PairSpec(("c", "contact[2]"), ("b", "contact[1]"), 0.5, "hunt_crossley", stiffness=1e4),
    )
    given = {component.name: dict(component.parameters) for component in scene.components}
    assert given["a"] == {"displacement_start": -1.0, "contact[1].law": 7}
    assert given["b"]["contact[1].location"] == 1.0
    assert (given["c"]["contact[2].law"], given["c"]["contact[2].mass_number"]) == (7, 2)


def test_a_port_may_be_given_with_its_place() -> None:
    text = SCENE.replace('"b.tip"', '"b.contact[3]"')
    text = text.replace("mass_per_length = 1.0", 'mass_per_length = 1.0, "contact[3].location" = 0.7')
    scene = scene_of(text)
    assert scene.pairs[1].upper == ("b", "contact[3]")
    assert scene.components[1].parameters["contact[3].law"] == 7


def test_the_numbers_of_a_pair_are_swept_and_have_units() -> None:
    sweep = '[sweep]\n"contact[1].restitution" = { values = [0.2, 0.9] }\n"contact[2].clearance" = { values = [0.1] }\n'
    scene = scene_of(SCENE + sweep)
    assert scene.declared_units["contact[2].clearance"] == "m"
    assert scene.declared_units["contact[2].stiffness"] == "N/m^exponent"
    assert scene.value("contact[1].restitution") == 0.5
    other = scene.at({"contact[1].restitution": 0.9, "contact[2].clearance": 0.1})
    assert (other.pairs[0].restitution, other.pairs[1].clearance) == (0.9, 0.1)
    with pytest.raises(UsageError, match="expected a number of a contact"):
        scene.value("contact[1].stiffness")


def test_a_sweep_that_is_no_table_leaves_the_ports_to_the_pairs() -> None:
    assert problem_of(f"sweep = 1.0\n{SCENE}").startswith("pairs.toml: sweep: expected a table, got 1.0.")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            '"a", "c.mass[2]"',
            '"a", "a.mass"',
            'contact[1].between: expected points of two bodies, got "a" twice',
        ),
        (
            '"a", "c',
            '"d", "c',
            'contact[1].between[1]: expected a point of a component of this scene, got "d"',
        ),
        (
            '"c.mass[2]", "b.tip"',
            '"c.mass[4]", "b.tip"',
            "contact[2].between[1]: expected a mass from 1 to 3",
        ),
        (
            '"b.tip"',
            '"b.mass"',
            'contact[2].between[2]: expected one of "b.tip", or "b.contact[1]", got "b.mass"',
        ),
        (
            '"a", "c',
            '"a.velocity", "c',
            'contact[1].between[1]: expected one of "a", "a.mass", or "a.contact[1]"',
        ),
        ('"a", "c', '"a.contact[3]", "c', "contact[1].between[1]: expected a contact port of Oscillator.fmu"),
        (
            '"a", "c.mass[2]"',
            '"a", "c.contact[1]"',
            'expected a port without a stop, got "c.contact[1]" with the law res',
        ),
        ('["a", "c.mass[2]"]', '["a"]', "contact[1].between: expected two points of bodies"),
        ("restitution = 0.5", "restitution = 1.5", "contact[1].restitution: expected 0 <= r <= 1, got 1.5"),
        (
            "restitution = 0.5",
            "restitution = 0.5\nstiffness = 1.5",
            "contact[1].stiffness: expected a known key",
        ),
        ('"hunt_crossley"', '"external"', "contact[2].law: expected"),
        ("restitution = 0.5", 'restitution = 0.5\nstop = "b"', "contact[1]: expected either between = [...]"),
        ('between = ["a", "c.mass[2]"]\n', "", "contact[1]: expected either between = [...]"),
        (
            "macro_step = 0.1",
            "",
            "execution.macro_step: expected a number > 0 where components are connected",
        ),
        (
            "displacement_start = -1.0",
            '"contact[1].law" = "hertz", "contact[2].law" = "hertz"',
            'contact[1].between[1]: expected a body with a free contact port, got "a", whose 2 are taken',
        ),
    ],
)
def test_what_is_wrong_with_a_pair_is_one_clear_error(old: str, new: str, said: str) -> None:
    assert SCENE.count(old) >= 1
    assert said in problem_of(SCENE.replace(old, new))


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ('"contact[1].restitution" = { values = [0.5, 2.0] }', "expected 0 <= r <= 1, got 2.0"),
        ('"contact[1].stiffness" = { values = [1.0] }', "expected a number of this contact"),
        ('"contact[3].clearance" = { values = [1.0] }', "this scene has 2 [[contact]]"),
    ],
)
def test_a_sweep_over_what_a_pair_has_not_is_one_clear_error(sweep: str, said: str) -> None:
    assert said in problem_of(f"{SCENE}[sweep]\n{sweep}\n")


def test_a_body_of_another_tool_is_refused_with_the_way_out(tmp_path: Path) -> None:
    fmu = mass(tmp_path, "3.0")
    (tmp_path / "s.toml").write_text(
        SCENE.replace('fmu = "Oscillator"\nparameters = { displacement_start = -1.0 }', f'fmu = "{fmu.name}"')
    )
    with pytest.raises(
        SceneError, match=re.escape("expected a body of this package: Oscillator, Chain or Beam")
    ):
        load_scene(tmp_path / "s.toml")


FOREIGN = """
[component.tip]
fmu = "Oscillator"
[component.ball]
fmu = "{fmu}"
parameters = {{ x = 1.0, v = -1.0 }}
[[contact]]
between = ["tip", "ball"]
law = "hertz"
stiffness = 1e6
bodies = {{ ball = {{ displacement = "x", velocity = "v", force = "f", mass = 1.0 }} }}
[record]
recorded_time = 1.5
variables = ["ball.v"]
rate = 10
[execution]
macro_step = 0.1
"""


RIGID = """
[component.tip]
fmu = "Oscillator"
[component.ball]
fmu = "Mass.fmi3.fmu"
parameters = { x = 1.0, v = -1.0 }
[component.other]
fmu = "Mass.fmi2.fmu"
parameters = { x = 2.0, v = -1.0, m = 3.0 }
[component.floor]
fmu = "ImpactStop"
parameters = { restitution = 0.9, position = 3.0 }
[[contact]]
between = ["tip", "ball"]
restitution = 0.7
bodies = { ball = { displacement = "x", velocity = "v", force = "f", mass = 1.0 } }
[[contact]]
between = ["ball", "other"]
restitution = 0.7
[contact.bodies]
ball = { displacement = "x", velocity = "v", force = "f", mass = 1.0 }
other = { displacement = "x", velocity = "v", force = "f", mass = 3.0 }
[[contact]]
body = "other"
displacement = "x"
velocity = "v"
force = "f"
stop = "floor"
[record]
recorded_time = 14
variables = ["ball.v", "other.x"]
rate = 10
[execution]
macro_step = 0.1
"""


def test_rigid_impacts_of_bodies_of_other_tools_travel_as_a_system(tmp_path: Path) -> None:
    for version in ("2.0", "3.0"):
        mass(tmp_path, version)
    (tmp_path / "s.toml").write_text(RIGID)
    vi.export_ssp(tmp_path / "s.toml", tmp_path / "s.ssp")
    vi.import_ssp(tmp_path / "s.ssp", tmp_path / "back.toml")
    for name in ("s", "back"):
        run_scene(load_scene(tmp_path / f"{name}.toml"), tmp_path / f"{name}.nc")
    with xr.open_dataset(tmp_path / "s.nc") as one, xr.open_dataset(tmp_path / "back.nc") as two:
        assert one["event_time"].values[0] == pytest.approx(1.0, abs=1e-11)
        assert {int(who) for who in one["event_component"].values} == {1, 2, 3}
        for name in ("event_time", "ball_v", "other_x"):
            assert (one[name].values == two[name].values).all()


def test_a_body_of_another_tool_is_hit_where_the_law_yields(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(FOREIGN.format(fmu=mass(tmp_path, "3.0").name))
    scene = load_scene(tmp_path / "s.toml")
    (pair,) = scene.pairs
    assert pair.lower == ("tip", "contact[1]")
    assert pair.upper == BodyPoint("ball", "x", "v", "f", 1.0)
    assert pair.name == "tip.contact[1] - ball.x"
    run_scene(scene, tmp_path / "r.nc")
    with xr.open_dataset(tmp_path / "r.nc") as found:
        assert len(found["event_time"]) == 1
        assert found["ball_v"].values[-1] > 0.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"x", vel', '"y", vel', "contact[1].bodies.ball.displacement: expected an output of Mass.fmi3.fmu"),
        (
            'force = "f"',
            'force = "v"',
            "contact[1].bodies.ball.force: expected an input that is one real number",
        ),
        ('velocity = "v"', 'velocity = "x"', "contact[1].bodies.ball.velocity: expected a variable in m/s"),
        ("mass = 1.0 }", "mass = -1.0 }", "contact[1].bodies.ball.mass: expected a number > 0, got -1.0"),
        (
            ", mass = 1.0 }",
            " }",
            "contact[1].bodies.ball.mass: expected the effective mass, a number > 0, got nothing",
        ),
        ("{ ball =", "{ bal =", 'contact[1].bodies.bal: expected one of "tip" and "ball"'),
        ("bodies = { ball", "bodies = 3 # { ball", "contact[1].bodies: expected a table of bodies"),
        (
            "[record]",
            '[[connection]]\nfrom = "tip.velocity"\nto = "ball.f"\ngain_unit = "N.s/m"\n[record]',
            "contact[1].bodies.ball.force: expected an input that contacts alone feed",
        ),
    ],
)
def test_a_mistake_in_a_body_of_another_tool_is_told_with_its_place(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    text = FOREIGN.format(fmu=mass(tmp_path, "3.0").name)
    assert old in text
    (tmp_path / "s.toml").write_text(text.replace(old, new))
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "s.toml")
    assert any(said in str(problem) for problem in caught.value.problems), caught.value.problems


def test_a_body_that_cannot_restore_its_state_is_refused(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(FOREIGN.format(fmu=mass(tmp_path, "3.0", states=False).name))
    with pytest.raises(SceneError, match="expected an FMU whose state can be kept and restored"):
        load_scene(tmp_path / "s.toml")


def test_a_scene_with_pairs_says_what_hits_what() -> None:
    from vibroimpact.orchestrator.run.summary import contacts

    scene: Scene = parse_scene(SCENE, "pairs.toml")
    assert contacts(scene) == {
        "contact[1]": "a.contact[1] - c.contact[2], restitution",
        "contact[2]": "c.contact[2] - b.contact[1], hunt_crossley",
    }
