"""`vibroimpact check`: the engine and the cost of a scene, from one computed point."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.busy_runner import BusyRunner
from support.campaign_scenes import frequency_text, plane_text, scene_of
from support.command_line import in_this_process

import vibroimpact.orchestrator.campaign.check as scene_check
import vibroimpact.orchestrator.scene.sweep as sweep
from vibroimpact.analysis.dataset import Outcome, RunRecord, read_flat
from vibroimpact.orchestrator.campaign import cost_of
from vibroimpact.orchestrator.campaign.check import BYTES_BESIDE
from vibroimpact.orchestrator.run.summary import effects, engine, in_one_line, laws
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene

BODY = "[body]\nmass = 1.0\nstiffness = 1.0\n"
RECORD = "[record]\nrecorded_time = 5.0\n"
HERTZ = '[[stop]]\nlaw = "hertz"\nposition = 1.0\nstiffness = 9.0\n'
RIGID = "[[stop]]\nposition = 1.0\nrestitution = 0.7\n"
CHAIN = '[body]\nkind = "chain"\nmasses = [1.0, 1.0]\nstiffnesses = 1.0\n'
BEAM = '[body]\nkind = "beam"\nlength = 1.0\nmass_per_length = 1.0\nflexural_rigidity = 1.0\nmodes = 3\n'
COMPONENTS = """
[component.left]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.0, displacement_start = 1.0 }
[component.right]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.0 }
[[connection]]
from = "left.displacement"
to = "right.force"
gain_unit = "N/m"
[record]
recorded_time = 1.0
[execution]
macro_step = 0.1
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    return tmp_path / "scene.toml"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BODY + RIGID + RECORD, "fused: Oscillator, one mass, closed form between impacts"),
        (BODY + HERTZ + RECORD, "fused: Oscillator, one mass, as a structure because a stop yields"),
        (CHAIN + RIGID + RECORD, "fused: Chain, a structure of 2 masses"),
        (BEAM + RECORD, "fused: Beam, a structure of 3 modes"),
        (
            BODY + RIGID + RECORD + '[execution]\nhow = "coupled"\n',
            "coupled: Oscillator, one mass, closed form between impacts; an ImpactStop for each stop",
        ),
        (COMPONENTS, "coupled: left, right; gauss_seidel exchange every 0.1 s"),
    ],
)
def test_the_engine_that_follows_the_motion_is_said(text: str, words: str) -> None:
    assert engine(scene_of(text)) == words


def called_for(scene: Scene) -> set[str]:
    return {name for name, there in effects(scene).items() if there}


def test_only_the_effects_that_a_scene_calls_for_are_there() -> None:
    assert called_for(scene_of(BODY + RECORD)) == set()
    assert called_for(scene_of(COMPONENTS)) == {"connections"}
    damped = BODY + "damping_ratio = 0.1\ndamping_slope = 0.2\n" + RIGID + "yield_velocity = 1.0\n" + RECORD
    assert called_for(scene_of(damped)) == {
        *("damping", "stops", "restitution that falls with speed", "motion that depends on its amplitude")
    }
    series = 'time_series = { rate = 9, variables = ["energy.kinetic"] }\n'
    assert called_for(scene_of(CHAIN + RECORD + series)) == {"time series", "energies"}
    assert called_for(scene_of(BODY + RECORD + series)) == {"time series"}


MEASURED_COMPONENTS = """
[component.body]
fmu = "Beam"
[component.body.parameters]
"forcing.amplitude" = 1.0
"forcing.angular_frequency" = 9.0
"damping_ratio[1]" = 0.01
"contact[1].law" = "restitution"
"contact[1].position" = 0.1
"contact[1].yield_velocity" = 0.5
"contact[2].law" = "none"
"amplitude.damping_slope[1]" = 0.1
[component.sensor]
fmu = "Sensor"
[component.noise]
fmu = "Noise"
[component.converter]
fmu = "AnalogInput"
[component.exciter]
fmu = "Exciter"
parameters = { distance = 0.0 }
[record]
recorded_time = 1.0
rate = 20
variables = ["body.energy.kinetic"]
[execution]
macro_step = 0.1
"""


