"""Keys of moving stops: their rules, the FMU that they run on, their clock, and what names them."""

from typing import Any

import numpy as np
import pytest
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene, parse_scene

BALL = """
scene = { units = "nondimensional" }
body = { mass = 1.0, stiffness = 0.0, displacement_start = 2.0 }
forcing = { signal = "constant", amplitude = -1.0 }
record = { recorded_periods = 4 }
[[stop]]
position = 0.0
side = "lower"
restitution = 0.5
motion_amplitude = 1.2
motion_angular_frequency = 2.0
motion_phase = 0.3
"""


def scene(*lines: str, without: tuple[str, ...] = ()) -> Scene:
    """Return the ball with further lines of its stop, and without the lines of some keys."""
    kept = [line for line in BALL.splitlines() if not line.startswith(without)] if without else [BALL]
    return parse_scene("\n".join([*kept, *lines]), "ball.toml")


def test_a_moving_stop_runs_on_the_structure_and_is_its_clock() -> None:
    ball = scene()
    assert ball.body.FMU == "Structure"
    assert ball.clock is not None
    assert (ball.clock.angular_frequency, ball.clock.phase, ball.clock.is_common) == (2.0, 0.3, True)
    floats = float_parameters(ball, None)
    assert floats["stop[1].amplitude"] == 1.2
    assert floats["stop[1].phase"] == 0.3
    assert floats["forcing.angular_frequency"] == 2.0
    assert "stop[1].velocity" not in floats


def test_a_stop_that_stands_still_has_no_key_of_a_motion() -> None:
    standing = vi.Scene.from_file(ROOT / "examples" / "single_run.toml")
    assert standing.body.FMU == "Oscillator"
    assert not [key for key, _ in standing.numbers() if "motion" in key or key == "stop[1].velocity"]
    assert not [name for name in float_parameters(standing, None) if name.startswith("stop[")]


@pytest.mark.parametrize(("line", "is_common"), [("velocity = 0.1", False), ("velocity = 0.0", True)])
def test_a_stop_that_drifts_has_no_period(line: str, is_common: bool) -> None:
    clock = scene(line).clock
    assert clock is not None
    assert clock.is_common is is_common


def test_a_sine_of_a_force_is_the_clock_before_that_of_a_stop() -> None:
    ball = scene("[[forcing]]", "amplitude = 0.1", "angular_frequency = 3.0", without=("forcing =",))
    assert ball.clock is not None
    assert ball.clock.angular_frequency == 1.0  # 3 and 2: common period of 3 and 2 turns
    assert ball.clock.periods == 3


def test_tables_of_stops_lie_behind_each_other() -> None:
    lines = ("motion_times = [0.0, 1.0, 4.0]", "motion_values = [0.0, 0.1, 0.0]")
    upper = (
        "[[stop]]",
        "position = 9.0",
        "restitution = 0.1",
        "motion_times = [0.0, 2.0]",
        "motion_values = [0.0, 1.0]",
    )
    both = scene(*lines, *upper)
    integers, floats = integer_parameters(both), float_parameters(both, None)
    assert [integers[f"stop[{k}].table_start"] for k in (1, 2)] == [1, 4]
    assert [integers[f"stop[{k}].table_count"] for k in (1, 2)] == [3, 2]
    assert [floats[f"table.value[{row}]"] for row in range(1, 6)] == [0.0, 0.1, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("lines", "without", "message"),
    [
        (
            (),
            ("motion_angular",),
            "stop[1].motion_angular_frequency: expected a number > 0 with a motion_amplitude",
        ),
        (("motion_times = [0.0, 1.0]",), (), "stop[1].motion_values: expected an array of 2 numbers or more"),
        (
            ("motion_times = [0, 1]", "motion_values = [0, 1, 2]"),
            (),
            "stop[1].motion_values: expected as many numbers",
        ),
        (
            ("motion_times = [0, 0]", "motion_values = [0, 1]"),
            (),
            "stop[1].motion_times[2]: expected more than the",
        ),
        (
            ("motion_times = [0]", "motion_values = [0]"),
            (),
            "stop[1].motion_times: expected an array of 2 ascending",
        ),
        (("[execution]", 'how = "coupled"'), (), "execution.how: expected"),
        (
            ("velocity = 0.1", "[sweep]", '"stop[1].motion_amplitude" = { values = [1, 2], path = "up" }'),
            (),
            'sweep."stop[1].motion_amplitude".path: expected "independent" beside a stop[1] that drifts',
        ),
    ],
)
def test_a_wrong_motion_is_named(lines: tuple[str, ...], without: tuple[str, ...], message: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene(*lines, without=without)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("study", "lines"), [(vi.find_orbits, ("velocity = 0.1",)), (vi.accuracy, ())], ids=["orbit", "accuracy"]
)
def test_studies_name_a_moving_stop_that_they_do_not_take(study: Any, lines: tuple[str, ...]) -> None:
    forced = ("[forcing]", "amplitude = 0.1", "angular_frequency = 2.0")
    with pytest.raises(UsageError, match=r"stop\[1\]|stops that move"):
        study(scene(*lines, *forced, without=("forcing =",)))


