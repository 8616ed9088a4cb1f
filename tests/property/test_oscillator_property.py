"""Invariants of the oscillator, its stops and its saved states, over random parameters."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from support.component_fmu import LOWER, UPPER, VERSIONS, OscillatorFmu, forced, stop
from support.exact_motion import Oscillator as Exact
from support.exact_motion import exact_flow
from support.tolerance import DIFFERENCES, EPSILON, FLOW, ROUNDING

from vibroimpact.fmus.core import Oscillator, flow, next_contact

FEW = settings(max_examples=60, derandomize=True, suppress_health_check=[HealthCheck.filter_too_much])
FEWER = settings(FEW, max_examples=25)

numbers = st.floats(-2.0, 2.0, allow_subnormal=False)
zetas = st.one_of(st.floats(0.0, 3.0), st.sampled_from([0.0, 1.0, 1.0 - 1e-9, 1.0 + 1e-9, 30.0]))
frequencies = st.one_of(st.floats(0.05, 5.0), st.sampled_from([1.0, 1.0 + 1e-9, 0.0]))
restitutions = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 1.0, 0.999]))
durations = st.floats(0.0, 8.0)


def propagator(zeta: float, u: float) -> np.ndarray:
    body = Oscillator(1.0, 2.0 * zeta, 1.0)
    return np.array([flow(body, start, u) for start in ((1.0, 0.0), (0.0, 1.0))]).T


@FEW
@given(zetas, durations)
def test_the_propagator_shrinks_areas_by_the_damping(zeta: float, u: float) -> None:
    # det Phi = exp(-2 zeta u); the two products of the determinant may cancel
    matrix = propagator(zeta, u)
    size = abs(matrix[0, 0] * matrix[1, 1]) + abs(matrix[0, 1] * matrix[1, 0])
    # two exponentials close to each other (zeta near 1) lose no digits either
    assert abs(np.linalg.det(matrix) - math.exp(-2.0 * zeta * u)) <= FLOW * (size + 1.0)


@FEW
@given(zetas, durations, durations)
def test_flights_in_a_row_are_one_flight(zeta: float, a: float, b: float) -> None:
    product = propagator(zeta, b) @ propagator(zeta, a)
    assert np.abs(product - propagator(zeta, a + b)).max() <= FLOW * (1.0 + a + b)


@FEW
@given(zetas, frequencies, numbers, numbers, durations, durations)
def test_a_driven_flight_in_two_parts_is_one_flight(
    zeta: float, w: float, x: float, v: float, a: float, b: float
) -> None:
    body = Oscillator(1.0, 2.0 * zeta, 1.0, 0.7, w)
    middle = flow(body, (x, v), a, phase=0.3)
    for one, two in zip(
        flow(body, (x, v), a + b, phase=0.3), flow(body, middle, b, phase=0.3 + w * a), strict=True
    ):
        assert abs(one - two) <= FLOW * (1.0 + w) * (4.0 + a + b)


@FEW
@given(numbers, numbers, durations, frequencies)
def test_without_damping_time_runs_backwards_as_well(x: float, v: float, u: float, w: float) -> None:
    body = Oscillator(1.0, 0.0, 1.0, 0.7, w)
    forth = flow(body, (x, v), u, phase=0.4)
    # the mirror in time of cos(w t + .4) after u is cos(w t - (w u + .4))
    back = flow(body, (forth[0], -forth[1]), u, phase=-(w * u + 0.4))
    assert abs(back[0] - x) <= FLOW * (4.0 + u) * (1.0 + w)
    assert abs(back[1] + v) <= FLOW * (4.0 + u) * (1.0 + w)


@FEW
@given(
    st.floats(0.01, 0.9), st.floats(0.4, 3.0), st.floats(0.05, 1.0), st.floats(0.2, 2.0), st.floats(0.0, 6.0)
)
def test_the_impact_map_changes_areas_as_restitution_damping_and_velocity_say(
    zeta: float, w: float, r: float, v: float, time: float
) -> None:
    # equations.md 4.1: det J = r^2 H^2 v_i / v_{i+1}, J by central differences
    body, position = Oscillator(1.0, 2.0 * zeta, 1.0, 0.9, w), 0.3

    def image(t: float, velocity: float) -> np.ndarray:
        contact = next_contact(body, (position, -r * velocity), position, 30.0, phase=w * t)
        assume(contact is not None)
        assert contact is not None
        return np.array([t + contact.time, contact.velocity])

    centre, h = image(time, v), 1e-6
    flight = centre[0] - time
    # near a graze the map has a root: differences of 1e-6 are linear only far from it
    assume(centre[1] > 0.2)
    assume(flight > 0.05)
    columns = [
        (image(time + dt, v + dv) - image(time - dt, v - dv)) / (2.0 * h) for dt, dv in ((h, 0.0), (0.0, h))
    ]
    # another branch of the map (with a graze in between) within the differences
    assume(np.abs(np.array(columns)).max() < 50.0)
    expected = r * r * math.exp(-2.0 * zeta * flight) * v / centre[1]
    assert abs(np.linalg.det(np.array(columns).T) - expected) <= 100 * DIFFERENCES


@FEWER
@given(
    zetas, st.floats(0.2, 3.0), restitutions, numbers, st.floats(-1.5, -0.01), st.sampled_from([UPPER, LOWER])
)
def test_a_body_is_never_beyond_its_stop_and_never_gains_energy_from_it(
    zeta: float, w: float, r: float, position: float, behind: float, side: int
) -> None:
    sign = 1.0 if side == UPPER else -1.0
    parameters = forced(1.2, w, zeta, displacement_start=position + sign * behind)
    switches = {"record.impacts": True, "record.extrema": True, "impact_limit": 1_000_000}
    with OscillatorFmu({**parameters, **stop(position, r, side=side), **switches}, early_return=True) as o:
        before = 0.0
        for i in range(1, 80):
            o.advance(0.25 * i)
            x, _ = o.state()
            assert sign * (position - x) >= 0.0
            extreme = o.get("record.displacement_max" if sign > 0 else "record.displacement_min")
            assert sign * (position - extreme) >= 0.0
            rows = o.rows()
            impacts = rows[rows[:, 0] == 1.0]
            # impulse = m (1 + r) V with 0 <= r <= 1 takes (1 - r^2) V^2 / 2 >= 0
            assert np.all(impacts[:, 4] >= impacts[:, 3] * (1.0 - ROUNDING))
            assert np.all(impacts[:, 4] <= 2.0 * impacts[:, 3] * (1.0 + ROUNDING))
            assert np.all(np.diff(impacts[:, 1]) >= 0.0)
            assert np.all(impacts[:, 1] >= before - 1e-12)
            before = 0.25 * i


@FEWER
@given(restitutions, st.floats(-1.0, 1.0), st.floats(0.01, 3.0))
def test_without_a_force_energy_only_falls_and_by_the_impacts_alone(
    r: float, position: float, start: float
) -> None:
    parameters = {"displacement_start": position - start, **stop(position, r), "record.impacts": True}
    with OscillatorFmu(parameters, early_return=True) as o:
        first = energy = 0.5 * (position - start) ** 2
        for i in range(1, 40):
            o.advance(0.5 * i)
            rows = o.rows()
            lost = float(np.sum(0.5 * (1.0 - rows[:, 6] ** 2) * rows[:, 3] ** 2 * (rows[:, 0] == 1.0)))
            now = o.get("energy.kinetic") + o.get("energy.potential")
            # the summed tail of a chatter starts at 1e-4 of its fastest impact and loses that energy at once
            assert abs(energy - lost - now) <= 1e-8 * first + 100 * ROUNDING * (energy + now) + EPSILON
            assert now <= energy * (1.0 + 100 * ROUNDING) + EPSILON
            energy = now


@pytest.mark.parametrize("impacts", [pytest.param(1_000_000, marks=pytest.mark.long), 30_000])
def test_an_elastic_stop_conserves_energy_over_its_impacts(impacts: int) -> None:
    for position in (-0.4, 0.0, 0.6):
        with OscillatorFmu({"displacement_start": -1.0, **stop(position, 1.0)}) as o:
            o.step(7.0 * impacts)
            energy = o.get("energy.kinetic") + o.get("energy.potential")
            assert o.contact("count")[0] > impacts
            # rounding adds up like a random walk, or at worst in one direction
            assert abs(energy / 0.5 - 1.0) <= impacts * EPSILON


@FEW
@given(
    st.floats(0.0, 1.5),
    st.floats(0.1, 4.0),
    numbers,
    st.floats(-1.5, 0.0),
    st.floats(-2.0, 2.0),
    st.floats(0.0, 6.2),
)
def test_a_certified_search_never_passes_a_contact(
    zeta: float, w: float, position: float, behind: float, velocity: float, phase: float
) -> None:
    body = (1.0, 2.0 * zeta, 1.0, 0.9, w)
    assume(behind < -1e-6 or abs(velocity) > 1e-12)  # at rest on the stop up to rounding, it stays or leaves
    state, horizon = (position + behind, velocity), 12.0
    contact = next_contact(Oscillator(*body), state, position, horizon, phase=phase)
    end = horizon if contact is None else contact.time
    # no earlier instant lies beyond the stop, on a fine grid ...
    for u in np.linspace(0.0, end, 1500)[1:-1]:
        assert flow(Oscillator(*body), state, u, phase=phase)[0] <= position + FLOW * 4.0
    if contact is not None and contact.velocity > 1e-3:
        # ... and in 40 digits the motion is on the stop there
        x, v = exact_flow(Exact(*body), state, contact.time, phase)
        assert abs(float(x) - position) <= 4 * FLOW + EPSILON * contact.time * float(abs(v))
        assert abs(float(v) - contact.velocity) <= 20 * FLOW * (1.0 + w)


situations = st.sampled_from(
    [
        {**forced(), **stop(1.0)},
        {
            **forced(1.0, 0.2, 0.05, displacement_start=-0.1),
            **stop(0.0),
        },  # chatters until 2.5, sticks until 7.85
        {**forced(0.9, 0.8, 0.02), **stop(0.3, 0.9), **stop(-0.4, 0.5, side=LOWER, k=2)},
        {"force": 0.5, "stiffness": 0.0, "displacement_start": -1.0, **stop(0.0, 0.8)},
    ]
)


@FEW
@given(
    situations,
    st.floats(0.01, 12.0),
    st.lists(st.floats(0.001, 3.0), min_size=1, max_size=5),
    st.sampled_from(VERSIONS),
)
def test_a_state_saved_at_any_time_goes_on_bit_for_bit_also_in_another_instance(
    parameters: dict[str, float], time: float, steps: list[float], version: str
) -> None:
    with OscillatorFmu(parameters, version=version) as one, OscillatorFmu(version=version) as other:
        one.step(time)
        saved, begin = one.serialized(), one.time

        def go_on(o: OscillatorFmu) -> bytes:
            o.time = begin
            for size in steps:
                o.step(size)
            return o.serialized()

        first = go_on(one)
        one.restore(saved)
        assert one.serialized() == saved
        assert go_on(one) == first
        other.restore(saved)
        assert go_on(other) == first


def test_a_state_saved_in_mid_chatter_and_in_mid_stick_goes_on_bit_for_bit() -> None:
    parameters = {**forced(1.0, 0.2, 0.05, displacement_start=-0.1), **stop(0.0)}
    for time, stuck in ((2.5, False), (2.5098, False), (2.51, True), (5.0, True), (7.8539816, True)):
        with OscillatorFmu(parameters) as o:
            o.step(time)
            assert bool(o.contact("stuck")[0]) == stuck or abs(time - 2.5098) < 1e-3
            saved = o.serialized()
            o.step(30.0)
            end = o.serialized()
            o.restore(saved)
            o.time = time
            o.step(30.0)
            assert o.serialized() == end
