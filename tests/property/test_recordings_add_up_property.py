"""An impact, a contact or a rest belongs to the recording in which it begins: successive recordings add up.

Runs are cut anywhere: between events, at an event, in the middle of a contact, at its end. The runs have every law,
both drivers of a body, lanes, and pairs of bodies.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.cut_recordings import counts_differ, problem_of_cuts

from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

Floats = NDArray[np.float64]

OSCILLATOR = """[body]
mass = 1.0
stiffness = {stiffness!r}
damping = {damping!r}
displacement_start = {displacement!r}
velocity_start = {velocity!r}
"""
CHAIN = """[body]
kind = "chain"
masses = [1.0, 0.7]
stiffnesses = [{stiffness!r}, 2.0]
dampings = [{damping!r}, 0.05]
velocity_start = [0.0, {velocity!r}]
"""
BEAM = """[body]
kind = "beam"
length = 1.0
mass_per_length = 1.0
flexural_rigidity = 1.0
modes = 4
damping_ratio = {damping!r}
"""
AMPLITUDES = {OSCILLATOR: "1.0", CHAIN: "[1.0, 0.0]", BEAM: "1.0"}

restitution = st.fixed_dictionaries(
    {"law": st.just("restitution"), "restitution": st.sampled_from([0.0, 0.3, 0.7, 0.95, 1.0])}
)
laws = st.one_of(
    restitution,
    st.fixed_dictionaries(
        {
            "law": st.just("kelvin_voigt"),
            "stiffness": st.floats(5.0, 1e4),
            "damping": st.floats(0.0, 3.0),
            "relaxation_time": st.sampled_from([0.0, 0.1]),
        }
    ),
    st.fixed_dictionaries({"law": st.just("hertz"), "stiffness": st.floats(10.0, 1e4)}),
    st.fixed_dictionaries(
        {
            "law": st.just("hunt_crossley"),
            "stiffness": st.floats(10.0, 1e4),
            "damping": st.floats(0.0, 0.5),
            "exponent": st.sampled_from([1.0, 1.5, 2.2]),
        }
    ),
)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Draw a body with one or two stops, forced or not; an oscillator may start on a stop or pressed into it."""
    body = draw(st.sampled_from([OSCILLATOR, OSCILLATOR, CHAIN, BEAM]))
    stops = [(position, draw(laws)) for position in ([0.3], [0.3, -0.25])[draw(st.integers(0, 1))]]
    starts = [0.0, 0.3] if stops[0][1]["law"] == "restitution" else [0.0, 0.3, 0.4]
    text = body.format(
        stiffness=draw(st.sampled_from([0.5, 1.0, 4.0])),
        damping=draw(st.sampled_from([0.0, 0.05, 0.3])),
        displacement=draw(st.sampled_from(starts)),
        velocity=draw(st.sampled_from([-0.5, 0.0, 0.7])),
    )
    if draw(st.booleans()) or body == BEAM:
        frequency = draw(st.floats(0.3, 3.0))
        text += f"[forcing]\namplitude = {AMPLITUDES[body]}\nangular_frequency = {frequency!r}\n"
        window = "recorded_periods = 1"
    else:
        window = "recorded_time = 1.0"
    for position, stop in stops:
        keys = "\n".join(f"{key} = {value!r}".replace("'", '"') for key, value in stop.items())
        side = f'side = "{"upper" if position > 0 else "lower"}"'
        text += f"[[stop]]\nposition = {position!r}\n{side}\n{keys}\n"
    return parse_scene(f"{text}[record]\n{window}\n", "scene.toml")


def cut_at_its_release() -> Scene:
    """Return a beam whose rest ends at an instant at which rounding presses it once more."""
    forcing = "[forcing]\namplitude = 1.0\nangular_frequency = 2.501043067472021\n"
    stop = "[[stop]]\nposition = 0.3\nrestitution = 0.0\n[record]\nrecorded_periods = 1\n"
    body = BEAM.format(stiffness=1.0, damping=0.3, displacement=0.0, velocity=0.0)
    return parse_scene(body + forcing + stop, "scene.toml")


@settings(max_examples=120)
@given(scene=scenes(), share=st.floats(0.0, 0.999))
@example(scene=cut_at_its_release(), share=0.0)
def test_recordings_of_a_fused_body_add_up(scene: Scene, share: float) -> None:
    assert problem_of_cuts(scene, "fused", share, 12.0) is None


