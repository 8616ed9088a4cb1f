"""`--set KEY=VALUE` changes a scene before its checks; the dataset has the text of the changed scene."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from support.campaign_scenes import frequency_text
from support.command_line import in_this_process

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene, parse_scene

ONE_STOP = """
[scene]
title = "one stop"
[body]
mass = 1.0  # kg
stiffness = 4.0
damping_ratio = 0.05
displacement_start = 0.05
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 0.1
restitution = 0.7
[record]
recorded_periods = 2
"""
SWEEP = """
[sweep]
"stop[1].restitution" = { values = [0.5, 0.8] }
"""
BALL = """
[component.ball]
fmu = "Oscillator"
parameters = { mass = 2.0, stiffness = 1.0, "contact[1].position" = 0.5 }
[record]
recorded_time = 1.0
[sweep]
"ball.mass" = { values = [1.0, 2.0] }
"""
TWO_BODIES = """
[[body]]
name = "frame"
mass = 1.0
stiffness = 1.0
[[body]]
name = "ball"
stiffness = 0.0
mass = 0.02
[[contact]]
between = ["frame", "ball"]
restitution = 0.8
clearance = 0.05
[forcing]
at = "frame"
amplitude = 0.1
angular_frequency = 1.0
[record]
recorded_periods = 1
"""


def changed(*changes: str, text: str = ONE_STOP) -> Scene:
    return parse_scene(text, "one.toml", changes)


def refused(*changes: str, text: str = ONE_STOP) -> str:
    with pytest.raises(SceneError) as error:
        changed(*changes, text=text)
    return str(error.value)


def test_numbers_words_arrays_and_tables_take_new_values() -> None:
    scene = changed(
        "stop[1].restitution=0.8",
        "scene.title=Trial 3, \N{GREEK SMALL LETTER ZETA} = 0.05",
        "execution.how=coupled",
        "record.time_series={rate = 20, variables = ['displacement']}",
        'sweep."forcing.angular_frequency"={start=2,stop=3,points=11}',
        'sweep."forcing.angular_frequency".path=up',
    )
    assert scene.value("stop[1].restitution") == 0.8
    assert scene.title == "Trial 3, \N{GREEK SMALL LETTER ZETA} = 0.05"
    assert scene.execution.how == "coupled"
    assert scene.record.time_series is not None
    assert scene.record.time_series.rate == 20
    assert [(axis.key, len(axis.values), axis.path) for axis in scene.sweep] == [
        ("forcing.angular_frequency", 11, "up")
    ]


def test_the_scene_that_was_run_is_the_changed_one() -> None:
    scene = changed("body.mass=2.5", "sweep={}", text=ONE_STOP + SWEEP)
    again = parse_scene(scene.text, "one.toml")
    assert again.model_dump(exclude={"text"}) == scene.model_dump(exclude={"text"})
    assert tomllib.loads(scene.text)["body"]["mass"] == 2.5
    assert changed().text == ONE_STOP


def test_elements_of_arrays_and_parameters_of_components_are_reached_by_their_names() -> None:
    chain = """
    [body]
    kind = "chain"
    masses = [1.0, 2.0]
    stiffnesses = [1.0, 1.0]
    [record]
    recorded_time = 1.0
    """
    assert changed("body.masses[2]=5.0", text=chain).value("body.masses[2]") == 5.0
    contact = 'component.ball.parameters."contact[1].position"=0.25'
    assert changed(contact, text=BALL).value("ball.contact[1].position") == 0.25
    assert len(changed('sweep."ball.mass".values=[1.0, 2.0, 3.0]', text=BALL).sweep[0].values) == 3


def test_one_of_two_keys_for_one_thing_takes_the_place_of_the_other() -> None:
    scene = changed("body.damping=0.3", "forcing.frequency=0.2")
    assert scene.constants().items() >= {"body.damping": 0.3, "forcing.frequency": 0.2}.items()
    assert "got both" in refused("body.damping=0.3", "body.damping_ratio=0.1")


def test_the_later_of_two_changes_of_a_key_counts() -> None:
    assert changed(*[f"body.mass={number}" for number in range(1, 1001)]).value("body.mass") == 1000.0


def test_a_table_may_be_changed_after_a_key_of_it() -> None:
    with pytest.raises(SceneError, match="body: expected a table, got nan"):
        parse_scene(ONE_STOP, "s.toml", ["body.damping_ratio=0.1", "body=nan"])


def test_a_number_that_the_sweep_replaces_is_not_changed_in_vain() -> None:
    said = refused("stop[1].restitution=0.9", text=ONE_STOP + SWEEP)
    assert said.startswith("--set: stop[1].restitution: expected a key that the scene does not sweep")
    assert changed("stop[1].restitution=0.9", "sweep={}", text=ONE_STOP + SWEEP).sweep == ()
    assert "does not sweep" in refused("component.ball.parameters.mass=3.0", text=BALL)


def test_a_body_or_component_called_by_its_name_is_named_by_its_key() -> None:
    assert refused("ball.mass=2", text=TWO_BODIES).endswith("Did you mean body[2].mass?")
    assert refused("ball=2", text=TWO_BODIES).endswith("Did you mean body[2]?")
    swept = refused('sweep={"ball.mass"={values=[1, 2]}}', text=TWO_BODIES)
    assert swept.endswith('got "ball.mass". Did you mean body[2].mass?')
    assert refused("ball.stiffness=2", text=BALL).endswith(
        "Did you mean component.ball.parameters.stiffness?"
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("stop[1].restitution=1.2", "--set: stop[1].restitution: expected 0 <= r <= 1, got 1.2. Use 1 for"),
        ("body.mas=2", '--set: body.mas: expected a known key, got the unknown key "mas". Did you mean mass?'),
        ("bdy.mass=2", 'got the unknown table "bdy". Did you mean body?'),
        ("execution.how=coupld", 'got "coupld". Did you mean "coupled"?'),
        ("body.mass=true", "--set: body.mass: expected a number > 0, got true."),
        ("body.mass=nan", "--set: body.mass: expected a number > 0, got nan."),
        ("scene.title=2024", "--set: scene.title: expected one line of text, got 2024."),
        ("body.mass=0,5", 'got "0,5". Numbers are written like 0.5'),
        ("body.mass=", "--set: body.mass: expected a value, got nothing."),
        ("body.mass", '--set: expected KEY=VALUE, the key as messages write it'),
        ("", 'KEY=VALUE, the key as messages write it (stop[1].restitution=0.8), got "".'),
        ("body.gr\u00f6\u00dfe=2", "--set: expected KEY=VALUE"),
        ('body."gr\u00f6\u00dfe"=2', '--set: body."gr\u00f6\u00dfe": expected a known key'),
        ("stop[2].restitution=0.5", "--set: stop[2].restitution: expected stop[1], got stop[2]."),
        ("stop[0].restitution=0.5", "--set: expected KEY=VALUE"),
        ("stop.restitution=0.5", "--set: stop.restitution: expected stop[1], got an array of 1."),
        ("body[1].mass=2", "--set: body[1].mass: expected an array at body, got a table."),
        ("body.mass.x=2", "--set: body.mass.x: expected a table at body.mass, got 1.0."),
        ("sweep.stop[1].restitution.points=3", "A swept key is in quotes, all of it in others: --set"),
        ("sweep.body.mass={values=[1]}", 'Put the whole key in quotes: "body.mass".'),
        ("body.mass=2\nbody.stiffness=1", 'got "2\\nbody.stiffness=1"'),
        ("body.mass=1\n[body]", "expected a TOML value"),
        ("a." * 50_000 + "a=1", "--set: expected KEY=VALUE"),
        ("stop" + "[1]" * 5000 + "=1", "--set: expected KEY=VALUE"),
        ("body.mass=" + "[" * 20_000, "expected a TOML value"),
    ],
)  # fmt: skip
def test_what_cannot_be_set_is_one_line_that_names_the_option(change: str, said: str) -> None:
    message = refused(change)
    assert said in message
    assert len(message) < 400
    assert "\n" not in message


def test_what_only_follows_from_a_change_says_that_the_file_alone_is_not_to_blame() -> None:
    message = refused("stop[1].position=0.01")
    assert message.startswith(
        "one.toml with --set: body.displacement_start: expected a start on the free side"
    )


def test_all_changes_that_cannot_be_made_are_told_at_once() -> None:
    assert len(refused("body.mass=", "stop[3].mass=1", "x").splitlines()) == 3
    assert len(refused(*[f"body.x{number}=1" for number in range(1000)]).splitlines()) == 51


def test_run_with_set_leaves_what_was_run_in_the_dataset(tmp_path: Path) -> None:
    scene, output = tmp_path / "one.toml", tmp_path / "one.nc"
    scene.write_text(ONE_STOP)
    done = in_this_process(
        "run", scene, "-o", output, "--set", "stop[1].restitution=0.8", "--set", "body.mass=2"
    )
    assert done.returncode == 0, done.stderr
    rows = read_flat(output)
    assert tomllib.loads(rows.attrs["scene"])["stop"] == [{"position": 0.1, "restitution": 0.8}]
    assert (float(rows.restitution), float(rows.mass)) == (0.8, 2.0)
    other = in_this_process("run", scene, "-o", output, "--set", "stop[1].restitution=0.9")
    assert other.returncode == 2
    assert "holds something else" in other.stderr


def test_a_campaign_with_another_set_is_told_what_changed(tmp_path: Path, cluster: str) -> None:
    scene = tmp_path / "sweep.toml"
    scene.write_text(frequency_text(3))
    folder, restitution = tmp_path / "campaign", "stop[1].restitution="
    campaign = ("campaign", scene, "-o", folder, "--scheduler", cluster)
    first = in_this_process(*campaign, "--set", f"{restitution}0.8")
    assert first.returncode == 0, first.stderr
    other = in_this_process(*campaign, "--set", f"{restitution}0.9")
    assert other.returncode == 2
    assert "stop[1].restitution was 0.8, is 0.9" in other.stderr
    again = in_this_process(*campaign, "--set", f"{restitution}0.80")
    assert "Nothing to do" in again.stdout