def test_components_call_for_the_effects_that_the_short_form_calls_for() -> None:
    named = {
        *("forcing", "damping", "stops", "restitution that falls with speed", "energies", "time series"),
        *("motion that depends on its amplitude", "sensor", "noise", "AD conversion", "exciter"),
    }
    assert called_for(scene_of(MEASURED_COMPONENTS)) == named
    assert "stops" in in_one_line(scene_of(MEASURED_COMPONENTS))
    swept = MEASURED_COMPONENTS + '[sweep]\n"exciter.distance" = { values = [0.0, 0.5] }\n'
    assert called_for(scene_of(swept)) == named | {"force that falls with distance"}
    nothing = MEASURED_COMPONENTS.replace('"restitution"', '"none"').replace(
        '= 1.0\n"forcing', '= 0.0\n"forcing'
    )
    assert called_for(scene_of(nothing)) == named - {"forcing", "stops"}
    short = set(effects(scene_of(BODY + RECORD)))
    assert short <= set(effects(scene_of(COMPONENTS)))  # absent effects are listed as well


def test_an_effect_that_is_swept_is_called_for_where_one_point_has_it() -> None:
    swept = BODY + RECORD + '[sweep]\n"body.damping" = { values = [0.0, 0.1], path = "up" }\n'
    assert called_for(scene_of(swept)) == {"damping", "continuation"}


def test_a_scene_is_told_in_one_line_with_its_laws() -> None:
    scene = scene_of(
        BODY + "damping = 0.1\n" + RIGID + HERTZ.replace("1.0", "-1.0") + 'side = "lower"\n' + RECORD
    )
    assert laws(scene) == {"stop[1]": "restitution", "stop[2]": "hertz"}
    assert in_one_line(scene).endswith("a stop yields; stop[1] restitution, stop[2] hertz; damping")


def test_a_run_and_its_dataset_say_what_ran(scene_file: Path) -> None:
    text = BODY + "damping = 0.1\n" + HERTZ + RECORD
    scene_file.write_text(text)
    output = scene_file.with_suffix(".nc")
    done = in_this_process("run", scene_file, "-o", output)
    line = "fused: Oscillator, one mass, as a structure because a stop yields; stop[1] hertz; damping"
    assert done.stdout.splitlines()[1:] == [line]
    assert read_flat(output).attrs["engine"] == line


def test_points_and_branches_are_those_of_the_sweep() -> None:
    plane = cost_of(scene_of(plane_text(5, 3, milliseconds=1.0)))
    assert (plane.points, plane.branches) == (30, 6)
    flat = cost_of(scene_of(frequency_text(7)))
    assert (flat.points, flat.branches) == (7, 7)
    assert flat.trial is not None
    assert flat.trial.values == {"forcing.angular_frequency": pytest.approx(1.1)}
    assert flat.seconds(100) == pytest.approx(flat.seconds() / 7)  # type: ignore[operator]


