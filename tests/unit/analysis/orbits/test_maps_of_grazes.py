"""Sets of grazing impacts and maps of a graze. References: equations.md 4.8 to 4.10, the flow of the FMUs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError
from vibroimpact.analysis.orbits.grazing_sets import GrazingSets, grazing_sets
from vibroimpact.analysis.orbits.normal_forms import (
    Nordmark,
    grazing_family,
    periods_of,
    square_root_diagram,
)
from vibroimpact.fmus.core.oscillator import Oscillator, flow, next_contact


def body_of(
    damping: float = 0.04,
    amplitude: float = 0.9,
    w: float = 1.2,
    stop: float = 0.8,
    restitution: float = 0.75,
    direction: float = 1.0,
) -> ImpactingBody:
    """Return an oscillator of mass and natural frequency 1."""
    contact = Contact(np.array([1.0]), direction, direction * stop, restitution)
    one = np.array([1.0])
    return ImpactingBody(one, damping * one, amplitude * one, 0.0 * one, w, 0.0, (contact,), one)


def nearest(found: GrazingSets, phase: float) -> tuple[float, ...]:
    place = int(np.argmin(np.abs(np.remainder(found.grazes - phase + np.pi, 2.0 * np.pi) - np.pi)))
    columns = (
        found.grazes, found.before_phase, found.before_velocity, found.after_phase, found.after_velocity,
    )  # fmt: skip
    return tuple(float(column[place]) for column in columns)


def test_the_sets_of_the_equation_sheet() -> None:
    found = grazing_sets(body_of(), 7200)
    graze, before, speed, after, next_speed = nearest(found, 1.2 * 1.1)
    assert graze == pytest.approx(1.32, abs=5e-4)
    assert (before, speed) == pytest.approx((math.tau - 1.2 * 5.754440098 % math.tau, 4.0849309178), abs=2e-3)
    assert (after, next_speed) == pytest.approx((1.2 * 5.842865938 % math.tau, 2.5302849011), abs=2e-3)


@given(
    damping=st.floats(0.0, 0.4),
    amplitude=st.floats(0.2, 2.0),
    w=st.floats(0.4, 4.0),
    stop=st.floats(-0.5, 1.0),
    direction=st.sampled_from([1.0, -1.0]),
)
@settings(max_examples=20)
def test_impacts_of_s_graze_next_and_grazes_lead_to_w(
    damping: float, amplitude: float, w: float, stop: float, direction: float
) -> None:
    body = body_of(damping, amplitude, w, stop, direction=direction)
    contact, oscillator = body.contacts[0], Oscillator(1.0, 2.0 * damping, 1.0, amplitude, w)
    found = grazing_sets(body, 8)
    for place, graze in enumerate(found.grazes):
        after, speed = found.after_phase[place], found.after_velocity[place]
        if np.isfinite(speed) and speed > 1e-2:
            start = (contact.position - contact.direction * 1e-13, 0.0)
            met = next_contact(
                oscillator,
                start,
                contact.position,
                200.0,
                phase=float(graze),
                side="upper" if direction > 0.0 else "lower",
            )
            assert met is not None
            # a start next to the stop may count as a contact at once
            if met.time > 1e-3:
                assert met.velocity == pytest.approx(speed, rel=1e-4, abs=1e-5)
                assert math.remainder(graze + w * met.time - after, math.tau) == pytest.approx(0.0, abs=1e-4)
        before, first = found.before_phase[place], found.before_velocity[place]
        if np.isfinite(first) and first > 1e-2:
            # from the impact to the graze: there the body is at the stop without speed
            length = math.remainder(graze - before, math.tau) % math.tau / w
            ends = []
            for turns in range(41):
                state = (contact.position, -direction * contact.restitution * float(first))
                x, v = flow(oscillator, state, length + turns * body.period, phase=float(before))
                ends.append(abs(x - contact.position) + abs(v))
            assert min(ends) < 1e-6 * (1.0 + first)


def test_a_body_that_is_pressed_all_the_time_has_no_grazes() -> None:
    assert grazing_sets(body_of(amplitude=0.1, stop=-2.0), 100).grazes.size == 0


def test_the_nordmark_map_of_the_equation_sheet() -> None:
    family = grazing_family(body_of(0.04, 0.42, 0.8), 0.42)
    assert family.amplitude == pytest.approx(0.292515708979877, rel=1e-14)
    assert family.map.alpha == pytest.approx(0.00918212479, abs=5e-12)
    assert family.map.gamma == pytest.approx(0.53348809109, abs=5e-12)
    assert float(family.rho(np.array([1.01 * family.amplitude]))[0]) == pytest.approx(0.0072775146, abs=5e-11)
    assert family.amplitude_of(family.rho(np.array([0.3])))[0] == pytest.approx(0.3)
    assert family.map.oscillator is not None


def test_the_numbers_of_the_thesis_are_those_of_an_overdamped_oscillator() -> None:
    found = Nordmark(0.65, 0.05).oscillator
    assert found is not None
    ratio, w = found
    family = grazing_family(body_of(ratio, w=w), 0.9)
    assert (family.map.alpha, family.map.gamma) == pytest.approx((0.65, 0.05), rel=1e-12)
    assert Nordmark(1.06, 0.05).oscillator is None
    assert Nordmark(-0.46, 0.05).oscillator is None


def test_a_body_below_its_stop_has_the_same_map() -> None:
    above, below = (grazing_family(body_of(w=0.8, direction=side), 0.9) for side in (1.0, -1.0))
    assert above == below


@given(st.floats(0.01, 3.0), st.floats(0.3, 3.0))
def test_every_oscillator_has_numbers_that_an_oscillator_has(damping: float, w: float) -> None:
    try:
        family = grazing_family(body_of(damping, w=w), 0.9)
    except OrbitError:
        return
    assume(family.map.gamma > 1e-6)
    found = family.map.oscillator
    assert found is not None
    # the fastest such oscillator: others turn more often in a period
    assert found[1] >= w * (1.0 - 1e-6)
    again = grazing_family(body_of(found[0], w=found[1]), 0.9).map
    assert (again.alpha, again.gamma) == pytest.approx(
        (family.map.alpha, family.map.gamma), rel=1e-6, abs=1e-9
    )


@pytest.mark.parametrize(("alpha", "gamma"), [(0.2, 0.3), (-0.9, 0.6), (0.65, 0.05)])
def test_before_the_graze_there_is_one_fixed_point(alpha: float, gamma: float) -> None:
    rho = np.array([-0.1, -0.01, -1e-4])
    states = Nordmark(alpha, gamma, 0.8).diagram(rho, 20)
    expected = np.repeat((rho / (1.0 - alpha + gamma))[:, None], 20, axis=1)
    assert states == pytest.approx(expected, rel=1e-9)


def test_periods_are_added_one_by_one_towards_the_graze() -> None:
    rho = np.linspace(1e-3, 0.1, 3000)
    found = periods_of(Nordmark(0.65, 0.05).diagram(rho, 120))
    # 6 is a multiple of 3, too
    middles = [float(rho[found == period].mean()) for period in (3, 4, 5)]
    assert middles == sorted(middles, reverse=True)
    # the diagram is self-similar with the square of the larger eigenvalue
    larger = 0.5 * (0.65 + math.sqrt(0.65**2 - 4.0 * 0.05))
    assert middles[2] / middles[1] == pytest.approx(larger**2, rel=0.35)


def test_the_square_root_map_of_the_equation_sheet() -> None:
    states = square_root_diagram(0.5, np.array([0.01]), 2, 1)
    start = math.sqrt(0.01)  # from 0
    assert states[0, 0] == pytest.approx(0.5 * start, rel=1e-15)
    assert square_root_diagram(0.5, np.array([-0.1, -1e-3])).max() == 0.0


@pytest.mark.parametrize(("slope", "chaos"), [(0.2, False), (0.5, True), (0.75, True)])
def test_the_three_classes_of_the_square_root_map(slope: float, chaos: bool) -> None:
    offsets = np.geomspace(1e-5, 0.05, 2000)
    found = periods_of(square_root_diagram(slope, offsets, 160))
    shares = {int(period): float((found == period).mean()) for period in np.unique(found)}
    assert (shares.get(0, 0.0) > 0.02) == chaos
    if slope < 2.0 / 3.0:
        assert sum(share for period, share in shares.items() if 0 < period < 12) > 0.5, "windows of periods"
    else:
        assert shares[0] > 0.9, "no windows"


@given(st.floats(0.05, 0.24), st.floats(1e-6, 1e-2))
@settings(max_examples=40)
def test_small_slopes_are_periodic_and_scale_by_their_square(slope: float, offset: float) -> None:
    # one visit below d in each round: x scales with d, and a round is one step longer where d is slope^2 times as large
    pair = square_root_diagram(slope, np.array([offset, offset * slope**2]), 200, 5_000)
    found = periods_of(pair, 1e-7)
    assert (found > 0).all()
    assert 0 <= found[1] - found[0] <= 2


def test_bodies_without_such_maps_are_refused() -> None:
    with pytest.raises(OrbitError, match="a stop that the body at rest does not touch"):
        grazing_family(body_of(stop=-0.1), 0.9)
    damped = math.sqrt(1.0 - 0.04**2)
    with pytest.raises(OrbitError, match="codimension 2"):
        grazing_family(body_of(w=2.0 * damped), 0.9)
    two = body_of()
    two = ImpactingBody(
        two.frequencies, two.damping_ratios, two.force, two.held, 1.2, 0.0, two.contacts * 2, two.observed
    )
    with pytest.raises(OrbitError, match="one mode and one stop, got 1 and 2"):
        grazing_sets(two)
