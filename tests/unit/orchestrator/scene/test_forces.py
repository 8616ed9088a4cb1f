"""Scenes of several forces: their keys and texts, their clock, the parameters of the FMU, one line for each mistake."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.command_line import in_this_process

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.campaign.manifest import flat_scene
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.run.summary import clock_remark
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BodyAlone, OscillatorBody
from vibroimpact.orchestrator.scene.forcing_clock import Clock

Tables = dict[str, Any]
SINE = {"amplitude": 1.0, "angular_frequency": 1.0}
MEAN = {"signal": "constant", "amplitude": -0.5}
ONE: Tables = {
    "body": {"mass": 4.0, "stiffness": 4.0, "damping_ratio": 0.1},
    "stop": [{"position": 1.0, "restitution": 0.8}],
    "forcing": [SINE | {"phase": 0.3}, SINE | {"amplitude": 0.25, "angular_frequency": 1.5}, MEAN],
    "record": {"recorded_periods": 3},
}
CHAIN = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0}
BEAM = {"kind": "beam", "length": 2.0, "mass_per_length": 0.5, "flexural_rigidity": 1.0, "modes": 3}
TIMES = {"record": {"recorded_time": 3.0}}
CHIRP = {
    "signal": "chirp",
    "amplitude": 1.0,
    "angular_frequency": 0.0,
    "end_angular_frequency": 2.0,
    "duration": 9.0,
}
PULSE = {"signal": "pulse", "amplitude": 1.0, "duration": 2.0, "shape": "triangle"}
TABLE = {"signal": "table", "times": [0.0, 1.0, 3.0], "values": [0.0, 1.0, 0.0]}
RANDOM = {"signal": "random", "density": [[0.5, 0.1], [5.0, 0.2]]}


def scene(**changes: Any) -> Scene:
    return Scene.from_dict(deepcopy(ONE) | changes)


def sines(*frequencies: float) -> list[Tables]:
    return [SINE | {"angular_frequency": w} for w in frequencies]


# ---- one sine stays as it is ----


def test_a_list_of_one_sine_is_the_scene_with_a_table() -> None:
    table = Scene.from_dict(ONE | {"forcing": SINE})
    text = (
        table.text.replace("[forcing]", "[[forcing]] # one")
        + '\n[sweep]\n"forcing[1].phase" = { values = [0, 1] }\n'
    )
    listed = Scene.from_text(text)
    assert "[forcing] # one" in listed.text
    assert [axis.key for axis in listed.sweep] == ["forcing.phase"]
    alone = listed.with_sweep({})
    assert alone.body == table.body == OscillatorBody(mass=4.0, stiffness=4.0, damping_ratio=0.1)
    assert float_parameters(alone, None) == float_parameters(table, None)
    assert flat_scene(alone) == flat_scene(table)
    assert "forcing.signal" not in flat_scene(table)


def test_one_sine_has_the_fmu_of_its_body_and_no_further_variables() -> None:
    one = Scene.from_dict(ONE | {"forcing": SINE})
    assert one.body.FMU == "Oscillator"
    assert not [name for name in (float_parameters(one, None) | integer_parameters(one)) if "sine" in name]
    assert (one.period, one.clock) == (2.0 * math.pi, Clock(1.0, 0.0))


# ---- keys ----


def test_keys_count_the_forces_and_the_first_needs_no_number() -> None:
    three = scene(
        sweep={"forcing.amplitude": {"values": [1.0, 2.0]}, "forcing[3].amplitude": {"values": [0.0]}}
    )
    assert [axis.key for axis in three.sweep] == ["forcing[1].amplitude", "forcing[3].amplitude"]
    assert three.value("forcing.amplitude") == three.value("forcing[1].amplitude") == 1.0
    assert three.at({"forcing.phase": 2.0, "forcing[2].amplitude": 7.0}).value("forcing[2].amplitude") == 7.0
    changed = three.with_values({"sweep": {}, "forcing.frequency": 3.0, "forcing[2].phase": 1.0})
    assert [force.angular_frequency for force in changed.forces[:2]] == [6.0 * math.pi, 1.5]
    assert changed.value("forcing[2].phase") == 1.0
    assert dict(three.numbers())["forcing[3].amplitude"] == -0.5


def test_a_sweep_of_the_first_force_keeps_the_comments_of_its_text() -> None:
    text = scene().text + '\n[sweep] # one\n"forcing.amplitude" = { values = [1, 2] }\n'
    assert text.replace('"forcing.', '"forcing[1].') == Scene.from_text(text).text


def test_both_names_of_the_first_force_are_one_key_too_many() -> None:
    axis = {"values": [1.0]}
    with pytest.raises(SceneError, match=r"sweep\.\"forcing\.amplitude\": expected a numeric key"):
        scene(sweep={"forcing.amplitude": axis, "forcing[1].amplitude": axis})


def test_the_only_force_of_several_is_refused_by_name() -> None:
    with pytest.raises(UsageError, match="forcing: expected one sine, got 2 sines and 1 constant"):
        assert scene().forcing


# ---- the clock ----


@pytest.mark.parametrize(
    ("frequencies", "expected"),
    [
        ((1.0, 2.0, 3.0), Clock(1.0, 0.0)),
        ((1.0, 1.0), Clock(1.0, 0.0)),
        ((2.0, 1.0), Clock(1.0, 0.0, 2)),
        ((0.3, 0.1), Clock(0.3 / 3, 0.0, 3)),
        ((6.0, 4.0, 9.0), Clock(1.0, 0.0, 6)),
        ((1.0, 65.0 / 64.0), Clock(1.0 / 64.0, 0.0, 64)),
        ((1.0, 66.0 / 65.0), Clock(1.0, 0.0, 1, is_common=False)),
        ((1.0, 1.0 + 1.0 / 63.0, 1.5), Clock(1.0, 0.0, 1, is_common=False)),
        ((1.0, math.sqrt(2.0)), Clock(1.0, 0.0, 1, is_common=False)),
        ((1.0, 1.5 * (1.0 + 1e-10)), Clock(1.0, 0.0, 1, is_common=False, near=((2, 3, 2),))),
        ((1.0, 1.5 * (1.0 + 1e-8)), Clock(1.0, 0.0, 1, is_common=False)),
    ],
)
def test_the_clock_has_the_common_period_of_all_sines_to_rounding(
    frequencies: tuple[float, ...], expected: Clock
) -> None:
    assert scene(forcing=sines(*frequencies)).clock == expected


def test_the_first_sine_is_at_phase_0_where_the_clock_is() -> None:
    clock = scene().clock
    assert clock is not None
    at = -clock.phase / clock.angular_frequency
    assert 1.0 * at + 0.3 == pytest.approx(0.0, abs=1e-15)


def test_a_swept_frequency_keeps_the_first_sine_as_the_clock() -> None:
    swept = scene(sweep={"forcing[2].angular_frequency": {"values": [1.5, 2.0]}})
    assert swept.clock == Clock(1.0, 0.3, 1, is_common=False)
    assert swept.at({"forcing[2].angular_frequency": 2.0}).clock == swept.clock
    assert "a frequency is swept" in clock_remark(swept)


def test_constants_alone_have_no_clock() -> None:
    alone = scene(forcing=MEAN, **TIMES)
    assert (alone.clock, alone.period, alone.body.FMU) == (None, None, "Structure")
    assert "forcing.angular_frequency" not in float_parameters(alone, None)


# ---- parameters ----


def test_a_common_period_makes_the_clock_a_sine_of_amplitude_0() -> None:
    numbers = float_parameters(scene(), None)
    assert (numbers["forcing.amplitude"], numbers["forcing.angular_frequency"]) == (0.0, 0.5)
    found = {name: value for name, value in numbers.items() if "sine" in name}
    assert found == {
        "sine[1].amplitude": 1.0,
        "sine[1].angular_frequency": 1.0,
        "sine[1].phase": 0.3,
        "mode.sine[1,1]": 0.5,
        "sine[2].amplitude": 0.25,
        "sine[2].angular_frequency": 1.5,
        "sine[2].phase": 0.0,
        "mode.sine[2,1]": 0.5,
        "sine[3].amplitude": -0.5,
        "sine[3].angular_frequency": 0.0,
        "sine[3].phase": 0.0,
        "mode.sine[3,1]": 0.5,
    }
    assert integer_parameters(scene())["sine[3].of_base"] is False


def test_the_first_sine_is_the_clock_of_whole_multiples() -> None:
    base = SINE | {"kind": "base_acceleration"}
    numbers = float_parameters(scene(forcing=[base, SINE | {"angular_frequency": 2.0}]), None)
    assert (numbers["forcing.base_acceleration"], numbers["forcing.amplitude"]) == (1.0, 0.0)
    assert numbers["mode.base[1]"] == numbers["mode.forcing[1]"] == -2.0
    assert "sine[2].amplitude" not in numbers


def test_a_run_that_goes_on_turns_all_sines_to_phase_0_of_the_first() -> None:
    numbers = float_parameters(scene(), (0.0, 0.0))
    assert numbers["forcing.phase"] == 0.0
    assert numbers["sine[1].phase"] == pytest.approx(0.0, abs=1e-15)
    assert numbers["sine[2].phase"] == pytest.approx(-0.45)


@pytest.mark.parametrize(
    ("body", "force", "row"),
    [
        (CHAIN, {"amplitude": [0.0, 3.0]}, [0.0, 3.0]),
        (CHAIN, {"kind": "base_acceleration", "amplitude": 3.0}, [-1.0, -2.0]),
        (BEAM, {"amplitude": 3.0, "location": 0.4}, "shape"),
        (BEAM, {"kind": "mode", "mode": 2, "amplitude": 3.0}, [0.0, 1.0, 0.0]),
        (BEAM, {"kind": "uniform", "amplitude": 3.0}, "length"),
    ],
)
def test_a_force_loads_the_modes_as_the_fmu_of_its_body_does(body: Tables, force: Tables, row: Any) -> None:
    several = scene(body=body, forcing=[force | {"signal": "constant"}, SINE | force], stop=[])
    structure = several.body
    assert isinstance(structure, BodyAlone)
    part = structure.assembly.parts[0]
    if row == "shape":
        row = part.point(0.4)
    elif row == "length":
        row = 2.0 * part.participation
    load = structure.load(several.forces[0])
    assert load == pytest.approx(structure.assembly.in_modes(np.array(row)), rel=1e-12, abs=1e-15)
    numbers = float_parameters(several, None)
    expected = 1.0 if isinstance(force["amplitude"], list) else 3.0
    assert numbers["sine[1].amplitude"] == expected


def test_forces_of_several_bodies_act_at_points() -> None:
    bodies = [{"name": name, "mass": 1.0, "stiffness": 1.0} for name in "ab"]
    link = [{"between": ["a", "b"], "stiffness": 0.5}]
    forces = [MEAN | {"at": "b"}, SINE | {"at": "a"}, MEAN | {"kind": "base_acceleration"}]
    several = scene(body=bodies, link=link, stop=[], forcing=forces)
    numbers = float_parameters(several, None)
    shapes = several.body.assembly.shapes
    assert [numbers[f"mode.sine[1,{i}]"] for i in (1, 2)] == pytest.approx(shapes[1])
    assert [numbers[f"mode.forcing[{i}]"] for i in (1, 2)] == pytest.approx(shapes[0])
    assert integer_parameters(several)["sine[2].of_base"] is True


def test_a_force_at_all_points_is_a_force_on_each_mass() -> None:
    bodies = [{"name": "a", "mass": 1.0, "stiffness": 1.0}, CHAIN | {"name": "b"}]
    forces = [SINE | {"at": "all"}, *(MEAN | {"at": at} for at in ("a", "b.1", "b.2"))]
    numbers = float_parameters(scene(body=bodies, stop=[], forcing=forces), None)
    whole = [numbers[f"mode.forcing[{i}]"] for i in (1, 2, 3)]
    assert whole == pytest.approx([sum(numbers[f"mode.sine[{k},{i}]"] for k in (1, 2, 3)) for i in (1, 2, 3)])
    one = scene(body=bodies, stop=[], forcing=SINE | {"at": "all"})
    assert [float_parameters(one, None)[f"mode.force[{i}]"] for i in (1, 2, 3)] == whole
    with pytest.raises(SceneError, match=r'forcing\.at: expected "all" for oscillators and chains'):
        scene(body=[*bodies, BEAM | {"name": "c"}], stop=[], forcing=SINE | {"at": "all"})


def test_the_view_of_a_scene_counts_its_forces() -> None:
    assert repr(scene()) == "<Scene scene: oscillator, 3 forces, 1 stop>"


def test_the_stop_of_a_beam_keeps_its_place_and_the_tip_is_observed() -> None:
    several = scene(body=BEAM, stop=[{"position": 1.0, "restitution": 0.5, "location": 0.6}])
    shapes = several.body.assembly
    numbers = float_parameters(several, None)
    part = shapes.parts[0]
    for name, place in (("contact_shape[1,", 0.6), ("observed_shape[", 1.0)):
        row = [numbers[f"mode.{name}{i}]"] for i in (1, 2, 3)]
        assert row == pytest.approx(shapes.in_modes(part.point(place)))


# ---- words ----


def test_a_remark_names_the_common_period_or_says_that_there_is_none() -> None:
    assert clock_remark(scene(forcing=sines(1.0, 2.0))) == ""
    assert clock_remark(scene(forcing=SINE)) == ""
    assert "common period of 2 sines: 2 periods of the first" in clock_remark(scene())
    assert clock_remark(scene(forcing=sines(1.0, math.pi))).startswith("quasi-periodic: 2 sines without")
    near = clock_remark(scene(forcing=sines(1.0, 1.5 + 1e-11)))
    assert near.endswith("forcing[2] is nearly 3/2 of the first frequency")


def test_a_campaign_knows_each_force_by_its_key() -> None:
    found = flat_scene(scene())
    assert [found[f"forcing[{number}].amplitude"] for number in (1, 2, 3)] == [1.0, 0.25, -0.5]
    assert found["forcing[3].signal"] == "constant"


# ---- mistakes ----


def sets(place: int, **keys: Any) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        tables["forcing"][place].update(keys)

    return change


def gives(**tables: Any) -> Callable[[Tables], None]:
    return lambda document: document.update(deepcopy(tables))


MISTAKES: list[tuple[Callable[[Tables], None], str]] = [
    (sets(1, angular_frequency=0.0), "forcing[2].angular_frequency: expected a number > 0 among several forces, got 0"),
    (sets(1, angular_frequency=-1.0), "forcing[2].angular_frequency: expected a number >= 0, got -1.0"),
    (sets(1, frequency=1.0), "forcing[2].frequency: expected angular_frequency (rad/s) or frequency (Hz), got both"),
    (lambda t: t["forcing"][1].pop("angular_frequency"),
     "forcing[2].angular_frequency: expected a number >= 0, got nothing"),
    (sets(2, angular_frequency=1.0), 'forcing[3].angular_frequency: expected a known key'),
    (sets(2, signal="square"), 'forcing[3].signal: expected "sine", "constant", "chirp", "pulse", "table" or "random"'),
    (sets(2, at="ball"), "forcing[3].at: expected at for several bodies, got it beside an oscillator"),
    (sets(2, kind="uniform"), 'forcing[3].kind: expected "force" or "base_acceleration" for an oscillator'),
    (sets(2, amplitude=[1.0, 2.0]), "forcing[3].amplitude: expected one number for an oscillator under force"),
    (sets(0, location=0.5), 'forcing[1].location: expected location for a beam with kind = "force"'),
    (gives(forcing=sines(*range(1, 18))), 'forcing: expected at most 16 forces of signal "sine", got 17'),
    (gives(forcing=[MEAN] * 9, **TIMES), 'forcing: expected at most 8 forces of signal "constant", got 9'),
    (gives(forcing=[*sines(*range(2, 18))]), "forcing: expected at most 15 sines and constants in all, got 16"),
    (gives(forcing=[*sines(*range(1, 17)), MEAN]), "forcing: expected at most 16 sines and constants in all, got 17"),
    (gives(record={"recorded_time": 3.0}), "record.recorded_time: expected recorded_periods in a forced scene"),
    (gives(forcing=[MEAN], record={"recorded_periods": 3}), "record.recorded_periods: expected recorded_time"),
    (gives(execution={"how": "coupled"}), 'execution.how: expected "auto" or "fused" beside several forces'),
    (gives(exciter={"gain": 1.0}), "exciter: expected [exciter] beside [forcing] with one sine"),
    (lambda t: t["body"].update(frequency_slope=0.1),
     "body.frequency_slope: expected frequency_slope beside [forcing]"),
    (gives(scene={"units": "nondimensional"}, forcing=[MEAN, {"amplitude": 1.0, "frequency": 2.0}]),
     "forcing[2].frequency: expected no frequency in Hz in a nondimensional scene"),
    (gives(sweep={"forcing[4].amplitude": {"values": [1.0]}}), 'sweep."forcing[4].amplitude": expected a numeric key'),
    (gives(sweep={"forcing[3].phase": {"values": [1.0]}}), 'sweep."forcing[3].phase": expected a numeric key'),
    (gives(sweep={"forcing[2].angular_frequency": {"values": [0.0, 1.0]}}),
     "forcing[2].angular_frequency: expected a number > 0"),
    (gives(sweep={"body.mass": {"start": 1.0, "stop": 2.0, "points": 3, "path": "up"}}),
     'sweep."body.mass".path: expected "independent" beside several forces'),
    (gives(forcing=3), "forcing: expected a table, got 3"),
    (gives(forcing=[3, MEAN]), "forcing: expected a table, got 3"),
    (gives(forcing=[PULSE] * 9, **TIMES), "forcing: expected at most 8 chirps, pulses, tables and random forces"),
    (gives(forcing=[TABLE | {"times": [*range(4097)], "values": [0.0] * 4097}] * 2, **TIMES),
     "forcing: expected at most 8192 rows of all tables and densities, got 8194"),
    (gives(forcing=CHIRP | {"duration": 0.0}, **TIMES), "forcing.duration: expected a number > 0, got 0.0"),
    (gives(forcing=CHIRP | {"spacing": "logarithmic"}, **TIMES),
     "forcing.angular_frequency: expected a number > 0 for a logarithmic chirp, got 0"),
    (gives(forcing=CHIRP | {"seed": 1}, **TIMES), "forcing.seed: expected a known key"),
    (gives(forcing=PULSE | {"shape": "box"}, **TIMES), 'forcing.shape: expected "half_sine", "triangle" or'),
    (gives(forcing=PULSE | {"rise": 0.5}, **TIMES), 'forcing.rise: expected rise with shape = "trapezoid"'),
    (gives(forcing=PULSE | {"shape": "trapezoid", "rise": 1.5}, **TIMES), "forcing.rise: expected at most half of"),
    (gives(forcing=TABLE | {"times": [0.0, 1.0, 1.0]}, **TIMES),
     "forcing.times: expected instants that ascend, got 1.0 as number 3, after 1.0"),
    (gives(forcing=TABLE | {"times": [0.0, 1.0]}, **TIMES), "forcing.values: expected one value for each instant"),
    (gives(forcing={"signal": "table"}, **TIMES), "forcing: expected times and values, or file, got neither"),
    (gives(forcing={"signal": "table", "times": [0.0, 1.0]}, **TIMES), "forcing: expected times and values, or file"),
    (gives(forcing={"signal": "table", "file": "no.csv"}, **TIMES), "forcing.file: expected a file that can be read"),
    (gives(forcing={"signal": "random"}, **TIMES), "forcing: expected band or density, got neither"),
    (gives(forcing=RANDOM | {"band": [2.0, 2.0]}, **TIMES), "forcing.band: expected a band whose lower end is below"),
    (gives(forcing=RANDOM | {"band": [0.1, 3.0]}, **TIMES), "forcing.density: expected a density over all of the band"),
    (gives(forcing=RANDOM | {"density": [[0.5, -0.1], [5.0, 0.2]]}, **TIMES), "forcing.density[1][2]: expected a pair"),
    (gives(forcing=RANDOM | {"density": [[0.5, 0.1], [0.5, 0.2]]}, **TIMES),
     "forcing.density: expected angular frequencies that ascend"),
    (gives(forcing=RANDOM | {"density": [[0.5, 0.0], [5.0, 0.0]]}, **TIMES), "forcing.density: expected a density > 0"),
    (gives(forcing=RANDOM | {"seed": -1}, **TIMES), "forcing.seed: expected a whole number from 0 to 1000000000"),
    (gives(forcing=RANDOM, **TIMES, sweep={"forcing.seed": {"values": [0.5]}}), 'sweep."forcing.seed": expected a'),
]  # fmt: skip


@pytest.mark.parametrize(("change", "expected"), MISTAKES, ids=[expected for _, expected in MISTAKES])
def test_a_mistake_in_several_forces_is_one_line(change: Callable[[Tables], None], expected: str) -> None:
    tables = deepcopy(ONE)
    change(tables)
    with pytest.raises(SceneError) as refused:
        Scene.from_dict(tables)
    (line,) = str(refused.value).splitlines()
    assert line.removeprefix("scene: ").startswith(expected)


def test_a_force_at_no_point_of_several_bodies_is_one_line() -> None:
    bodies = [{"name": name, "mass": 1.0, "stiffness": 1.0} for name in "ab"]
    for at, expected in (
        ({"at": "c"}, "a point of a body of this scene"),
        ({}, "the point where the force acts"),
    ):
        with pytest.raises(SceneError, match=rf"forcing\[2\]\.at: expected {expected}"):
            scene(body=bodies, stop=[], forcing=[SINE | {"at": "a"}, MEAN | at])


def test_a_bad_force_on_the_command_line_leaves_exit_code_2(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(scene().text)
    ended = in_this_process("check", path, "--set", "forcing[2].angular_frequency=0")
    assert ended.returncode == 2
    assert "forcing[2].angular_frequency: expected a number > 0" in ended.stderr


def test_check_says_the_common_period(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(scene().text)
    assert "2 periods of the first" in in_this_process("check", path).stdout