@settings(max_examples=8)
@given(scene=scenes(), share=st.floats(0.0, 0.999))
def test_recordings_of_a_coupled_body_add_up(scene: Scene, share: float) -> None:
    assert problem_of_cuts(scene, "coupled", share, 5.0) is None


LANES = """[body]
mass = 1.0
stiffness = 1.0
damping = 0.02
displacement_start = {displacement!r}
velocity_start = 0.8
[[stop]]
position = 0.3
restitution = 0.9
[[stop]]
position = -0.4
side = "lower"
restitution = 0.8
[record]
transient_time = {begin!r}
recorded_time = {length!r}
[sweep]
"body.stiffness" = {{ values = [0.4, 0.7, 1.0, 1.3, 1.9, 2.2, 2.6, 3.1] }}
[execution]
how = "{how}"
"""


@settings(max_examples=5)
@given(
    cut=st.floats(0.05, 7.9), displacement=st.sampled_from([0.0, 0.3]), how=st.sampled_from(["auto", "fused"])
)
def test_recordings_of_points_in_lanes_and_in_the_loop_add_up(
    cut: float, displacement: float, how: str
) -> None:
    def impacts(begin: float, end: float) -> list[int]:
        text = LANES.format(displacement=displacement, begin=begin, length=end - begin, how=how)
        scene = parse_scene(text, "lanes.toml")
        with open_scene(scene) as runner:
            assert runner.execution == ("lanes" if how == "auto" else "fused")
            ran, _ = runner.rows(columns_of_points(expand(scene), 0, run_count(scene.sweep)))
        assert isinstance(ran, RunColumns)
        assert ran.impacts is not None
        return [int(count) for count in ran.impacts.count]

    whole = impacts(0.0, 8.0)
    assert min(whole) > 3
    assert counts_differ([impacts(0.0, cut), impacts(cut, 8.0)], whole) is None


PAIR = """[component.table]
fmu = "Oscillator"
parameters = {{ mass = 5.0, stiffness = 5.0, displacement_start = {displacement!r}, velocity_start = {up!r} }}
[component.ball]
fmu = "Oscillator"
parameters = {{ stiffness = 2.0, displacement_start = {displacement!r}, velocity_start = -1.0 }}
[[contact]]
between = ["table", "ball"]
{law}
[record]
transient_time = {begin!r}
recorded_time = {length!r}
[execution]
macro_step = 0.05
"""
PAIR_LAWS = (
    "restitution = 0.8",
    "restitution = 0.0",
    'law = "kelvin_voigt"\nstiffness = 200.0\ndamping = 0.5',
    'law = "hertz"\nstiffness = 300.0',
    'law = "hunt_crossley"\nstiffness = 300.0\ndamping = 0.1',
)


def events_of_pair(law: str, begin: float, end: float, displacement: float, up: float) -> Floats:
    """Return the times of the events of two bodies that touch at time 0 with equal displacements."""
    text = PAIR.format(law=law, begin=begin, length=end - begin, displacement=displacement, up=up)
    runner = GeneralRunner(parse_scene(text, "pair.toml"))
    try:
        events = runner.run({}).events
    finally:
        runner.close()
    assert events is not None
    return events[:, 0]


@settings(max_examples=5)
@given(
    law=st.sampled_from(PAIR_LAWS),
    cut=st.floats(0.05, 3.9),
    displacement=st.sampled_from([0.0, 0.4]),
    up=st.sampled_from([-0.5, 0.0, 0.7]),
)
def test_recordings_of_a_pair_add_up(law: str, cut: float, displacement: float, up: float) -> None:
    whole = events_of_pair(law, 0.0, 4.0, displacement, up)
    assert whole[0] == 0.0  # they touch and approach at the start of their motion
    for at in (cut, float(whole[-1])):
        if 0.0 < at < 4.0:
            parts = [events_of_pair(law, *window, displacement, up) for window in ((0.0, at), (at, 4.0))]
            room = 1e-6 if law.startswith("restitution") else 1e-2  # a cut changes the steps of a contact
            assert np.concatenate(parts) == pytest.approx(whole, abs=room)
