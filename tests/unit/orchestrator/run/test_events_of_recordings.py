"""Events at the edges of a recording: contacts open at its end, rests from before it, events at time 0."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count
from vibroimpact.orchestrator.study.observation import observation_of
from vibroimpact.orchestrator.study.ways.trials import CoupledTrial, ModelExchangeTrial

OPEN_HERTZ = """[body]
mass = 1.0
stiffness = 1.0
damping = 0.08
[forcing]
amplitude = 0.6
angular_frequency = 0.85
[[stop]]
law = "hertz"
position = 0.3
stiffness = 400.0
[record]
recorded_periods = 6
"""
"""A touch-down at 44.346592 s with 1.037083 m/s, 0.005 s before the end, computed by an independent code."""
RESTS = """[body]
mass = 1.0
stiffness = {stiffness}
displacement_start = {position}
[[stop]]
position = {position}
restitution = 0.5
[record]
recorded_time = 2.0
"""


def run_of(text: str, values: Mapping[str, float] | None = None, how: str = "fused") -> RunRecord:
    runner = PointRunner(parse_scene(text, "scene.toml"), execution=how)
    try:
        return runner.run(values or {})
    finally:
        runner.close()


@pytest.mark.parametrize("how", ["fused", "coupled"])
def test_a_contact_that_is_open_at_the_end_is_an_impact_of_its_period(how: str) -> None:
    record = run_of(OPEN_HERTZ, how=how)
    assert record.impacts is not None
    assert record.periods is not None
    assert len(record.impacts) == 8
    assert record.periods[:, 4].sum() == 8
    time, phase, velocity, impulse, contact, restitution, duration, peak = record.impacts[-1].tolist()
    assert time == pytest.approx(44.346592, abs=1e-4 if how == "coupled" else 1e-6)
    assert velocity == pytest.approx(1.037083, abs=1e-3 if how == "coupled" else 1e-6)
    assert 0.0 <= phase < 2.0 * math.pi
    assert contact == 1.0
    assert np.isnan([impulse, restitution, duration, peak]).all()
    assert np.isfinite(record.impacts[:-1]).all()


def test_the_loop_over_points_has_the_open_contacts_of_single_runs() -> None:
    text = OPEN_HERTZ + '[sweep]\n"stop[1].position" = { values = [0.3, 0.28, 0.25, 0.2] }\n'
    scene = parse_scene(text, "scene.toml")
    with open_scene(scene) as runner:
        ran, _ = runner.rows(columns_of_points(expand(scene), 0, run_count(scene.sweep)))
        alone = [runner.run({"stop[1].position": value}).impacts for value in (0.3, 0.28, 0.25, 0.2)]
    found = getattr(ran, "impacts", None)
    assert found is not None
    np.testing.assert_array_equal(found.rows, np.concatenate([rows for rows in alone if rows is not None]))
    assert np.isnan(found.rows[:, 6]).any()


def test_the_ways_of_accuracy_compare_the_open_contact_too() -> None:
    scene = parse_scene(OPEN_HERTZ, "scene.toml")
    coupled, integrated = CoupledTrial(scene, "3.0"), ModelExchangeTrial(scene, 1e-8)
    reference = observation_of(run_of(OPEN_HERTZ))
    try:
        for trial in (coupled, integrated):
            assert trial.run().impacts == pytest.approx(reference.impacts, abs=1e-2)
    finally:
        coupled.close()
        integrated.close()


@pytest.mark.parametrize("how", ["fused", "coupled"])
@pytest.mark.parametrize("law", ["restitution = 0.5", 'law = "kelvin_voigt"\nstiffness = 100.0'])
def test_what_happens_where_the_motion_begins_belongs_to_its_recording(law: str, how: str) -> None:
    start = "[body]\nmass = 1.0\nstiffness = 1.0\ndisplacement_start = 0.2\nvelocity_start = 1.0\n"
    stop = f"[[stop]]\nposition = 0.2\n{law}\n[record]\nrecorded_time = 3.0\n"
    record = run_of(start + stop, how=how)
    assert record.impacts is not None
    assert record.impacts[0, [0, 2]].tolist() == pytest.approx([0.0, 1.0], abs=1e-12)


def test_a_contact_that_begins_at_rest_is_open_before_its_impulse_outgrows_rounding() -> None:
    # pressed by a constant force from the surface on: after 0.5 ms the impulse is 1e-18 of its final value
    text = (
        "[body]\nmass = 1.0\nstiffness = 0.0\ndamping = 0.3\ndisplacement_start = 0.3\n"
        "[forcing]\namplitude = 0.3\nangular_frequency = 0.0\n"
        '[[stop]]\nlaw = "hunt_crossley"\nposition = 0.3\nstiffness = 240.0\nexponent = 2.2\n'
        "[record]\ntransient_time = {begin}\nrecorded_time = {length}\n"
    )
    whole, first, second = (
        run_of(text.format(begin=begin, length=length)).impacts
        for begin, length in ((0.0, 2.0), (0.0, 5e-4), (5e-4, 2.0))
    )
    assert whole is not None
    assert first is not None
    assert second is not None
    assert (len(whole), len(first), len(second)) == (1, 1, 0)
    assert first[0, [0, 2]].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("how", ["fused", "coupled"])
def test_a_body_that_turns_inside_its_stop_begins_another_contact(how: str) -> None:
    # the dashpot would pull on the way out: the force ends inside the stop, and returns before the body is out
    text = (
        '[body]\nkind = "beam"\nlength = 1.0\nmass_per_length = 1.0\nflexural_rigidity = 1.0\nmodes = 5\n'
        "velocity_start = [1.0]\n[forcing]\namplitude = 3.0\nphase = 1.0\nangular_frequency = 0.0\n"
        '[[stop]]\nlaw = "kelvin_voigt"\nposition = 0.03\nlocation = 0.8\nstiffness = 18.68\ndamping = 30.0\n'
        "[record]\nrecorded_time = 1.0\n"
    )
    if how == "coupled":
        text += '[execution]\nhow = "coupled"\nmacro_step = 0.01\n'
    impacts = run_of(text, how=how).impacts
    assert impacts is not None
    assert impacts[:4, 0] == pytest.approx([0.0207, 0.1621, 0.2614, 0.3605], abs=0.01)
    ended = impacts[:-1]
    assert (ended[:, 0] + ended[:, 6] <= impacts[1:, 0]).all()


@pytest.mark.parametrize("how", ["fused", "coupled"])
def test_a_start_that_leaves_its_stop_without_force_is_no_contact_yet(how: str) -> None:
    text = (
        "[body]\nmass = 0.2\nstiffness = 0.0\ndisplacement_start = 0.1\nvelocity_start = -0.5\n"
        "[forcing]\namplitude = 1.0\nangular_frequency = 0.0\n"
        '[[stop]]\nlaw = "kelvin_voigt"\nposition = 0.0\nstiffness = 12.6\ndamping = 30.0\n'
        "[record]\nrecorded_time = 1.0\n"
    )
    if how == "coupled":
        text += '[execution]\nhow = "coupled"\nmacro_step = 0.001\n'
    impacts = run_of(text, how=how).impacts
    assert impacts is not None
    assert impacts[:, 0] == pytest.approx([0.0924], abs=2e-3)


def test_a_rest_that_lasts_since_before_the_recording_is_no_event_of_it() -> None:
    text = RESTS.format(stiffness=1.0, position=-0.3)
    first = run_of(text)
    assert first.sticks == pytest.approx(np.array([[0.0, math.nan, 1.0]]), nan_ok=True)
    later = run_of(text.replace("[record]", "[record]\ntransient_time = 1.0"))
    assert later.sticks is not None
    assert len(later.sticks) == 0
    assert later.outcome is Outcome.stuck  # the body rests, too


@pytest.mark.parametrize(("stiffness", "position"), [(0.0, 0.3), (0.0, 0.0), (1.0, 0.0)])
def test_a_rest_without_load_is_not_told_as_pressed(stiffness: float, position: float) -> None:
    text = RESTS.format(stiffness=stiffness, position=position)
    record = run_of(text)
    assert (record.outcome, record.message) == (Outcome.ok, "rests on stop[1] without load")
    pressed = run_of(RESTS.format(stiffness=1.0, position=-0.3))
    assert (pressed.outcome, pressed.message) == (Outcome.stuck, "")


@pytest.mark.parametrize("law", ["restitution = 0.8", 'law = "kelvin_voigt"\nstiffness = 1e4'])
def test_a_pair_that_touches_and_approaches_at_time_0_has_its_event(law: str) -> None:
    text = f"""[component.a]
fmu = "Oscillator"
parameters = {{ stiffness = 0.0, velocity_start = 2.0 }}
[component.b]
fmu = "Oscillator"
parameters = {{ mass = 2.0, stiffness = 0.0, velocity_start = -0.5 }}
[[contact]]
between = ["a", "b"]
{law}
[record]
recorded_time = 0.3
[execution]
macro_step = 1e-2
"""
    for transient, expected in ((0.0, [[0.0, 0.0, 1.0]]), (0.2, [])):
        own = text.replace("[record]", f"[record]\ntransient_time = {transient}")
        runner = GeneralRunner(parse_scene(own, "pair.toml"))
        events = runner.run({}).events
        runner.close()
        assert events is not None
        assert events.tolist() == expected
