"""Stops that move in the Structure FMU: the frame of the stop, energies, tables, tuning, stops that close."""

import math
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from support.component_fmu import HERTZ, HUNT_CROSSLEY, KELVIN_VOIGT, LOWER, stop
from support.modal_fmu import structure_fmu
from support.moving_stops import ball, ball_in_frame, ball_on_table, drawn_structure, moving, set_table

LAWS = (
    {"restitution": 0.0},
    {"restitution": 0.5},
    {"restitution": 1.0},
    {"law": KELVIN_VOIGT, "stiffness": 200.0, "damping": 1.0},
    {"law": HERTZ, "stiffness": 500.0},
    {"law": HUNT_CROSSLEY, "stiffness": 500.0, "damping": 0.3},
)


# ---- the frame of the stop ----


@given(
    st.floats(0.3, 3.0), st.floats(0.5, 3.0), st.floats(-7.0, 7.0), st.floats(0.0, 2.0), st.sampled_from(LAWS)
)
@settings(max_examples=25)
def test_a_table_that_moves_is_a_base_that_accelerates(
    amplitude: float, w: float, phase: float, above: float, law: dict[str, float]
) -> None:
    start = (amplitude * math.cos(phase) + above, 0.1)
    with (
        ball_on_table(amplitude, *start, w=w, phase=phase, **law) as moved,
        ball_in_frame(amplitude, *start, w=w, phase=phase, **law) as held,
    ):
        for _ in range(6):
            moved.step(1.0)
            held.step(1.0)
            height = amplitude * math.cos(w * moved.time + phase)
            # chaos multiplies rounding; forces by powers of the depth are relative to contact_tolerance
            first = 1e-9 if law.get("law") in (HERTZ, HUNT_CROSSLEY) else 1e-12
            grown = first * 2.0 ** moved.get("contact[1].count")
            assert moved.state()[0] == pytest.approx(held.state()[0] + height, abs=min(1e-6, 10.0 * grown))


def test_a_contact_gives_the_motion_of_the_point_and_a_rest_that_of_the_table() -> None:
    with ball_on_table(0.5, 0.5, 0.0, restitution=0.0) as fmu:  # slower than gravity: the ball stays
        fmu.step(2.0)
        assert fmu.get("contact[1].stuck")
        assert fmu.get("contact[1].displacement") == pytest.approx(0.5 * math.cos(2.0), abs=1e-15)
        assert fmu.get("contact[1].velocity") == pytest.approx(-0.5 * math.sin(2.0), abs=1e-15)
        assert fmu.get("contact[1].force") == pytest.approx(1.0 - 0.5 * math.cos(2.0), abs=1e-14)
        assert fmu.state() == pytest.approx((0.5 * math.cos(2.0), -0.5 * math.sin(2.0)), abs=1e-15)


def test_a_motion_is_as_exact_after_a_million_periods() -> None:
    w, start = 1.3, 4833219.467  # s
    with mp.workdps(40):
        phase = float(mp.fmod(-mp.mpf(w) * start, 2 * mp.pi))  # highest at the start
        height = float(mp.mpf("0.5") * mp.cos(mp.mpf(w) * (mp.mpf(start) + 1) + mp.mpf(phase)))
    table = moving(amplitude=0.5, angular_frequency=w, phase=phase)
    parameters = {"forcing.angular_frequency": 0.7, "force": -1.0, **table, **stop(0.0, 0.0, side=LOWER)}
    with structure_fmu(ball(0.5, 0.0), parameters, initialize=False) as fmu:
        fmu.initialize(start)
        fmu.time = start
        fmu.step(1.0)
        assert fmu.get("contact[1].stuck")
        assert fmu.get("contact[1].displacement") == pytest.approx(height, abs=2e-16)


def test_stops_with_one_motion_carry_a_body_between_them() -> None:
    """A cage around a ball: both stops move alike, so that the ball bounces in it as in one that stands still."""
    motion = {"velocity": 0.7}
    arrays = ball(0.0, 1.0) | {"mode.contact_shape": [[1.0], [1.0]]}
    cage = {**stop(0.5, 1.0), **stop(-0.5, 1.0, side=LOWER, k=2)}
    with structure_fmu(arrays, {**cage, **moving(1, **motion), **moving(2, **motion)}) as fmu:
        fmu.step(10.0)
        # relative speed .3 at first: hits at 5/3 on the upper stop, then at 5 and 25/3
        assert [fmu.get(f"contact[{k}].count") for k in (1, 2)] == [2, 1]
        assert fmu.get("contact[1].last_velocity") == pytest.approx(0.3, rel=1e-13)
        assert fmu.get("contact[1].last_time") == pytest.approx(25.0 / 3.0, rel=1e-14)