def test_a_sweep_of_a_hundred_million_points_is_not_gone_through(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone_through(*_: object) -> None:
        raise AssertionError("a point was made of the sweep")

    monkeypatch.setattr(sweep.Points, "_point", gone_through)
    axes = "\n".join(
        f'"body.{key}" = {{ start = 1, stop = 2, points = 10000 }}' for key in ("mass", "stiffness")
    )
    cost = cost_of(scene_of(BODY + RECORD + "[sweep]\n" + axes))
    assert cost.points == 10**8
    assert cost.result_bytes is not None
    assert cost.result_bytes > 10**9


@pytest.mark.parametrize("text", [frequency_text(40, milliseconds=1.0), BODY + RECORD, COMPONENTS])
def test_the_size_of_the_dataset_is_foretold(text: str, tmp_path: Path) -> None:
    scene = scene_of(text)
    foretold = cost_of(scene).result_bytes
    run_scene(scene, tmp_path / "run.nc")
    assert foretold is not None
    assert foretold + BYTES_BESIDE == pytest.approx((tmp_path / "run.nc").stat().st_size, rel=0.3)


def test_a_point_that_does_not_end_is_given_up(monkeypatch: pytest.MonkeyPatch, scene_file: Path) -> None:
    monkeypatch.setattr(scene_check, "MOST_TRIAL_SECONDS", 0.1)
    scene_file.write_text(
        frequency_text(3).replace("transient_periods = 10", "transient_periods = 1000000000")
    )
    done = in_this_process("check", scene_file)
    assert done.returncode == 0, done.stderr
    assert "given up after" in done.stdout
    assert "run       more than" in done.stdout
    assert "dataset" not in done.stdout


def test_results_that_memory_does_not_hold_are_said_and_not_tried(scene_file: Path) -> None:
    scene_file.write_text(frequency_text(3).replace("recorded_periods = 2", "recorded_periods = 100000000"))
    done = in_this_process("check", scene_file)
    assert done.returncode == 0, done.stderr
    assert "trial     none: it would record 4.0 GB, more than 1.0 GB" in done.stdout
    assert "run       refused: expected results of at most 1.0 GB" in done.stdout


def test_check_says_what_runs_and_what_it_costs(scene_file: Path) -> None:
    scene_file.write_text(frequency_text(3, path="up-down"))
    done = in_this_process("check", scene_file, "--set", "stop[1].restitution=0.5")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == f"{scene_file}: no problems"
    assert [line.split()[0] for line in lines[1:]] == [
        *("engine", "stops", "effects", "without", "points", "trial", "modes", "run", "campaign", "dataset")
    ]
    assert "6 in 2 branches of 3, along which each starts where the one before ended" in done.stdout
    assert "one point was computed, forcing.angular_frequency = 1.1: " in done.stdout
    assert list(scene_file.parent.iterdir()) == [scene_file]


def test_check_lists_all_problems_as_run_does(scene_file: Path) -> None:
    scene_file.write_text(frequency_text(3).replace("mass", "mas").replace("0.7", "1.7"))
    checked, run = in_this_process("check", scene_file), in_this_process("run", scene_file, "-o", "x.nc")
    assert checked.returncode == 2
    assert checked.stdout == ""
    assert checked.stderr == run.stderr
    assert "restitution" in checked.stderr
    assert "mass" in checked.stderr


def test_a_point_that_fails_is_told_and_ends_with_exit_code_1(scene_file: Path) -> None:
    beyond = BEAM + "displacement_start = [5.0]\n" + RIGID.replace("1.0", "0.1") + RECORD
    scene_file.write_text(beyond)
    done = in_this_process("check", scene_file)
    assert done.returncode == 1
    assert "outcome error after" in done.stdout


def test_ctrl_c_during_the_trial_frees_what_was_loaded(
    monkeypatch: pytest.MonkeyPatch, scene_file: Path
) -> None:
    freed = []

    class Hanging(BusyRunner):
        def run(self, *_: object) -> RunRecord:
            raise KeyboardInterrupt

        def close(self) -> None:
            freed.append(self)

    monkeypatch.setattr(scene_check, "open_scene", Hanging)
    scene_file.write_text(frequency_text(3))
    assert in_this_process("check", scene_file).returncode == 130
    assert freed


def test_a_replay_whose_recording_is_not_named_is_not_tried(scene_file: Path) -> None:
    replay = '[replay]\ndrive = "force"\nfrom = "hammer"\n'
    scene_file.write_text(BODY + replay)
    cost = cost_of(scene_of(BODY + replay))
    assert cost.trial is None
    assert "vibroimpact replay" in cost.untried


def test_outcomes_of_physics_are_no_failures() -> None:
    resting = (
        BODY + RIGID.replace("1.0", "-0.5") + "[forcing]\namplitude = 5.0\nangular_frequency = 0.0\n" + RECORD
    )
    resting = resting.replace(
        "stiffness = 1.0\n", "stiffness = 1.0\ndisplacement_start = -0.5\ndamping = 0.1\n", 1
    )
    trial = cost_of(scene_of(resting)).trial
    assert trial is not None
    assert trial.outcome is Outcome.stuck