def test_runs_end_by_name_where_moving_stops_leave_no_room() -> None:
    jaws = scene("velocity = 0.5", "[[stop]]", "position = 4.0", "restitution = 0.5", "velocity = -0.5")
    run = vi.run(jaws)
    assert "expected room between their stops, of which one moves" in str(run.message.values)


def test_several_bodies_meet_moving_stops() -> None:
    """A box that is carried by a stop carries a ball: both rest on the table until the end."""
    text = """
    [[body]]
    name = "box"
    mass = 2.0
    stiffness = 0.0
    [[body]]
    name = "ball"
    mass = 1.0
    stiffness = 0.0
    displacement_start = 0.5
    [[contact]]
    between = ["box", "ball"]
    clearance = 0.5
    restitution = 0.0
    [[stop]]
    at = "box"
    position = 0.0
    side = "lower"
    restitution = 0.0
    motion_amplitude = 0.25
    motion_angular_frequency = 1.0
    motion_phase = -1.5707963267948966
    [[forcing]]
    kind = "base_acceleration"
    signal = "constant"
    amplitude = 1.0
    [record]
    recorded_periods = 3
    time_series = { rate = 10, variables = ["contact_displacement[1]", "contact_force[1]", "contact_force[2]"] }
    """
    run = vi.run(parse_scene(text, "carried.toml"))
    table = 0.25 * np.sin(run.time.values)
    assert run.contact_displacement_1.values == pytest.approx(table, abs=1e-14)
    assert run.contact_force_1.values == pytest.approx(3.0 * (1.0 - table), abs=1e-13)
    assert run.contact_force_2.values == pytest.approx(1.0 - table, abs=1e-13)


def test_a_branch_goes_on_from_the_table_of_the_point_before() -> None:
    """A ball that rests on the table is carried to the next point, whose table is elsewhere at phase 0."""
    resting = scene("[sweep]", '"stop[1].motion_amplitude" = { values = [0.1, 0.15, 0.2], path = "up" }')
    run = vi.run(resting)
    assert not any(run.message.values.ravel())
    assert run.final_displacement.values.ravel() == pytest.approx([0.1, 0.15, 0.2], abs=1e-13)


def test_the_ball_on_a_table_doubles_its_cycle() -> None:
    example = vi.Scene.from_file(ROOT / "examples" / "ball_on_table.toml")
    swept = vi.run(example.with_sweep({"stop[1].motion_amplitude": [0.95, 1.2, 1.5, 1.55]}))
    assert str(vi.classify(swept)) == "<classes of 4 runs: 2 P(1,1), 1 rest, 1 P(2,2)>"
