"""The planned output of a sweep: a continuous phase, and periods that are exact to the sample."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.sweep_files import sweep_of

from vibroimpact.hardware.programs.sweep.plan import CYCLE, Plan, planned, recorded_periods
from vibroimpact.hardware.programs.sweep.settings import SweepSettings

FREQUENCIES = st.lists(st.floats(0.37, 240.0), min_size=1, max_size=4, unique=True).map(sorted)
SWEEPS = st.builds(
    sweep_of,
    FREQUENCIES,
    rate=st.floats(5000.0, 60_000.0),
    path=st.sampled_from(["up", "down", "up-down"]),
    transient_periods=st.integers(0, 5),
    recorded_periods=st.integers(1, 3),
    average_periods=st.integers(1, 2),
)


def exact_phase(plan: Plan, sample: int) -> Fraction:
    """Return the phase of the output at a sample, in cycles since its start, summed as fractions."""
    total = Fraction(0)
    for segment in plan.segments:
        total += Fraction(max(0, min(sample, segment.stop) - segment.first) * segment.increment, CYCLE)
    return total


@given(SWEEPS, st.data())
def test_any_block_of_the_output_is_that_of_the_whole(settings: SweepSettings, data: st.DataObject) -> None:
    plan = planned(settings)
    whole = plan.volts(0, min(plan.samples, 30_000))
    first = data.draw(st.integers(0, len(whole) - 1))
    count = data.draw(st.integers(0, len(whole) - first))
    np.testing.assert_array_equal(plan.volts(first, count), whole[first : first + count])


@given(SWEEPS, st.data())
def test_the_output_is_a_sine_of_a_phase_that_goes_on_through_all_steps(
    settings: SweepSettings, data: st.DataObject
) -> None:
    plan = planned(settings)
    steps = [segment for segment in plan.segments if segment.kind == "step"]
    sample = data.draw(st.integers(steps[0].first, steps[-1].stop - 1))
    turn = float(exact_phase(plan, sample) % 1)
    assert plan.volts(sample, 1)[0] == pytest.approx(0.5 * np.sin(2.0 * np.pi * turn), abs=1e-14)


@given(SWEEPS)
def test_no_sample_of_the_output_changes_faster_than_the_fastest_sine_and_it_ends_at_rest(
    settings: SweepSettings,
) -> None:
    plan = planned(settings)
    volts = plan.volts(-3, min(plan.samples, 60_000) + 6)
    fastest = 2.0 * np.pi * settings.frequencies[-1] * (1.0 + 0.25 / settings.output.ramp_periods)
    assert np.abs(np.diff(volts)).max() <= 0.5 * fastest / settings.output.rate * (1.0 + 1e-9)
    assert np.abs(volts).max() <= 0.5
    assert not plan.volts(plan.samples - 1, 1)[0]
    assert not plan.volts(plan.samples, 5).any()


@given(SWEEPS, st.integers(0, 7))
def test_each_segment_begins_where_the_last_ended_and_each_period_holds_its_own_samples(
    settings: SweepSettings, finished: int
) -> None:
    plan = planned(settings, min(finished, len(settings.steps) - 1))
    for before, after in pairwise(plan.segments):
        assert before.stop == after.first
        assert (before.phase + before.count * before.increment) % CYCLE == after.phase
    for segment in plan.segments:
        if segment.kind != "step":
            continue
        edges = recorded_periods(settings, segment)
        begin = exact_phase(plan, segment.first)
        begin -= begin % 1
        assert edges[-1] == segment.stop
        for period, edge in enumerate(edges.tolist(), start=settings.sweep.transient_periods):
            assert exact_phase(plan, edge) >= begin + period
            assert edge == segment.first or exact_phase(plan, edge - 1) < begin + period


@given(SWEEPS)
def test_a_frequency_is_met_within_half_a_unit_of_its_increment(settings: SweepSettings) -> None:
    plan = planned(settings)
    for segment in plan.segments:
        if segment.kind == "step":
            asked = Fraction(settings.steps[segment.place][1])
            met = Fraction(segment.increment, CYCLE) * Fraction(settings.output.rate)
            assert abs(met - asked) <= Fraction(settings.output.rate) / (2 * CYCLE)


def test_a_sweep_that_goes_on_passes_its_finished_steps_in_the_order_of_the_path() -> None:
    settings = sweep_of([18.0, 19.0, 20.5], resume_periods=3)
    kinds = [(segment.kind, segment.place) for segment in planned(settings, 4).segments]
    assert kinds == [
        ("rise", -1),
        ("pass", 0),
        ("pass", 1),
        ("pass", 2),
        ("repeat", 3),
        ("step", 4),
        ("step", 5),
        ("fall", -1),
    ]
    passed = planned(settings, 4).segments[1]
    assert passed.count == pytest.approx(3 * 5000.0 / 18.0, abs=1)
