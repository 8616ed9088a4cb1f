"""The loop over points in C gives the rows of points that run one by one, bit for bit."""

from __future__ import annotations

import math

import xarray as xr
from hypothesis import given, settings
from support.drawn_oscillators import FORCED, LAWS, MOST_IMPACTS, OSCILLATOR, oscillators

from vibroimpact.analysis.dataset import IMPACT_COLUMNS
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.dataset import dataset_of
from vibroimpact.orchestrator.run.many_points.rows import rows_of
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

FUSED = '[execution]\nhow = "fused"\n'


def in_both_ways(scene: Scene) -> tuple[xr.Dataset, xr.Dataset]:
    """Return the rows of a scene by the loop in C, and by points that run one by one."""
    points = columns_of_points(expand(scene), 0, run_count(scene.sweep))
    with PointRunner(scene, execution=scene.execution.how) as runner:
        assert runner.loop is not None
        ran = rows_of(runner.loop, points, None, math.inf, runner.record_of)
        assert ran is not None
        alone, carried = runner.rows_one_by_one(points.places(), None, math.inf)
    assert ran[1] == carried
    return dataset_of(scene, points, ran[0], {}), dataset_of(scene, points, alone, {})


def assert_equal_bit_for_bit(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that every variable is equal, except for the wall time of the points."""
    assert list(one.variables) == list(other.variables)
    for name in set(one.variables) - {"point_seconds"}:
        values, expected = one[name].values, other[name].values
        assert (values.dtype, values.shape) == (expected.dtype, expected.shape), name
        same = (
            (values == expected).all() if values.dtype == object else values.tobytes() == expected.tobytes()
        )
        assert same, name


@settings(max_examples=60, deadline=None)
@given(oscillators("fused"))
def test_points_in_the_loop_have_the_rows_of_points_run_one_by_one(text: str) -> None:
    assert_equal_bit_for_bit(*in_both_ways(parse_scene(text, "drawn.toml")))


def test_a_point_that_its_body_refuses_fails_alone_with_its_message() -> None:
    text = OSCILLATOR.format(
        how="fused",
        mass=1.0, stiffness=1.0, damping="", displacement=0.0, law=LAWS[0], second="", record=FORCED[0],
        limit=MOST_IMPACTS, sweep='"forcing.angular_frequency" = { values = [1.0, 1e-308, 2.0] }',
        forcing="[forcing]\namplitude = 3.0\nangular_frequency = 1.0\nphase = 1.0",
    )  # fmt: skip
    loop, alone = in_both_ways(parse_scene(text, "refused.toml"))
    assert loop.outcome.values.tolist() == [0, 3, 0]
    assert "forcing.angular_frequency: expected a period between" in loop.message.values[1]
    assert_equal_bit_for_bit(loop, alone)


def test_chains_and_beams_go_through_the_loop_too() -> None:
    record = "[record]\ntransient_periods = 2\nrecorded_periods = 3\n"
    stop = "[[stop]]\nposition = 0.2\nrestitution = 0.4\n"
    chain = (
        '[body]\nkind = "chain"\nmasses = [1.0, 2.0]\nstiffnesses = 5.0\n'
        f"[forcing]\namplitude = [1.0, 0.5]\nangular_frequency = 1.0\n{stop}{record}{FUSED}[sweep]\n"
        '"body.masses[2]" = { values = [1.0, 2.5] }\n"forcing.amplitude[1]" = { values = [0.5, 2.0] }\n'
    )
    beam = (
        '[body]\nkind = "beam"\nlength = 1.0\nmass_per_length = 1.0\nfrequency = 0.7\nmodes = 3\n'
        f'[forcing]\nkind = "uniform"\namplitude = 4.0\nfrequency = 0.5\n{stop}{record}{FUSED}[sweep]\n'
        '"body.length" = { values = [0.7, 1.3] }\n"forcing.frequency" = { values = [0.4, 0.6] }\n'
    )
    for text in (chain, beam):
        loop, alone = in_both_ways(parse_scene(text, "structure.toml"))
        assert loop.sizes["impact"] > 0
        assert set(IMPACT_COLUMNS) <= set(loop.variables)
        assert_equal_bit_for_bit(loop, alone)


def test_scenes_that_need_python_between_points_have_no_loop() -> None:
    text = OSCILLATOR.format(
        how="fused",
        mass=1.0, stiffness=1.0, damping="", displacement=0.0, law=LAWS[0], second="", limit=MOST_IMPACTS,
        record='recorded_time = 5.0\ntime_series = { rate = 10, variables = ["displacement"] }',
        sweep='"body.mass" = { values = [1.0, 2.0] }', forcing="",
    )  # fmt: skip
    scene = parse_scene(text, "sampled.toml")
    with PointRunner(scene) as runner:
        assert runner.loop is None
