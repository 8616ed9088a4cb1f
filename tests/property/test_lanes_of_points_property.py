"""Points in lanes equal those of the scalar engine up to rounding, and have the same bits for any cut."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.drawn_oscillators import LAWS, OSCILLATOR, oscillators

from vibroimpact.analysis.dataset.columns import RunColumns, columns_of, joined
from vibroimpact.orchestrator.run.dataset import dataset_of
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

RIGID = tuple(law for law in LAWS if "kelvin_voigt" not in law)
YIELDING = tuple(law for law in LAWS if "kelvin_voigt" in law)
FIRST_IMPACTS = 10
"""Number of compared impacts of a point: later, chaotic motion multiplies rounding by any factor."""
AGREEMENT = 1e-9
"""Largest difference of their times and velocities: rounding, multiplied by some impacts."""


def rows_of(scene: Scene, cuts: Sequence[int] = ()) -> xr.Dataset:
    """Return the rows of a scene, its points cut at the given places, like the chunks of a campaign."""
    edges = [0, *cuts, run_count(scene.sweep)]
    points = columns_of_points(expand(scene), 0, edges[-1])
    pieces: list[RunColumns] = []
    carried = None
    with open_scene(scene) as runner:
        for first, stop in pairwise(edges):
            ran, carried = runner.rows(points.chosen(slice(first, stop)), carried)
            pieces.append(ran if isinstance(ran, RunColumns) else columns_of(ran))
    return dataset_of(scene, points, joined(pieces), {})


def first_impacts(rows: xr.Dataset, run: int) -> NDArray[np.float64]:
    own = rows.impact_run.values == rows.run_index.values[run]
    return np.stack([rows.impact_time.values[own], rows.impact_velocity.values[own]])[:, :FIRST_IMPACTS]


def few_impacts(rows: xr.Dataset) -> NDArray[np.bool_]:
    """Return a mask of the runs with few impacts in the whole recording."""
    if "impact_count" in rows:
        return np.asarray(rows.impact_count.values <= FIRST_IMPACTS)
    if "impacts_per_period" in rows:
        return np.asarray(np.nansum(rows.impacts_per_period.values, axis=1) <= FIRST_IMPACTS)
    return np.zeros(rows.sizes["run"], dtype=np.bool_)


def assert_agree(lanes: xr.Dataset, fused: xr.Dataset, agreement: float = AGREEMENT) -> None:
    assert lanes.outcome.values.tolist() == fused.outcome.values.tolist()
    if "impact_run" in lanes:
        for run in range(lanes.sizes["run"]):
            one, other = first_impacts(lanes, run), first_impacts(fused, run)
            assert one.shape == other.shape
            assert one == pytest.approx(other, rel=agreement, abs=agreement)
    short = few_impacts(fused)
    assert ("sample_count" in lanes) == ("sample_count" in fused)
    if "sample_count" in lanes:
        assert lanes.sample_count.values.tolist() == fused.sample_count.values.tolist()
        assert np.array_equal(lanes.time.values, fused.time.values)
        sampled = short[np.repeat(np.arange(lanes.sizes["run"]), fused.sample_count.values)]
        for name in ("displacement", "velocity", "contact_velocity_1"):
            assert lanes[name].values[sampled] == pytest.approx(
                fused[name].values[sampled], rel=agreement, abs=agreement
            )
    for name in ("final_displacement", "final_velocity", "displacement_max", "strobe_velocity"):
        if name in lanes:
            values, expected = (rows[name].values[short] for rows in (lanes, fused))
            assert values == pytest.approx(expected, rel=agreement, abs=agreement, nan_ok=True)


def assert_equal_bit_for_bit(one: xr.Dataset, other: xr.Dataset) -> None:
    for name in set(one.variables) - {"point_seconds"}:
        values, expected = one[name].values, other[name].values
        same = (
            (values == expected).all() if values.dtype == object else values.tobytes() == expected.tobytes()
        )
        assert same, name


def with_execution(text: str, how: str) -> Scene:
    return parse_scene(text.replace('how = "auto"', f'how = "{how}"'), "drawn.toml")


@settings(max_examples=40, deadline=None)
@given(text=oscillators("auto", RIGID), data=st.data())
def test_points_in_lanes_are_those_of_the_scalar_engine_however_they_are_cut(text: str, data: Any) -> None:
    across = text + '"stop[1].restitution" = { values = [0.0, 0.5, 1.0] }\n'
    scene = with_execution(across, "auto")
    with open_scene(scene) as runner:
        assert runner.execution == "lanes"
    whole = rows_of(scene)
    assert_agree(whole, rows_of(with_execution(across, "fused")))
    cuts = sorted(data.draw(st.sets(st.integers(1, run_count(scene.sweep) - 1), max_size=3)))
    assert_equal_bit_for_bit(whole, rows_of(scene, cuts))


@settings(max_examples=15, deadline=None)
@given(text=oscillators("auto", YIELDING), damping=st.sampled_from((0.5, 5.0, 40.0)), data=st.data())
def test_points_on_kelvin_voigt_stops_in_lanes_are_those_of_the_scalar_engine_however_they_are_cut(
    text: str, damping: float, data: Any
) -> None:
    across = text + f'"stop[1].damping" = {{ values = [0.0, {damping}] }}\n'
    scene = with_execution(across, "auto")
    with open_scene(scene) as runner:
        assert runner.execution == "lanes"
    whole = rows_of(scene)
    assert_agree(whole, rows_of(with_execution(across, "fused")))
    cuts = sorted(data.draw(st.sets(st.integers(1, run_count(scene.sweep) - 1), max_size=3)))
    assert_equal_bit_for_bit(whole, rows_of(scene, cuts))


SERIES = 'time_series = { rate = 7.3, variables = ["displacement", "velocity", "contact_velocity[1]"] }'


@settings(max_examples=20, deadline=None)
@given(text=oscillators("auto", (*RIGID, *YIELDING)), data=st.data())
def test_time_series_in_lanes_are_those_of_the_scalar_engine(text: str, data: Any) -> None:
    sampled = text.replace("[record]", "[record]\n" + SERIES)
    scene = with_execution(sampled + '"body.displacement_start" = { values = [0.0, 0.5] }\n', "auto")
    with open_scene(scene) as runner:
        assert runner.execution == "lanes"
    whole = rows_of(scene)
    assert "sample_count" in whole
    # points of a path follow one another: their impacts add up
    assert_agree(whole, rows_of(with_execution(scene.text, "fused")), 100.0 * AGREEMENT)
    cuts = sorted(data.draw(st.sets(st.integers(1, run_count(scene.sweep) - 1), max_size=3)))
    assert_equal_bit_for_bit(whole, rows_of(scene, cuts))


def test_a_point_with_bad_numbers_fails_alone_with_the_message_of_its_body() -> None:
    text = OSCILLATOR.format(
        mass=1.0, stiffness=1.0, damping="", displacement=0.0, law=RIGID[0], second="", how="auto", limit=300,
        record="transient_periods = 2\nrecorded_periods = 3",
        sweep='"forcing.angular_frequency" = { values = [1.0, 1e-308, 2.0] }\n'
        '"stop[1].position" = { values = [1.0, 0.5] }',
        forcing="[forcing]\namplitude = 3.0\nangular_frequency = 1.0\nphase = 1.0",
    )  # fmt: skip
    lanes, fused = (rows_of(with_execution(text, how)) for how in ("auto", "fused"))
    assert lanes.outcome.values.tolist() == [0, 0, 3, 3, 0, 0]
    assert lanes.message.values.tolist() == fused.message.values.tolist()
    assert_agree(lanes, fused)


CHAIN = """
[body]
kind = "chain"
masses = [1.0, 2.0, 1.5]
stiffnesses = 5.0
dampings = {dampings}
modes = {modes}
[forcing]
amplitude = [1.0, 0.5, 0.0]
angular_frequency = 1.0
[[stop]]
position = 0.2
restitution = 0.4
[record]
transient_periods = 2
recorded_periods = 3
[execution]
how = "auto"
[sweep]
"body.masses[2]" = {{ values = [1.0, 2.5] }}
"forcing.amplitude[1]" = {{ values = [0.5, 2.0] }}
"""
BEAM = """
[body]
kind = "beam"
length = 1.0
mass_per_length = 1.0
frequency = 0.7
damping_ratio = 0.05
modes = {modes}
[forcing]
kind = "{kind}"
{mode}
amplitude = 4.0
frequency = 0.5
[[stop]]
position = 0.2
restitution = 0.4
[[stop]]
position = -0.3
side = "lower"
location = 0.6
restitution = 0.8
[record]
transient_periods = 2
recorded_periods = 3
[execution]
how = "auto"
[sweep]
"body.length" = {{ values = [0.7, 1.3] }}
"forcing.frequency" = {{ values = [0.4, 0.6]{path} }}
"""
MORE_STOPS = """
[[stop]]
position = 0.05
location = 0.3
restitution = 0.6
[[stop]]
position = -0.2
side = "lower"
location = 0.5
restitution = 0.7
yield_velocity = 0.1
"""
"""Two further stops of the beam: one is nearer than the stops above, the other farther."""


def beam(kind: str, modes: int, path: str = "independent") -> str:
    mode = "mode = 1" if kind == "mode" else ""
    return BEAM.format(kind=kind, mode=mode, modes=modes, path=f', path = "{path}"')


@pytest.mark.parametrize(
    "text",
    [
        CHAIN.format(modes=1, dampings=0.0),
        CHAIN.format(modes=3, dampings=[0.1, 0.1, 0.1]),
        CHAIN.format(modes=3, dampings=[0.1, 0.4, 0.2]),
        *(beam(kind, 1) for kind in ("force", "uniform", "mode", "base_acceleration")),
        beam("uniform", 1).replace("[record]", MORE_STOPS + "[record]"),
        beam("uniform", 3),
        beam("force", 2, path="up-down"),
    ],
    ids=["chain", "modes", "coupled", "force", "uniform", "mode", "base", "stops", "beam", "path"],
)
def test_chains_and_beams_in_lanes_are_those_of_the_scalar_engine(text: str) -> None:
    text = text.replace("[record]", "[record]\n" + SERIES)
    assert_agree(rows_of(with_execution(text, "auto")), rows_of(with_execution(text, "fused")))
