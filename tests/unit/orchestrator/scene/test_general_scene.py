"""General scenes: components of any FMU file, connections, watched events, and messages on mistakes."""

from __future__ import annotations

import pickle
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from support.ball_scenes import BALL, FREE_BALL, ball_problems, coupled, write_fmu
from support.component_mistakes import COUPLED
from support.places import ROOT
from support.scenes import problems_of

from vibroimpact.fmus import fmu_path, shipped
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.campaign.manifest import flat_scene, scene_hash
from vibroimpact.orchestrator.importer import specification
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene
from vibroimpact.orchestrator.scene.component_facts import component_facts
from vibroimpact.orchestrator.scene.sweep import expand


@pytest.fixture
def ball(tmp_path: Path) -> Callable[[str], Scene]:
    """Return a function that reads scenes in a folder with ball.fmu."""
    write_fmu(tmp_path / "ball.fmu")
    return lambda text: parse_scene(text, str(tmp_path / "s.toml"))


# Reading.


def test_a_general_scene_is_what_the_importer_is_asked() -> None:
    scene = parse_scene(COUPLED, "s.toml")
    assert scene.components == (
        ComponentSpec("a", fmu_path("Oscillator").absolute(), {"mass": 2.0, "contact[1].law": 1}),
        ComponentSpec("b", fmu_path("Oscillator", "2.0").absolute(), {}),
    )
    assert scene.connections == (ConnectionSpec(("b", "displacement"), ("a", "force"), 0.5, "N/m"),)
    assert (scene.events, scene.sampled, scene.sampling_rate) == ((), (), 0.0)
    assert (scene.macro_step, scene.execution.exchange, scene.execution.guard) == (0.1, "gauss_seidel", False)
    assert (scene.record.transient_time, scene.record.recorded_time, scene.record.impacts) == (1.0, 2.0, True)
    assert (scene.forcing, scene.stops, scene.period, scene.execution.how) == (None, (), None, "auto")


def test_start_values_have_the_type_of_their_variable() -> None:
    parameters = parse_scene(COUPLED, "s.toml").components[0].parameters
    assert type(parameters["mass"]) is float
    assert type(parameters["contact[1].law"]) is int


def test_a_scene_of_the_short_form_is_not_a_general_one() -> None:
    scene = parse_scene("[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 5", "s.toml")
    assert scene.is_one_body


def test_a_general_scene_has_no_body() -> None:
    with pytest.raises(UsageError, match=r"s\.toml: body: expected .*, got a general scene"):
        _ = parse_scene(COUPLED, "s.toml").body


def test_fmu_paths_count_from_the_folder_of_the_scene(tmp_path: Path) -> None:
    (tmp_path / "fmus").mkdir()
    file = write_fmu(tmp_path / "fmus" / "ball.fmu")
    (tmp_path / "s.toml").write_text(FREE_BALL.replace("ball.fmu", "fmus/ball.fmu"))
    scene = load_scene(tmp_path / "s.toml")
    assert scene.components[0].fmu == file
    absolute = parse_scene(FREE_BALL.replace("ball.fmu", str(file)), "s.toml")
    assert absolute.components[0].fmu == file


def test_foreign_code_is_guarded_unless_the_scene_says_otherwise(ball: Callable[[str], Scene]) -> None:
    assert ball(FREE_BALL).execution.guard
    assert not ball(FREE_BALL + "[execution]\nguard = false").execution.guard
    assert parse_scene(COUPLED + "guard = true", "s.toml").execution.guard


def test_one_component_alone_steps_over_the_whole_run(ball: Callable[[str], Scene]) -> None:
    assert ball(FREE_BALL + "transient_time = 2.0").macro_step == 5.0


def test_events_and_recorded_variables_are_named_by_component(ball: Callable[[str], Scene]) -> None:
    text = FREE_BALL + 'variables = ["ball.h", "ball.up", "ball.v"]\nrate = 200\nevents = false\n'
    scene = ball(text + '[[event]]\nwatch = "ball.h"\ndirection = "falling"\nlevel = 0.5')
    assert scene.events == (EventSpec("ball", "h", "falling", 0.5),)
    assert (scene.sampled, scene.sampling_rate) == (("ball.h", "ball.up", "ball.v"), 200.0)
    assert {name: scene.declared_units[name] for name in scene.sampled} == {
        "ball.h": "m",
        "ball.up": "1",
        "ball.v": "m/s",
    }
    assert not scene.record.impacts


