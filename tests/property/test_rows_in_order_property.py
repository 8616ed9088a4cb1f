"""Every scene gives a writable dataset: rows of rigid and compliant stops side by side, in order of time."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.dataset import check, read_flat
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene

FEW = settings(max_examples=25, derandomize=True, suppress_health_check=list(HealthCheck))
LAWS = (
    "restitution = {r}",
    'law = "kelvin_voigt"\nstiffness = {k}\ndamping = {c}',
    'law = "hertz"\nstiffness = {k}',
    'law = "hunt_crossley"\nstiffness = {k}\ndamping = {c}',
)

SIDES = {"upper": 1.0, "lower": -1.0}


@st.composite
def scene_texts(draw: st.DrawFn) -> str:
    """Draw chains of one to four masses with one rigid stop and one to three compliant ones."""
    count = draw(st.integers(1, 4))
    number = st.floats(0.1, 3.0).map(lambda x: round(x, 3))
    masses = draw(st.lists(number, min_size=count, max_size=count))
    springs = draw(st.lists(st.one_of(number, st.just(0.0)), min_size=count, max_size=count))
    speeds = draw(st.lists(st.floats(-3.0, 3.0).map(lambda x: round(x, 3)), min_size=count, max_size=count))
    places = draw(st.permutations([(mass, side) for mass in range(1, count + 1) for side in SIDES]))
    laws = [LAWS[0], *draw(st.lists(st.sampled_from(LAWS[1:]), min_size=1, max_size=3))]
    text = f"""
[scene]
units = "nondimensional"
[body]
kind = "chain"
masses = {masses}
stiffnesses = {[*springs[:-1], max(springs[-1], 0.1)]}
velocity_start = {speeds}
"""
    if draw(st.booleans()):
        amplitude = draw(st.lists(st.floats(-2.0, 2.0), min_size=count, max_size=count))
        text += f"[forcing]\namplitude = {amplitude}\nangular_frequency = {draw(number)}\n"
        text += "[record]\ntransient_periods = 0\nrecorded_periods = 2\n"
    else:
        text += f"[record]\nrecorded_time = {draw(st.floats(0.5, 20.0))}\n"
    for form, (mass, side) in zip(laws, places, strict=False):
        law = form.format(
            r=draw(st.floats(0.0, 0.95)),
            k=10.0 ** draw(st.floats(0.0, 4.0)),
            c=draw(st.sampled_from([0.0, 0.1])),
        )
        position = SIDES[side] * draw(st.floats(0.01, 1.5))
        text += f'[[stop]]\nmass = {mass}\nside = "{side}"\nposition = {position}\n{law}\n'
    how = draw(st.sampled_from(["fused", "coupled"]))
    return f'{text}[execution]\nhow = "{how}"\nimpact_limit = 2000\ndeadline = 5.0\n'


@FEW
@given(scene_texts())
def test_any_stops_side_by_side_give_a_dataset_whose_times_ascend(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "runs.nc")
        run_scene(parse_scene(text, "random.toml"), path)
        dataset = read_flat(path)
    check(dataset)
    assert not any("check:" in text for text in dataset.message.values)
    for clock in ("impact_time", "stick_start"):
        assert (np.diff(dataset[clock].values) >= 0.0).all()