# ---- energies ----


@given(st.integers(0, 10**6))
@settings(max_examples=25)
def test_the_energy_is_balanced_by_the_work_of_moving_stops(seed: int) -> None:
    with drawn_structure(seed).start() as fmu:
        fmu.set("record.energies", 1)
        before = fmu.get("energy.kinetic") + fmu.get("energy.potential")
        fmu.step(9.0)
        fmu.step(0.5)
        work, lost, stops = (
            fmu.get(f"energy.{name}") for name in ("forcing_work", "damping_loss", "contact_loss")
        )
        after = fmu.get("energy.kinetic") + fmu.get("energy.potential")
        size = max(1e-3, before, after, abs(work), lost, abs(stops))
        assert after - before == pytest.approx(work - lost - stops, abs=1e-9 * size)


# ---- tables ----


@given(st.integers(2, 9), st.integers(0, 10**6))
@settings(max_examples=20)
def test_a_body_on_a_table_follows_its_natural_spline(count: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    times, values = np.cumsum(draw.uniform(0.5, 2.0, count)), 0.05 * draw.normal(size=count)
    spline = CubicSpline(times, values, bc_type="natural")
    motion = moving(table_start=1, table_count=count)
    fmu = structure_fmu(
        ball(1.0, 0.0), {"force": -50.0, **stop(-1.0, 0.0, side=LOWER), **motion}, initialize=False
    )
    set_table(fmu, times, values)
    fmu.initialize()
    with fmu:
        fmu.step(0.6)  # it falls
        for end in np.linspace(0.7, times[-1] + 1.0, 12):
            fmu.step(end - fmu.time)
            inside = np.clip(end, times[0], times[-1])
            height = spline(inside) + spline(inside, 1) * (end - inside)  # straight outside of the table
            if fmu.get("contact[1].stuck"):
                assert fmu.get("contact[1].displacement") == pytest.approx(height - 1.0, abs=1e-14)
            assert fmu.get("contact[1].displacement") >= height - 1.0 - 1e-14


def test_kinks_of_the_jerk_are_ends_of_segments() -> None:
    """A ball in free flight meets a spline with a large curvature where the closed form does."""
    times, values = [0.0, 0.5, 0.51, 0.52, 2.0], [0.0, 0.0, 0.2, 0.0, 0.0]
    spline = CubicSpline(times, values, bc_type="natural")
    fmu = structure_fmu(
        ball(0.1, 0.0),
        {**stop(0.0, 1.0, side=LOWER), **moving(table_start=1, table_count=5)},
        initialize=False,
    )
    set_table(fmu, times, values)
    fmu.initialize()
    with fmu:
        fmu.step(0.51)
        hit = next(root for root in spline.solve(0.1, extrapolate=False) if 0.5 <= root <= 0.51)
        assert fmu.get("contact[1].count") == 1
        assert fmu.get("contact[1].last_time") == pytest.approx(hit, rel=1e-14)
        assert fmu.get("contact[1].last_velocity") == pytest.approx(float(spline(hit, 1)), rel=1e-11)


# ---- stops that leave, close, or are tuned ----


def test_a_stop_that_falls_faster_than_the_ball_is_not_met() -> None:
    with structure_fmu(ball(0.0, -1.0), {**stop(0.0, 0.5, side=LOWER), **moving(velocity=-1.0000001)}) as fmu:
        fmu.step(100.0)
        assert fmu.get("contact[1].count") == 0
        assert not fmu.get("contact[1].stuck")


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_jaws_that_close_end_the_run_by_name(restitution: float) -> None:
    arrays = ball(0.0, 0.3) | {"mode.contact_shape": [[1.0], [1.0]]}
    jaws = {**stop(0.5, restitution), **stop(-0.5, restitution, side=LOWER, k=2)}
    motion = {**moving(1, velocity=-0.1), **moving(2, velocity=0.15)}
    messages: list[str] = []
    with structure_fmu(arrays, {**jaws, **motion}, messages=messages) as fmu:
        fmu.step(3.9)
        with pytest.raises(FMICallException):
            fmu.step(0.2)
    assert "contact[1], contact[2]: expected room between their stops, of which one moves, got none at 4" in (
        messages[-1].replace("got none at 3.99999", "got none at 4")
    )


def test_a_tuned_motion_goes_on_from_its_place() -> None:
    with structure_fmu(
        ball(5.0, 0.0), {"force": -1.0, **stop(0.0, 0.0, side=LOWER), **moving(velocity=0.2)}
    ) as fmu:
        fmu.step(5.0)
        assert fmu.get("contact[1].stuck")
        fmu.set("stop[1].velocity", -0.1)  # the table stops short: the ball flies on, and lands again
        fmu.step(5.0)
        assert fmu.get("contact[1].stuck")
        assert fmu.get("contact[1].displacement") == pytest.approx(1.0 - 0.5, abs=1e-14)


def test_a_tuned_frequency_keeps_the_phase() -> None:
    with ball_on_table(0.4, 0.4, 0.0, restitution=0.0) as fmu:
        fmu.step(2.0)
        fmu.set("stop[1].angular_frequency", 0.5)
        fmu.step(1.0)
        assert fmu.get("contact[1].displacement") == pytest.approx(0.4 * math.cos(2.5), abs=1e-14)


def test_a_tuned_stop_may_not_cut_a_body() -> None:
    messages: list[str] = []
    parameters = {**stop(-1.0, 0.5, side=LOWER), **moving(amplitude=0.1, angular_frequency=1.0)}
    with structure_fmu(ball(0.0, 0.0), parameters, messages=messages) as fmu:
        fmu.set("stop[1].amplitude", 2.0)
        with pytest.raises(FMICallException):
            fmu.step(1.0)
        assert (
            "stop[1]: expected a motion that leaves the point on the free side of contact[1]" in messages[-1]
        )
        fmu.set("stop[1].amplitude", 0.5)
        fmu.step(1.0)


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        ({"amplitude": 1.0}, "stop[1].angular_frequency: expected 1e-150 to 1e+150 with an amplitude, got 0"),
        ({"velocity": math.inf}, "stop[1]: expected a finite velocity, amplitude and phase"),
        ({"table_count": 1}, "stop[1].table_count: expected 0, or 2 and more numbers"),
        ({"table_start": 8192, "table_count": 2}, "stop[1].table_count: expected 0, or 2 and more numbers"),
        ({"table_count": 3}, "table.time[2]: expected more than the time before, 0, got 0"),
        (
            {"amplitude": 9.0, "angular_frequency": 1.0},
            "expected a start on the free side of contact[1] (>= 8)",
        ),
    ],
)
def test_a_wrong_motion_is_refused_by_one_line(motion: dict[str, float], message: str) -> None:
    messages: list[str] = []
    parameters = {**stop(-1.0, 0.5, side=LOWER), **moving(**motion)}
    with pytest.raises(FMICallException):
        structure_fmu(ball(0.0, 0.0), parameters, messages=messages)
    assert message in messages[-1]