def test_a_start_state_is_a_start_value_though_it_is_an_output(ball: Callable[[str], Scene]) -> None:
    scene = ball(FREE_BALL.replace("[record]", "parameters = { h = 2 }\n[record]"))
    assert scene.components[0].parameters == {"h": 2.0}


def test_units_agree_by_meaning_and_a_missing_one_agrees_with_all(ball: Callable[[str], Scene]) -> None:
    ends = [("h", "in"), ("h", "in_length"), ("v", "in_bare"), ("up", "hold")]
    text = "".join(f'[[connection]]\nfrom = "ball.{a}"\nto = "ball.{b}"\n' for a, b in ends)
    assert len(ball(FREE_BALL + text + "[execution]\nmacro_step = 1").connections) == 4


def test_the_short_form_does_not_load_what_reads_descriptions() -> None:
    code = (
        "import sys\nfrom vibroimpact.orchestrator.scene.scene import load_scene\n"
        f"load_scene({str(ROOT / 'examples' / 'coupled_p11.toml')!r})\nprint('fmpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


# Sweeps.

SWEPT = (
    COUPLED
    + """\
[sweep]
"a.stiffness" = { values = [3, 4] }
"b.stiffness" = { values = [1.0] }
"connection[1].gain" = { start = 0, stop = 1, points = 3 }
"b.contact[2].law" = { values = [1, 5] }
"""
)


def test_any_start_value_and_any_gain_is_swept() -> None:
    scene = parse_scene(SWEPT, "s.toml")
    keys = [axis.key for axis in scene.sweep]
    assert keys == ["a.stiffness", "b.stiffness", "connection[1].gain", "b.contact[2].law"]
    names = [scene.sweep_coordinate_name(key) for key in keys]
    assert names == ["a_stiffness", "b_stiffness", "gain", "law"]
    assert [scene.declared_units[key] for key in keys] == ["N/m", "N/m", "N/m", "1"]
    assert len(expand(scene)[0].points) == 12


def test_each_point_of_a_sweep_has_its_own_values() -> None:
    scene = parse_scene(SWEPT, "s.toml")
    last = list(expand(scene)[0].points)[-1]
    scene = scene.at(last.values)
    assert scene.components[0].parameters["stiffness"] == 4.0
    assert scene.components[0].parameters["mass"] == 2.0
    assert scene.connections[0].gain == 1.0
    law = scene.components[1].parameters["contact[2].law"]
    assert (law, type(law)) == (5, int)
    back = {key: scene.value(key) for key in last.values}
    assert scene.at(last.values).at(back) == scene


def test_a_swept_start_value_that_is_not_written_has_its_first_value() -> None:
    scene = parse_scene(SWEPT, "s.toml")
    assert (scene.value("a.stiffness"), scene.value("connection[1].gain")) == (3.0, 0.5)


@pytest.mark.parametrize(
    "key",
    ["a.stiffness", "c.mass", "a", "", "connection[2].gain", "connection[1].from", "body.mass", "a.hold"],
)
def test_a_key_without_a_number_is_misuse(key: str) -> None:
    scene = parse_scene(coupled("mass = 2,", 'mass = 2, "record.impacts" = true,'), "s.toml")
    with pytest.raises(UsageError, match="expected"):
        scene.value(key)
    with pytest.raises(UsageError, match="expected"):
        scene.at({key: 1.0})


def test_a_point_is_much_faster_than_reading_the_scene_again() -> None:
    scene = parse_scene(SWEPT, "s.toml")

    def best(action: Callable[[], object]) -> float:
        times = []
        for _ in range(20):
            start = time.perf_counter()
            action()
            times.append(time.perf_counter() - start)
        return min(times)

    changed = best(lambda: scene.at({"a.stiffness": 1.0, "connection[1].gain": 2.0}))
    assert changed * 10 < best(lambda: parse_scene(SWEPT, "s.toml"))


def test_a_description_is_read_once_for_files_of_the_same_contents(tmp_path: Path) -> None:
    file = write_fmu(tmp_path / "ball.fmu")
    facts = component_facts(file)
    assert component_facts(file) is facts
    write_fmu(file, restorable=False)
    assert not component_facts(file).restorable


def test_a_scene_travels_to_workers() -> None:
    scene = parse_scene(SWEPT, "s.toml")
    again = pickle.loads(pickle.dumps(scene))
    assert again == scene
    assert hash(again) == hash(scene)


def test_a_worker_takes_shipped_fmus_from_its_own_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = ComponentSpec("a", fmu_path("Oscillator"))
    theirs = ComponentSpec("ball", tmp_path / "ball.fmu")
    message = pickle.dumps((ours, theirs))
    monkeypatch.setattr(specification, "package_folder", lambda: Path("/elsewhere"))
    assert pickle.loads(message) == (
        ComponentSpec("a", Path("/elsewhere/built/fmi3/Oscillator.fmu")),
        theirs,
    )


def test_a_scene_is_the_same_in_another_folder(tmp_path: Path) -> None:
    scene = parse_scene(SWEPT, "s.toml")
    hashes = set()
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        write_fmu(folder / "ball.fmu")
        hashes.add(scene_hash(parse_scene(FREE_BALL, str(folder / "s.toml"))))
    assert len(hashes) == 1
    flat = flat_scene(scene)
    assert (flat["general.components[1].fmu"], flat["general.connections[1].gain"]) == ("Oscillator.fmu", 0.5)


# Messages on single mistakes.


def test_two_connections_cannot_feed_one_input_under_any_of_its_names(tmp_path: Path) -> None:
    first = '[[connection]]\nfrom = "ball.h"\nto = "ball.in_metre"'
    second = first.replace("in_metre", "in")
    (problem,) = ball_problems(tmp_path, first, second, "[execution]\nmacro_step = 1")
    assert problem == (
        'connection[2].to: expected an input of its own for each connection, got "ball.in", '
        "which connection[1] feeds already. Remove one of them."
    )


def test_units_of_another_size_are_refused_with_a_gain_unit_that_fits(tmp_path: Path) -> None:
    connection = '[[connection]]\nfrom = "ball.h"\nto = "ball.in_mm"'
    (problem,) = ball_problems(tmp_path, connection, "[execution]\nmacro_step = 1")
    assert "got m (ball.h) to mm (ball.in_mm)." in problem
    assert problem.endswith('gain_unit = "mm/m".')


def test_a_gain_between_switches_is_refused(tmp_path: Path) -> None:
    connection = '[[connection]]\nfrom = "ball.up"\nto = "ball.hold"\ngain = 2'
    (problem,) = ball_problems(tmp_path, connection, "[execution]\nmacro_step = 1")
    assert problem.startswith("connection[1].gain: expected a gain between real numbers only, got 2.0")


@pytest.mark.parametrize(
    ("parameter", "problem"),
    [
        ("e = 1.2", "component.ball.parameters.e: expected a finite number from 0.5 to 1, got 1.2."),
        ("bits = 256", "component.ball.parameters.bits: expected a whole number from 0 to 255, got 256."),
        ("bits = -1", "component.ball.parameters.bits: expected a whole number from 0 to 255, got -1."),
        ("label = 1", "component.ball.parameters.label: expected text, got 1."),
        ("hold = 1", "component.ball.parameters.hold: expected true or false, got 1."),
        (
            "v_min = 1",
            "component.ball.parameters.v_min: expected a variable with a start value, got the constant local "
            "v_min (Float64). Parameters, inputs and start states have one.",
        ),
    ],
)
def test_a_start_value_fits_its_variable(tmp_path: Path, parameter: str, problem: str) -> None:
    assert ball_problems(tmp_path, f"[component.ball.parameters]\n{parameter}") == [problem]


def test_swept_values_stay_within_the_limits_of_their_variable(tmp_path: Path) -> None:
    (problem,) = ball_problems(tmp_path, '[sweep]\n"ball.e" = { values = [0.7, 0.4] }')
    assert problem == 'sweep."ball.e": expected a finite number from 0.5 to 1, got 0.4.'


@pytest.mark.parametrize(
    ("event", "problem"),
    [
        (
            'watch = "ball.up"\ndirection = "rising"',
            "event[1].watch: expected a continuous real number, got the discrete Boolean ball.up. "
            "A crossing needs values on both sides.",
        ),
        (
            'watch = "ball.hh"\ndirection = "rising"',
            'event[1].watch: expected a variable of ball.fmu after ball., got "ball.hh". '
            "Did you mean ball.h?",
        ),
        (
            'watch = "ball.h"\ndirection = "faling"',
            'event[1].direction: expected "falling", "rising" or "either", got "faling". '
            'Did you mean "falling"?',
        ),
        (
            'watch = "ball.h"\ndirection = "falling"\nlevel = inf',
            "event[1].level: expected a finite number, got inf.",
        ),
    ],
)
def test_an_event_watches_a_continuous_number(tmp_path: Path, event: str, problem: str) -> None:
    assert ball_problems(tmp_path, f"[[event]]\n{event}") == [problem]


def test_an_event_needs_an_fmu_whose_state_can_be_restored(tmp_path: Path) -> None:
    write_fmu(tmp_path / "ball.fmu", restorable=False)
    text = FREE_BALL + '[[event]]\nwatch = "ball.h"\ndirection = "falling"'
    (problem,) = problems_of(text, tmp_path / "s.toml")
    expected = "an FMU whose state can be kept and restored"
    assert problem.startswith(f"event[1].watch: expected {expected}, got ball.fmu")


# Messages on FMU files.


def test_every_fmu_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    write_fmu(tmp_path / "ball.fmu")
    (tmp_path / "broken.fmu").write_bytes(b"no archive")
    (tmp_path / "folder.fmu").mkdir()
    write_fmu(tmp_path / "scheduled.fmu", interface="ScheduledExecution")
    write_fmu(tmp_path / "twice.fmu", variables=BALL + BALL)
    files = ["bal.fmu", "no/x.fmu", "broken.fmu", "folder.fmu", "scheduled.fmu", "twice.fmu", "Oscilator"]
    tables = [f'[component.c{number}]\nfmu = "{file}"' for number, file in enumerate(files)]
    tables.append('[component.c7]\nfmu = "ball.fmu"\nfmi = "3.0"')
    tables.append('[[connection]]\nfrom = "c0.x"\nto = "c1.y"')
    problems = problems_of("\n".join([*tables, "[record]\nrecorded_time = 1"]), tmp_path / "s.toml")
    starts = [
        f"component.c0.fmu: expected an FMU file, got no file {tmp_path}/bal.fmu. Did you mean ball.fmu?",
        f"component.c1.fmu: expected an FMU file, got no file {tmp_path}/no/x.fmu. "
        f"There is no folder {tmp_path}/no.",
        "component.c2.fmu: expected an intact FMU, got an error: ",
        f"component.c3.fmu: expected an FMU file, got the folder {tmp_path}/folder.fmu.",
        "component.c4.fmu: expected an FMU for co-simulation or model exchange, "
        "got scheduled.fmu for scheduled execution only. ",
        "component.c5.fmu: expected an intact FMU, got an error: ",
        "component.c6.fmu: expected a path that ends in .fmu, grpc://HOST:PORT, or the name of a shipped component, "
        'got "Oscilator". Did you mean Oscillator?',
        "component.c7.fmi: expected fmi beside the name of a shipped component only, "
        'got fmi = "3.0" beside a file. ',
        "execution.macro_step: ",
    ]
    assert len(problems) == len(starts)
    for problem, start in zip(problems, starts, strict=True):
        assert problem.startswith(start)
        assert "\n" not in problem


def test_a_component_that_is_not_built_says_how_to_build_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    package = Path(shutil.copytree(ROOT / "fmus" / "native", tmp_path / "native")).parent
    monkeypatch.setattr("vibroimpact.fmus.shipped.package_folder", lambda: package)
    (problem,) = problems_of('[component.a]\nfmu = "Oscillator"\n[record]\nrecorded_time = 1')
    assert problem == (
        "component.a.fmu: expected Oscillator built for FMI 3.0, got no FMU. "
        "Run `python -m vibroimpact.fmus.packaging.build`."
    )


def test_the_folder_of_the_package_is_looked_into_a_few_times_for_any_number_of_components(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked, folders = list[None](), shipped._folders
    monkeypatch.setattr(shipped, "_folders", lambda: looked.append(None) or folders())
    tables = "".join(f'[component.c{k}]\nfmu = "{"Gain" if k % 2 else "No"}"\n' for k in range(200))
    with pytest.raises(SceneError, match=r"component\.c0\.fmu: expected a path that ends in \.fmu"):
        parse_scene(tables + "[record]\nrecorded_time = 1.0\n", "many.toml")
    assert len(looked) < 5


@pytest.mark.parametrize("name", ["h.i", "1a", "", "a b", "\u00e4"])
def test_a_component_has_a_plain_name(name: str) -> None:
    text = f'[component."{name}"]\nfmu = "Oscillator"\n[record]\nrecorded_time = 1'
    (problem,) = problems_of(text)
    assert f'expected a name of letters, digits and _, got "{name}".' in problem


# Messages on tables.


def test_a_scene_has_one_form() -> None:
    (problem,) = problems_of(COUPLED + "[body]\nmass = 1\n[[stop]]\n[[event]]\n")
    assert problem == (
        "component: expected [component.NAME], [[connection]], [[contact]] and [[event]], "
        "or [body], [forcing] and [[stop]], got [component], [connection], [event] beside [body], [stop]. "
        'Remove those of one form; the body of the short form is fmu = "Oscillator" in the general one.'
    )


def test_tables_of_the_wrong_shape_say_how_to_write_them() -> None:
    text = "component = 3\nconnection = 4\nrecord = 5\nextra = 1\nsweep = 1\n[event]\n[daq]\n"
    starts = [problem.split(", got ")[0] for problem in problems_of(text)]
    assert starts == [
        "extra: expected a known table",
        "daq: expected [daq] in a scene with [body]",
        "component: expected one [component.NAME] table for each FMU",
        "connection: expected [[connection]] tables",
        "event: expected [[event]] tables",
        "record: expected a table",
        "sweep: expected a table",
    ]


def test_all_problems_are_reported_at_once() -> None:
    text = coupled("mass = 2", "mass = -nan").replace("b.displacement", "b.displacment").replace("0.1", "0")
    text += '[sweep]\n"a.mas" = { values = [1] }\n[[event]]\n'
    keys = [problem.split(": ")[0] for problem in problems_of(text)]
    assert keys == [
        "component.a.parameters.mass",
        "event[1].watch",
        "event[1].direction",
        "execution.macro_step",
        "connection[1].from",
        'sweep."a.mas"',
    ]


# The short form, coupled.

FREE = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 5\n[execution]\n"


def test_the_short_form_may_run_coupled() -> None:
    execution = parse_scene(FREE + 'how = "coupled"', "s.toml").execution
    assert (execution.how, execution.macro_step, execution.exchange, execution.guard) == (
        "coupled",
        None,
        "gauss_seidel",
        False,
    )
    keys = 'how = "coupled"\nmacro_step = 0.5\nexchange = "iterated"\nguard = true'
    execution = parse_scene(FREE + keys, "s.toml").execution
    assert (execution.macro_step, execution.exchange, execution.guard) == (0.5, "iterated", True)


@pytest.mark.parametrize("line", ["macro_step = 1", 'exchange = "jacobi"', "guard = false"])
@pytest.mark.parametrize("how", ["auto", "fused"])
def test_what_only_coupled_runs_have_is_refused_for_others(how: str, line: str) -> None:
    (problem,) = problems_of(f'{FREE}how = "{how}"\n{line}')
    key = line.split()[0]
    assert problem == (
        f'execution.{key}: expected how = "coupled" beside it, got how = "{how}". '
        f'Remove {key}, or run the scene coupled: how = "coupled".'
    )


# Examples.


def test_the_bouncing_ball_example_takes_a_ball_that_the_user_fetches(tmp_path: Path) -> None:
    scene = shutil.copy(ROOT / "examples" / "bouncing_ball.toml", tmp_path)
    with pytest.raises(SceneError, match=r"component\.ball\.fmu: expected an FMU file, got no file"):
        load_scene(scene)
    write_fmu(tmp_path / "BouncingBall.fmu")
    loaded = load_scene(scene)
    assert loaded.events == (EventSpec("ball", "v", "rising", 0.0),)
    assert [axis.key for axis in loaded.sweep] == ["ball.e"]


def test_the_mixed_example_joins_two_versions_of_fmi() -> None:
    scene = load_scene(ROOT / "examples" / "mixed_versions.toml")
    assert [component.fmu.parent.name for component in scene.components] == ["fmi3", "fmi2"]
    assert scene.components[0].parameters["contact[1].law"] == 5


def test_a_nondimensional_scene_connects_plain_numbers() -> None:
    # a displacement feeds a force: both are numbers without a unit, despite the units in the FMU descriptions
    text = COUPLED.replace('gain_unit = "N/m"\n', "")
    with pytest.raises(SceneError, match="the same unit at both ends, got m"):
        parse_scene(text, "c.toml")
    scene = parse_scene('[scene]\nunits = "nondimensional"\n' + text, "c.toml")
    assert scene.connections[0].gain == 0.5
    with_unit = parse_scene('[scene]\nunits = "nondimensional"\n' + COUPLED, "c.toml")
    assert with_unit.connections[0].gain == 0.5
    at_once = text.replace("b.displacement", "b.velocity")
    assert parse_scene('[scene]\nunits = "nondimensional"\n' + at_once, "c.toml").connections


@pytest.mark.parametrize("name", ["oscillator", "OSCILLATOR", "Oscil lator", "o-s-c-i-l-l-a-t-o-r"])
def test_a_shipped_component_is_known_in_any_spelling(name: str) -> None:
    scene, spelled = (parse_scene(each, "c.toml") for each in (COUPLED, COUPLED.replace("Oscillator", name)))
    assert spelled.components == scene.components
