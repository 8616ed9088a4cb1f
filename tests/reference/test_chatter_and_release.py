"""Chatter, sticking and release against 40-digit event computations (equations.md 3.1, 3.3, 2.4 and section 9)."""

import math

import numpy as np
import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, simulate, stop
from support.tolerance import AFTER_RELEASE, PRINTED_12, ROUNDING, SEQUENCE

ANCHOR = {**forced(1.0, 0.2, 0.05, displacement_start=-0.1), **stop(0.0)}
STICK_START, STICK_END = 2.50982609171411, 7.853981633974483
NEXT_TIME, NEXT_VELOCITY = 23.64959897294654, 0.113626292719042


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interval", [24.0, 5.0, 0.37, 0.01, 0.001])
def test_chatter_ends_sticks_and_is_released_at_the_same_instants_at_any_interval(
    version: str, interval: float
) -> None:
    with OscillatorFmu(ANCHOR, version=version) as o:
        for i in range(1, math.ceil(24.0 / interval) + 1):
            o.step(min(i * interval, 24.0) - o.time)
        start, end = o.contact("stick_start", "stick_end")
        time, velocity, stuck = o.contact("last_time", "last_velocity", "stuck")
    assert abs(start - STICK_START) <= SEQUENCE
    assert abs(end - STICK_END) <= SEQUENCE
    assert abs(end - math.pi / 0.4) <= ROUNDING * end
    assert abs(time - NEXT_TIME) <= AFTER_RELEASE
    assert abs(velocity - NEXT_VELOCITY) <= AFTER_RELEASE
    assert not stuck


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interval", [0.02, 1.1])
def test_a_stock_importer_sees_the_same_chatter(version: str, interval: float) -> None:
    names = ["contact[1].stick_start", "contact[1].stick_end", "contact[1].last_velocity", "displacement"]
    result = simulate("Oscillator", ANCHOR, names, 24.2, interval, version=version)
    assert abs(result[names[0]][-1] - STICK_START) <= SEQUENCE
    assert abs(result[names[1]][-1] - STICK_END) <= SEQUENCE
    assert np.nanmax(result["displacement"]) <= 0.0


def test_the_fresh_example_has_its_first_impact_accumulation_and_release() -> None:
    # zeta=.08, r=.6, F=1.3, a=.2, w=.25 from x=-.3, v=0 at t=0: 40-digit computation to V=1e-12
    parameters = {**forced(1.3, 0.25, 0.08, displacement_start=-0.3), **stop(0.2, 0.6)}
    with OscillatorFmu({**parameters, "record.impacts": True}, early_return=True) as o:
        o.advance(6.0)
        first = o.rows()[0]
        start, end = o.contact("stick_start", "stick_end")
    assert abs(first[1] - 0.833045369196) <= PRINTED_12
    assert abs(first[3] - 1.1011989184) <= 100 * PRINTED_12
    assert abs(start - 4.00493201570300567) <= SEQUENCE
    assert abs(end - 5.66534691324285) <= SEQUENCE


def test_the_summed_tail_takes_up_the_momentum_of_its_impacts() -> None:
    with OscillatorFmu({**ANCHOR, "record.impacts": True}, early_return=True) as o:
        o.advance(8.0)
        rows = o.rows()
    impacts, stick = rows[rows[:, 0] == 1.0], rows[rows[:, 0] == 2.0][0]
    velocities = impacts[:, 3]
    # below V the sequence is geometric: its remaining momentum is m (1 + r) V r / (1 - r)
    assert abs(stick[4] / (1.7 * velocities[-1] * 0.7 / 0.3) - 1.0) <= 1e-3
    assert np.all(np.diff(velocities) < 0.0)


def test_a_pressed_mass_leaves_when_the_contact_force_falls_through_zero_and_leaves_smoothly() -> None:
    # equations.md 2.4: zeta=.05, F=1, a=0, w=.2: release pi/(2w), clearance .18179 after 1.9028
    with OscillatorFmu({**forced(1.0, 0.2, 0.05), **stop(0.0)}) as o:
        o.step(1.0)
        assert o.contact("stuck")[0]
        assert abs(o.get("contact[1].force") - math.cos(0.2)) <= ROUNDING
        o.step(math.pi / 0.4 + 1.9028 - 1.0)
        assert abs(o.get("contact[1].stick_end") - math.pi / 0.4) <= ROUNDING * 8.0
        assert abs(o.get("displacement") + 0.18179) <= 1e-5


@pytest.mark.parametrize("n", [0, 1, 2])
def test_release_comes_at_the_arc_cosine_of_stop_over_force(n: int) -> None:
    # equations.md 3.3: t = (arccos(a/F) + 2 pi n)/w; here F=1.3, a=.2, w=.25, started stuck in period n
    with OscillatorFmu({**forced(1.3, 0.25, 0.08, displacement_start=0.2), **stop(0.2, 0.0)}) as o:
        expected = (math.acos(0.2 / 1.3) + 2.0 * math.pi * n) / 0.25
        o.step(expected + 0.5)
        assert abs(o.get("contact[1].stick_end") - expected) <= ROUNDING * (1.0 + expected)


def test_a_static_preload_above_the_force_keeps_the_mass_pressed_for_ever() -> None:
    with OscillatorFmu({**forced(0.5, 1.0, 0.1, displacement_start=-0.6), **stop(-0.6)}) as o:
        o.step(1e6)
        stuck, end = o.contact("stuck", "stick_end")
        force = o.get("contact[1].force")
    assert stuck
    assert math.isnan(end)
    assert abs(force - (0.6 + 0.5 * math.cos(1e6))) <= 1e-9  # cos of 1e6 s: the phase of a double at 1e6
