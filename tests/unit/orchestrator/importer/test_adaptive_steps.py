"""Communication steps that follow an estimate of their errors."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import EXCHANGES, body, contact, events_of, external, link, part, stop, values

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.adaptive.controller import StepController
from vibroimpact.orchestrator.importer.adaptive.record import StepRecord
from vibroimpact.orchestrator.importer.aliasing import SampledRates
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

#: Largest error of a run over the recorded sum of the estimated errors of its steps; 0.7 in 120 random couplings.
MOST_OVER_ESTIMATE = 2.0


def springs(stiffness: float, coupling: float, displacement: float = 1.0) -> list[ComponentSpec]:
    own = {"mass": 1.0, "stiffness": 1.0 + coupling}
    return [
        body("a", {**own, "displacement_start": displacement}),
        body("b", {**own, "stiffness": stiffness + coupling}),
    ]


def joined(coupling: float) -> list[ConnectionSpec]:
    return [
        link("b.displacement", "a.force", coupling),
        link("a.displacement", "b.force", coupling),
    ]


def exact(stiffness: float, coupling: float, time: float) -> np.ndarray:
    """Return displacements and velocities of two unit masses on springs, joined by a spring; a starts at 1."""
    matrix = np.array([[1.0 + coupling, -coupling], [-coupling, stiffness + coupling]])
    squares, modes = np.linalg.eigh(matrix)
    rates = np.sqrt(squares)
    start = modes.T @ np.array([1.0, 0.0])
    return np.concatenate(
        [modes @ (np.cos(rates * time) * start), modes @ (-rates * np.sin(rates * time) * start)]
    )


def motion(importer: Importer) -> np.ndarray:
    return np.array(
        [v for one in ("displacement", "velocity") for name in "ab" for v in values(importer, name, one)]
    )


def run_springs(
    tolerance: float, exchange: str, stiffness: float = 1.0, coupling: float = 0.1, end: float = 4.0
) -> tuple[float, StepRecord]:
    importer = Importer(
        springs(stiffness, coupling),
        joined(coupling),
        exchange=exchange,  # type: ignore[arg-type]  # a parameter of tests
        macro_step="auto",
        coupling_tolerance=tolerance,
    )
    importer.begin()
    importer.advance(end)
    scales = np.abs([exact(stiffness, coupling, time) for time in np.linspace(0.0, end, 100)]).max(axis=0)
    off = np.abs(motion(importer) - exact(stiffness, coupling, end)) / scales
    assert importer.adaptive is not None
    record = importer.adaptive.record
    importer.free()
    return float(off.max()), record


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_the_error_of_a_run_falls_with_the_tolerance_below_its_estimate(exchange: str) -> None:
    runs = [run_springs(tolerance, exchange) for tolerance in (1e-2, 1e-4)]
    errors = [error for error, _ in runs]
    assert errors[0] > 5.0 * errors[1]
    for error, record in runs:
        assert error < record.error
        assert record.smallest < record.largest
    assert runs[0][1].steps < runs[1][1].steps


@settings(max_examples=12, deadline=None)
@given(
    st.floats(0.2, 30.0),
    st.floats(0.01, 1.0),
    st.sampled_from(EXCHANGES),
    st.sampled_from([1e-3, 1e-4, 1e-5]),
)
def test_any_two_coupled_springs_stay_within_a_multiple_of_the_estimate(
    stiffness: float, coupling: float, exchange: str, tolerance: float
) -> None:
    error, record = run_springs(tolerance, exchange, stiffness, coupling, end=4.0)
    assert error < MOST_OVER_ESTIMATE * record.error
    assert record.error <= 1.0001 * tolerance * record.steps


def test_a_stiff_body_beside_a_slow_one_takes_the_steps_of_their_coupling() -> None:
    importer = Importer(springs(1e12, 0.1), joined(0.1), macro_step="auto", coupling_tolerance=1e-4)
    importer.begin()
    importer.advance(0.3)
    # the stiff body follows by 1e-13 m: its own vibration of 1e6 rad/s is not resolved, and is not felt by the slow one
    assert abs(values(importer, "a", "displacement")[0] - math.cos(math.sqrt(1.1) * 0.3)) < 1e-4
    assert importer.adaptive is not None
    assert importer.adaptive.record.steps < 20_000
    importer.free()


@pytest.mark.parametrize("tolerance", [1.0, 1e-14])
def test_any_tolerance_ends(tolerance: float) -> None:
    error, record = run_springs(tolerance, "iterated", coupling=0.01, end=1e-3)
    assert error < 1e-3
    assert record.steps < 20_000


def test_tolerances_are_numbers_up_to_1() -> None:
    for wrong in (0.0, 2.0, math.nan):
        with pytest.raises(ComponentError, match="coupling_tolerance: expected a number > 0 and <= 1"):
            Importer(springs(1.0, 0.1), joined(0.1), macro_step="auto", coupling_tolerance=wrong)


def test_a_step_at_a_jump_of_an_input_is_taken_back(tmp_path: Path) -> None:
    # the ball throws itself back between two steps and says so to nobody: its velocity jumps within a step
    ball = ComponentSpec("ball", fmu_factory.bouncing_ball(tmp_path), {})
    importer = Importer(
        [ball, body("b", {"mass": 1.0, "stiffness": 1.0})],
        [link("ball.v", "b.force")],
        macro_step="auto",
        coupling_tolerance=1e-5,
    )
    importer.begin()
    importer.advance(1.0)
    assert importer.adaptive is not None
    record = importer.adaptive.record
    assert record.rejected > 0
    assert record.smallest < 1e-2 * record.largest
    importer.free()


def test_no_connection_needs_no_step() -> None:
    importer = Importer(
        [body("a", {"mass": 1.0, "stiffness": 1.0, "displacement_start": 1.0})], macro_step="auto"
    )
    importer.begin()
    importer.advance(3.0)
    assert importer.adaptive is None
    assert importer.steps == 1
    importer.free()


def test_the_connections_of_a_contact_port_need_no_step() -> None:
    parts = [body("b", {"stiffness": 1.0, "velocity_start": 2.0, **external(1.0)}), stop("s", 0.7)]
    importer = Importer(parts, contact("b", "s"), macro_step="auto")
    events = events_of(importer)
    importer.begin()
    importer.advance(3.0)
    assert importer.adaptive is None
    assert len(events) == 1
    importer.free()


def test_events_end_steps_and_small_steps_follow_them() -> None:
    parts = [
        body("a", {"mass": 1.0, "stiffness": 1.0, "velocity_start": 2.0, **external(0.5)}),
        stop("s", 0.7),
        body("b", {"mass": 1.0, "stiffness": 2.0}),
    ]
    links = [*contact("a", "s"), link("a.displacement", "b.force"), link("b.displacement", "a.force", 0.1)]
    importer = Importer(parts, links, macro_step="auto", coupling_tolerance=1e-3)
    events, sizes = events_of(importer), []
    importer.watchers.append(
        StepWatcher(lambda time: None, lambda time, end: sizes.append((end, end - time)))
    )
    importer.begin()
    importer.advance(0.6)
    ends = np.array([end for end, _ in sizes])
    steps = np.array([size for _, size in sizes])
    assert events
    for event in events:
        place = int(np.flatnonzero(ends == event.time)[0])
        assert steps[place + 1] < 0.2 * steps[place - 1]
    importer.free()


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_sampling_changes_no_bit(exchange: str) -> None:
    found = []
    for rate in (0.0, 7.0, 300.0):
        importer = Importer(
            springs(2.0, 0.3),
            joined(0.3),
            exchange=exchange,  # type: ignore[arg-type]  # a parameter of tests
            macro_step="auto",
            coupling_tolerance=1e-4,
        )
        sampler = Sampler(importer, [("a", "displacement")], rate) if rate else None
        importer.begin()
        if sampler is not None:
            sampler.begin(0.0, 3.0)
        importer.advance(3.0)
        found.append((motion(importer).tobytes(), importer.steps))
        if sampler is not None:
            exactly = [exact(2.0, 0.3, time)[0] for time in sampler.rows[:, 0]]
            assert np.abs(sampler.rows[:, 1] - exactly).max() < 1e-2
        importer.free()
    assert found[0] == found[1] == found[2]


def test_a_second_run_is_the_first_one_again() -> None:
    importer = Importer(springs(2.0, 0.3), joined(0.3), macro_step="auto", coupling_tolerance=1e-4)
    found = []
    for _ in range(2):
        importer.begin()
        importer.advance(3.0)
        assert importer.adaptive is not None
        found.append((motion(importer).tobytes(), importer.adaptive.record))
    assert found[0] == found[1]
    importer.free()


def test_a_component_without_states_is_followed_by_extrapolation(tmp_path: Path) -> None:
    gain = part("g", fmu_factory.gain(tmp_path), k=-0.5)
    moved = body("a", {"mass": 1.0, "stiffness": 1.0, "displacement_start": 1.0})
    errors = []
    for tolerance in (1e-3, 1e-5):
        importer = Importer(
            [moved, gain],
            [link("a.displacement", "g.u"), link("g.y", "a.force")],
            macro_step="auto",
            coupling_tolerance=tolerance,
        )
        importer.begin()
        importer.advance(5.0)
        errors.append(abs(values(importer, "a", "displacement")[0] - math.cos(math.sqrt(1.5) * 5.0)))
        assert importer.adaptive is not None
        assert importer.adaptive.record.error > errors[-1]
        importer.free()
    assert errors[0] > 5.0 * errors[1]


def test_a_value_that_no_short_step_settles_is_named() -> None:
    importer = Importer(springs(1.0, 0.1), joined(0.1), macro_step="auto")
    importer.begin()
    importer.advance(1e-3)
    assert importer.adaptive is not None
    importer.steps_in_c = False
    importer.adaptive._halved.difference = lambda one, other: np.full(len(one), 1.0)  # type: ignore[method-assign]
    expected = r"macro_step: expected an error of at most 1e-06 .*, got .* of b.displacement -> a.force at time 0.001"
    with pytest.raises(ComponentError, match=expected):
        importer.advance(2e-3)
    importer.free()


def test_a_body_with_one_step_size_is_refused_by_the_name_of_the_flag(tmp_path: Path) -> None:
    fixed = fmu_factory.redescribed(
        fmu_factory.mass(tmp_path),
        tmp_path / "fixed.fmu",
        ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"'),
    )
    with pytest.raises(
        ComponentError, match=r'm: expected .*any size.*"auto".*canHandleVariableCommunicationStepSize'
    ):
        Importer([part("m", fixed)], macro_step="auto")


@pytest.mark.parametrize("macro_step", [0.01, "auto"])
def test_a_body_that_is_sampled_too_slowly_is_named(macro_step: float | str) -> None:
    parts = [
        body("fast", {"mass": 1.0, "stiffness": 1e8, "displacement_start": 1.0}),
        body("slow", {"mass": 1.0, "stiffness": 1.0}),
    ]
    importer = Importer(
        parts,
        [link("fast.displacement", "slow.force")],
        macro_step=macro_step,  # type: ignore[arg-type]  # a parameter of tests
        coupling_tolerance=1e-4,
    )
    rates, end = SampledRates(importer), 5e-4 if macro_step == "auto" else 0.02
    importer.begin()
    importer.advance(end)
    remarks = rates.remarks()
    if macro_step == "auto":
        assert not remarks
        # x'' + x = cos(1e4 t): 2e-8 (cos(t) - cos(1e4 t)) / 2
        exactly = (math.cos(end) - math.cos(1e4 * end)) / (1e8 - 1.0)
        assert values(importer, "slow", "displacement")[0] == pytest.approx(exactly, abs=2e-9)
    else:
        assert remarks == [
            "fast reports motion of 1e+04 rad/s, a period of 0.000628 s, but others sample it every 0.01 s: "
            "motion this fast is aliased, which a shorter macro_step avoids"
        ]
    importer.free()


def test_the_controller_shrinks_after_an_error_and_doubles_at_most() -> None:
    controller = StepController(2)
    controller.begin(1.0)
    controller.accept(1.0, 0.0, cut=False)
    assert controller.size == 2.0
    controller.reject(2.0, 4.0)
    assert controller.size == pytest.approx(0.9)
    controller.accept(0.9, 1e-6, cut=False)
    assert controller.size == pytest.approx(0.9)  # no growth after a rejection
    controller.accept(0.1, 1e-6, cut=True)
    assert controller.size == pytest.approx(0.9)  # a cut step says nothing against longer ones
    controller.reject(0.9, math.inf)
    assert controller.size == pytest.approx(0.18)
    assert controller.end_of(0.0, 0.19) == 0.19
    assert controller.end_of(0.0, 1.0) == pytest.approx(0.18)