def test_motions_count_as_modes() -> None:
    messages: list[str] = []
    arrays = {"mode.angular_frequency": np.ones(64), "mode.contact_shape": [np.ones(64)]}
    with pytest.raises(FMICallException):
        structure_fmu(arrays, {**stop(1.0), **moving(velocity=1.0)}, messages=messages)
    assert "modes: expected at most 63 beside 1 motions of stops, each a mode, got 64" in messages[-1]


# ---- cuts and records ----


def test_communication_points_move_nothing() -> None:
    ends = []
    for step in (30.0, 0.5, 0.06):
        with ball_on_table(1.3, 1.5, 0.4, restitution=0.5) as fmu:
            for _ in range(round(30.0 / step)):
                fmu.step(step)
            ends.append((*fmu.state(), fmu.get("contact[1].count")))
    for one, other in pairwise(ends):
        assert one == pytest.approx(other, abs=1e-12)


def test_impacts_are_recorded_with_the_relative_speed() -> None:
    with structure_fmu(ball(1.0, 0.0), {**stop(0.0, 0.5, side=LOWER), **moving(velocity=0.25)}) as fmu:
        fmu.step(5.0)
        assert fmu.get("contact[1].last_time") == pytest.approx(4.0, rel=1e-15)
        assert fmu.get("contact[1].last_velocity") == 0.25
        assert fmu.state()[1] == pytest.approx(0.375, rel=1e-15)  # 0.25 + 0.5 * 0.25
        assert fmu.get("contact[1].impulse") == pytest.approx(0.375, rel=1e-15)
