"""Analysis of the samples of a step, for motions with known extrema, impacts and faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.sweep_files import CELL, DRIVE, sweep_of

from vibroimpact.analysis.dataset import MeasurementFlag
from vibroimpact.hardware.programs.sweep.analysis import (
    Converter,
    MeasuredStep,
    StepCollector,
    StepSamples,
    analysed,
)
from vibroimpact.hardware.programs.sweep.drive import SeenLags, clock_error_of, seen_drive
from vibroimpact.hardware.programs.sweep.extrema import extrema_of
from vibroimpact.hardware.programs.sweep.plan import CYCLE, Plan, planned, recorded_periods
from vibroimpact.hardware.programs.sweep.settings import SweepSettings

Floats = NDArray[np.float64]
CONVERTER = Converter(-5.0, 5.0, 10.0 / 2**16)
SETTINGS = sweep_of([20.0], inputs=(DRIVE, CELL), path="up", transient_periods=20, recorded_periods=10)


def metres(volts: Floats, time: Floats) -> Floats:
    """Return a displacement of 1 mm per V."""
    return 1e-3 * volts


def step_of(
    tip: Callable[[Floats], Floats], settings: SweepSettings = SETTINGS, cell: Floats | None = None
) -> StepSamples:
    """Return the samples of the first step, for a tip given as a function of the forcing cycles."""
    plan = planned(settings)
    segment = next(segment for segment in plan.segments if segment.kind == "step")
    cycles = np.arange(segment.count) * (segment.increment / CYCLE) + segment.phase / CYCLE
    volts = [tip(cycles), plan.volts(segment.first, segment.count), np.zeros(segment.count)]
    if cell is not None:
        volts[2] = cell
    return StepSamples(segment, np.stack(volts[: len(settings.inputs)]))


def shown(step: StepSamples, settings: SweepSettings = SETTINGS) -> MeasuredStep:
    """Return the analysis of a step, for a converter of 16 bits."""
    return analysed(step, settings, metres, [CONVERTER] * len(settings.inputs))


def sine(cycles: Floats) -> Floats:
    """Return a tip displacement that follows the drive, of 2 V."""
    found: Floats = 2.0 * np.sin(2.0 * np.pi * cycles)
    return found


@given(st.floats(0.0, 1.0), st.floats(20.0, 300.0), st.floats(1e-3, 1e3))
def test_extrema_of_a_sine_lie_between_its_samples(phase: float, samples: float, size: float) -> None:
    count = int(3 * samples)
    wave = size * np.sin(2.0 * np.pi * (np.arange(count) / samples + phase))
    edges = np.ceil(np.array([0.5, 1.5, 2.5]) * samples).astype(np.int64)
    highest, lowest = extrema_of(wave, edges)
    # error of the parabola: of fourth order
    error = (2.0 * np.pi / samples) ** 4 / 20.0 + 1e-12
    np.testing.assert_allclose(highest, size, rtol=error)
    np.testing.assert_allclose(lowest, -size, rtol=error)


@given(st.floats(0.0, 1.0), st.floats(0.1, 1.0))
def test_the_extremum_at_a_stop_is_where_the_motion_turns_round(place: float, restitution: float) -> None:
    time = (np.arange(400) - 200.0 - place) * 1e-3
    # at 1 m/s towards the stop, slower after it, both with the same acceleration
    motion = np.where(time < 0.0, time, -restitution * time) - 2.0 * time**2
    highest, _ = extrema_of(motion, np.array([100, 300]))
    assert highest[0] == pytest.approx(0.0, abs=6e-6)


def test_a_period_with_a_lost_sample_has_no_extrema_and_the_others_have() -> None:
    wave = np.sin(2.0 * np.pi * np.arange(300) / 100.0)
    wave[150] = np.nan
    highest, lowest = extrema_of(wave, np.array([0, 100, 200, 300]))
    assert np.isnan(highest).tolist() == np.isnan(lowest).tolist() == [False, True, False]


@given(st.lists(st.integers(1, 4000), min_size=1, max_size=20), st.data())
def test_steps_are_cut_by_sample_numbers_however_the_blocks_come(
    sizes: list[int], data: st.DataObject
) -> None:
    settings = sweep_of([180.0, 190.0], path="up-down", transient_periods=2)
    plan = planned(settings)
    lost = data.draw(st.integers(0, len(sizes)))
    collector, found, first, missing, seen = StepCollector(plan, 1), [], 0, set(), 0
    for number in range(10**6):
        if first >= plan.samples:
            break
        count = min(sizes[number % len(sizes)], plan.samples - first)
        samples = np.arange(first, first + count, dtype=np.float64)
        if number == lost:
            missing = set(samples.tolist())
        else:
            found += collector.take(first, samples[np.newaxis])
            seen = first + count
        first += count
    steps = [segment for segment in plan.segments if segment.kind == "step"]
    assert [step.segment for step in found] == [segment for segment in steps if segment.stop <= seen]
    for step in found:
        expected = np.arange(step.segment.first, step.segment.stop, dtype=np.float64)
        expected[np.isin(expected, list(missing))] = np.nan
        np.testing.assert_array_equal(step.volts[0], expected)


def test_a_clean_step_has_no_flag_and_its_values_in_metres() -> None:
    found = shown(step_of(sine))
    assert (found.flags, found.message) == (MeasurementFlag(0), "")
    np.testing.assert_allclose(found.highest, 2e-3, rtol=1e-6)
    np.testing.assert_allclose(found.lowest, -2e-3, rtol=1e-6)
    np.testing.assert_allclose(found.strobe[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.strobe[:, 1], 2e-3 * 2.0 * np.pi * 20.0, rtol=1e-3)
    assert found.drive.amplitude == pytest.approx(0.5, rel=1e-9)
    assert found.drive.lag == pytest.approx(0.0, abs=1e-9)


def test_values_are_means_of_groups_of_periods() -> None:
    settings = sweep_of([20.0], path="up", transient_periods=20, recorded_periods=2, average_periods=5)

    def grows(cycles: Floats) -> Floats:
        return (1.0 + np.floor(cycles)) * np.sin(2.0 * np.pi * cycles) * 0.01

    found = shown(step_of(grows, settings), settings)
    np.testing.assert_allclose(found.highest, 1e-5 * np.array([23.0, 28.0]), rtol=1e-6)


@pytest.mark.parametrize(
    ("spoilt", "flag", "words"),
    [
        (lambda v, e: v * 3.0, MeasurementFlag.clipped, "tip at the end of the range"),
        (lambda v, e: np.where(np.arange(len(v)) == e[3] + 7, np.nan, v), MeasurementFlag.gap, "1 of"),
        (
            lambda v, e: v * (1.0 + 0.02 * np.arange(len(v)) / (e[-1] - e[0])),
            MeasurementFlag.drift,
            "range changed by 1.",
        ),
        (
            lambda v, e: v + 0.2 * np.arange(len(v)) / (e[-1] - e[0]),
            MeasurementFlag.drift,
            "mean changed by 4.",
        ),
    ],
)
def test_what_is_wrong_with_a_step_is_flagged(
    spoilt: Callable[..., Floats], flag: MeasurementFlag, words: str
) -> None:
    step = step_of(sine)
    edges = recorded_periods(SETTINGS, step.segment) - step.segment.first
    step.volts[0] = np.clip(spoilt(step.volts[0], edges), -5.0, 5.0 - CONVERTER.step)
    found = shown(step)
    assert found.flags == flag
    assert found.message.startswith(words)


def test_noise_and_chaos_are_no_drift() -> None:
    random = np.random.default_rng(3)
    flags = []
    for _ in range(50):
        sizes = random.uniform(0.5, 1.5, 40)
        found = shown(step_of(lambda cycles, s=sizes: s[cycles.astype(int)] * sine(cycles)))  # type: ignore[misc]
        flags.append(found.flags)
    assert flags.count(MeasurementFlag(0)) >= 48


@pytest.mark.parametrize("of", ["half of the drive", "a drive that stands still"])
def test_a_drive_that_is_not_the_planned_one_is_flagged(of: str) -> None:
    step = step_of(sine)
    if of == "half of the drive":
        step.volts[1] *= 0.5
    else:
        step.volts[1, len(step.volts[1]) // 2 :] = 0.3
    assert shown(step).flags & MeasurementFlag.starved


def test_impacts_are_counted_once_with_their_ringing() -> None:
    plan = planned(SETTINGS)
    segment = next(segment for segment in plan.segments if segment.kind == "step")
    cycles = np.arange(segment.count) * 20.0 / SETTINGS.output.rate
    late = np.concatenate([(cycles - 0.3) % 1.0, (cycles - 0.6) % 2.0]).reshape(2, -1) / 20.0
    rings = np.exp(-late / 1e-3) * np.cos(2.0 * np.pi * 800.0 * late)
    found = shown(step_of(sine, cell=rings.sum(axis=0) + 0.2))
    assert found.impacts is not None
    # one in each period, and a second one in every other period
    assert found.impacts.tolist() == [2.0, 1.0] * 5


@given(st.floats(-500.0, 500.0), st.floats(12.0, 90.0), st.integers(8, 200))
def test_the_clock_error_comes_back_from_the_drive(error: float, frequency: float, periods: int) -> None:
    settings = sweep_of([frequency], path="up", transient_periods=periods, recorded_periods=2)
    plan: Plan = planned(settings)
    segment = next(segment for segment in plan.segments if segment.kind == "step")
    samples = np.arange(segment.first, segment.stop)
    # sample k of a clock that is fast by e is taken at k / (1 + e)
    cycles = (samples / (1.0 + 1e-6 * error) - segment.first) * segment.increment / CYCLE
    drive = 0.5 * np.sin(2.0 * np.pi * (cycles + segment.phase / CYCLE))
    found = seen_drive(drive, segment, settings.output.rate)
    assert found.clock_error == pytest.approx(error, abs=0.02 + 5e-3 * abs(error))
    assert found.amplitude == pytest.approx(0.5, rel=1e-3)


def test_a_lost_part_of_the_drive_does_not_spoil_the_rest() -> None:
    step = step_of(sine)
    step.volts[1, 100:900] = np.nan
    found = seen_drive(step.volts[1], step.segment, SETTINGS.output.rate)
    assert found.amplitude == pytest.approx(0.5, rel=1e-6)
    assert np.isnan(seen_drive(np.full_like(step.volts[1], np.nan), step.segment, 5000.0).amplitude)


def test_a_load_cell_that_clips_is_said_by_its_name() -> None:
    step = step_of(sine, cell=np.full(planned(SETTINGS).segments[1].count, 5.0))
    assert shown(replace(step)).message.startswith("cell at the end of the range")


@given(st.floats(-300.0, 300.0), st.integers(3, 40), st.booleans())
def test_the_slope_of_lags_that_have_gone_round_is_the_clock_error(
    error: float, steps: int, anew: bool
) -> None:
    time = 5.0 + 6.0 * np.arange(steps)
    period = 1.0 / np.linspace(18.0, 27.0, steps)
    # the lag grows by whole samples, and each step has a coarse slope of its own
    true = np.rint(5000.0 * 1e-6 * error * time) / 5000.0
    seen = (true + period / 2.0) % period - period / 2.0
    coarse = np.full(steps, error + 4.0) + np.where(np.arange(steps) % 2, 3.0, -3.0)
    lags = [SeenLags(time, seen, coarse, period)]
    found, doubt = clock_error_of(lags * 2 if anew else lags)
    assert found == pytest.approx(error, abs=1e6 / 5000.0 / (6.0 * (steps - 1)))
    assert doubt < 1e6 / 5000.0 / 6.0
    assert np.isnan(clock_error_of([])[0])
