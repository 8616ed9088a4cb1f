"""A measuring chain with any parameters: cuts between blocks change no bit, conversion is within half a step."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.analysis.dataset import Direction
from vibroimpact.orchestrator.run.measuring.chain import Floats
from vibroimpact.orchestrator.run.measuring.conversion import converted, run_seed
from vibroimpact.orchestrator.run.measuring.session import MeasuredSession
from vibroimpact.orchestrator.scene import Scene, parse_scene

BODY = (
    "[body]\nmass = 1.0\nstiffness = 2000\ndamping = 2\n[record]\nrecorded_time = 1\n[sensor]\ngain = 200\n"
)
SAMPLES = 240
CHANNELS = ("sensor.velocity", "load_cell", "drive")


@st.composite
def chains(draw: st.DrawFn) -> Scene:
    """Draw a scene with a load cell and an exciter, near or far, behind a rigid or a compliant stop."""
    rigid = draw(st.booleans())
    law = f"restitution = {draw(st.floats(0.0, 1.0))}" if rigid else 'law = "hertz"\nstiffness = 1e7'
    ring = draw(st.just(0.0) | st.floats(1e-9, 3000.0))
    ratio = draw(st.floats(0.0, 2.0))
    cell = (
        f"[load_cell]\nsensitivity = 0.01\nnatural_frequency = {ring}\ndamping_ratio = {ratio}\ndrift = 0.1\n"
    )
    cell += f"contact_duration = {draw(st.floats(1e-5, 5e-3))}\n" if rigid else ""
    distance = draw(st.sampled_from([0.0, 0.1, 1.0]))
    exciter = f"[exciter]\ngain = {draw(st.floats(-5.0, 5.0))}\noffset = {draw(st.floats(-5.0, 5.0))}\n"
    daq = f"distance = {distance}\n[daq]\nrate = 1000\nbits = 12\nrange = 5\n"
    stop = f"[[stop]]\nposition = {draw(st.floats(0.0, 0.01))}\n{law}\n"
    return parse_scene(BODY + stop + cell + exciter + daq, "drawn.toml")


def measured(scene: Scene, volts: Floats, cuts: list[int]) -> tuple[dict[str, Floats], Floats]:
    # a rig has the instants of inputs and outputs in one row: uneven steps
    times = np.sort(
        np.append(np.arange(SAMPLES // 2 + 1) / 1000.0, np.arange(SAMPLES // 2) / 1000.0 + 2.3e-4)
    )
    blocks, impacts = [], []
    with MeasuredSession(scene, CHANNELS) as session:
        session.begin()
        for first, last in itertools.pairwise(cuts):
            blocks.append(session.advance(times[first : last + 1], volts[first:last]))
            impacts.append(session.impacts_of_block)
    return {name: np.concatenate([block[name] for block in blocks]) for name in CHANNELS}, np.concatenate(
        impacts
    )


@given(
    scene=chains(),
    seed=st.integers(0, 2**32 - 1),
    inner=st.sets(st.integers(1, SAMPLES - 1), max_size=12),
)
def test_cuts_between_blocks_change_no_bit(scene: Scene, seed: int, inner: set[int]) -> None:
    volts = np.random.default_rng(seed).uniform(-5.0, 5.0, SAMPLES)
    whole, impacts = measured(scene, volts, [0, SAMPLES])
    cut, again = measured(scene, volts, [0, *sorted(inner), SAMPLES])
    np.testing.assert_array_equal(again, impacts)
    for name in CHANNELS:
        np.testing.assert_array_equal(cut[name], whole[name])


@given(
    seed=st.integers(0, 10**9),
    rms=st.floats(0.0, 0.5),
    bits=st.integers(2, 24),
    highest=st.floats(0.1, 10.0),
    count=st.integers(1, 400),
)
def test_converted_samples_are_within_half_a_step_and_do_not_depend_on_how_many_there_are(
    seed: int, rms: float, bits: int, highest: float, count: int
) -> None:
    tables = f"[noise]\nseed = {seed}\nsensor = {rms}\n[daq]\nrate = 10\nbits = {bits}\nrange = {highest}\n"
    series = '[record]\ntime_series = { variables = ["sensor.velocity", "velocity"] }\n'
    scene = parse_scene(BODY.replace("[record]\n", series) + tables, "drawn.toml")
    analog = np.random.default_rng(1).normal(0.0, highest, (count, 3))
    names, step = ("sensor.velocity", "velocity"), 2.0 * highest / 2**bits
    found = converted(scene, analog, names, seed)
    np.testing.assert_array_equal(found[:, [0, 2]], analog[:, [0, 2]])
    assert (found[:, 1] >= -highest).all()
    assert (found[:, 1] <= highest).all()
    half = count // 2
    np.testing.assert_array_equal(converted(scene, analog[:half], names, seed), found[:half])
    calm = converted(scene.at({"noise.sensor": 0.0}), analog, names, seed)[:, 1]
    inside = np.abs(analog[:, 1]) < highest - step
    assert (np.abs(calm - analog[:, 1])[inside] <= 0.5 * step * (1.0 + 1e-9)).all()


@given(st.dictionaries(st.sampled_from(["body.mass", "daq.rate"]), st.floats(allow_nan=False), min_size=1))
def test_a_run_has_the_seed_of_its_point_and_direction(values: dict[str, float]) -> None:
    seeds = [run_seed(5, values, direction) for direction in Direction]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**64 for seed in seeds)
    assert run_seed(5, dict(reversed(values.items())), Direction.up) == run_seed(5, values, Direction.up)
    assert run_seed(6, values, Direction.up) != run_seed(5, values, Direction.up)
