"""Orbits of random bodies under several sines, on moving stops of falling restitution, against matrix exponentials."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.orbit_flow import Flow

from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form
from vibroimpact.analysis.orbits.search import orbits_of

FEW = settings(max_examples=40, derandomize=True, deadline=None)
TURN = 2.0 * np.pi
CLOSED = 1e-10
"""Largest difference of a state after the periods of its orbit, over the size of the motion."""
some = st.floats(-1.0, 1.0)


@st.composite
def bodies(draw: st.DrawFn) -> ImpactingBody:
    """Draw 1 to 6 modes under 2 to 5 sines, on one or two stops; dashpots may couple them, one may have no spring."""
    modes = draw(st.integers(1, 6))
    natural = np.array(sorted(draw(st.floats(0.4, 4.0)) for _ in range(modes)))
    ratios = np.array([draw(st.one_of(st.floats(0.01, 0.2), st.floats(0.9, 2.0))) for _ in natural])
    loose = draw(st.sampled_from([0, 0, 1]))  # modes without a spring
    natural[:loose] = ratios[:loose] = 0.0
    coupling = None
    if draw(st.booleans()):
        rows = np.array([[draw(some) for _ in natural] for _ in range(modes + 1)])
        coupling = 0.3 * rows.T @ rows + 0.02 * np.eye(modes)
        coupling[:loose] = coupling[:, :loose] = 0.0
        ratios = coupling.diagonal() / (2.0 * np.where(natural > 0.0, natural, 1.0))
    orders = sorted(draw(st.sets(st.integers(1, 9), min_size=2, max_size=5)))
    further = {
        order: np.array([complex(draw(some), draw(some)) for _ in natural]) for order in orders if order > 1
    }
    contacts = []
    for _ in range(draw(st.integers(1, 2))):
        shape = np.array([draw(st.floats(0.2, 1.0)) * draw(st.sampled_from([-1.0, 1.0])) for _ in natural])
        motion = {order: 0.2 * complex(draw(some), draw(some)) for order in orders if draw(st.booleans())}
        position, restitution = draw(st.floats(-0.2, 1.0)), draw(st.floats(0.1, 0.95))
        side = draw(st.sampled_from([-1.0, 1.0]))
        falls_above = draw(st.one_of(st.just(0.0), st.floats(1e-3, 1.0)))
        contacts.append(Contact(shape, side, side * position, restitution, motion, falls_above))
    force, held = (np.array([draw(some) for _ in natural]) for _ in range(2))
    w = draw(st.floats(0.3, 2.0))
    return ImpactingBody(
        natural, ratios, force, 0.3 * held, w, 0.0, tuple(contacts), contacts[0].shape, coupling, further
    )


def assert_closed(orbit: PeriodicOrbit) -> None:
    """Assert that each impact of an orbit leads to the next one, by another flow."""
    flow, whole = Flow(orbit.body), TURN * orbit.periods
    ends = np.append(orbit.phases[1:], orbit.phases[0] + whole)
    for place, (start, end) in enumerate(zip(orbit.phases, ends, strict=True)):
        following = (place + 1) % orbit.phases.size
        contact = int(orbit.contacts[following])
        state, u = orbit.states[place], (end - start) / orbit.body.angular_frequency
        arrived = flow.fly(state, start, u)
        size = 1.0 + np.abs(state).max() + np.abs(arrived).max()
        assert abs(flow.gap(contact, arrived, end, 0)) <= CLOSED * size
        assert abs(flow.gap(contact, arrived, end, 1) - orbit.velocities[following]) <= CLOSED * size
        np.testing.assert_allclose(
            flow.struck(contact, arrived, end), orbit.states[following], atol=CLOSED * size
        )


@FEW
@given(bodies(), st.integers(1, 3))
def test_all_orbits_of_one_impact_are_closed_and_none_is_missed(body: ImpactingBody, periods: int) -> None:
    for contact in range(len(body.contacts)):
        found = closed_form(body, periods, contact)
        for orbit in found:
            assert_closed(orbit)
        phases = np.linspace(0.0, TURN, 721)
        hit = np.array([contact], dtype=np.int32)
        seen = [body.kernel.evaluate(hit, phases[k : k + 1], periods) for k in range(phases.size)]
        distances = np.array([each.distances[0] for each in seen])
        speeds = np.array([each.velocities[0] for each in seen])
        crossings = np.flatnonzero(distances[:-1] * distances[1:] < 0.0)
        for place in crossings[(speeds[crossings] > 0.0) & (speeds[crossings + 1] > 0.0)]:
            near = np.mod(np.array([each.phases[0] for each in found]) - phases[place] + 1e-9, TURN)
            assert (near <= phases[1] + 2e-9).any(), phases[place]


@settings(FEW, max_examples=20)
@given(bodies(), st.sampled_from([(2, 1), (2, 2), (3, 1)]))
def test_orbits_of_several_impacts_are_closed(body: ImpactingBody, counts: tuple[int, int]) -> None:
    for orbit in orbits_of(body, *counts, starts=12, penetrating=True):
        if np.diff(np.append(orbit.phases, orbit.phases[0] + TURN * counts[1])).min() > 1e-3:
            assert_closed(orbit)


@settings(FEW, max_examples=10)
@given(bodies())
def test_multipliers_are_those_of_differences_of_another_flow(body: ImpactingBody) -> None:
    orbits = [
        each for each in closed_form(body) if each.velocities[0] > 0.1 * body.scale * body.angular_frequency
    ]
    assume(orbits)
    assume(abs(orbits[0].multipliers[0]) < 30.0)  # differences lose as many digits
    orbit, flow, period = orbits[0], Flow(body), body.period
    start, step = float(orbit.phases[0]), 1e-6
    apart = 0.4 * period

    def through(state: np.ndarray) -> np.ndarray:
        """Return the state a period later; the impact is searched near the orbit's own."""
        begin = start + body.angular_frequency * apart
        u = period - apart
        for _ in range(20):
            at, phase = flow.fly(state, begin, u), begin + body.angular_frequency * u
            u -= flow.gap(0, at, phase, 0) / flow.gap(0, at, phase, 1)
        at, phase = flow.fly(state, begin, u), begin + body.angular_frequency * u
        return flow.fly(flow.struck(0, at, phase), phase, period - u)

    middle = flow.fly(orbit.states[0], start, apart)
    columns = []
    for place in range(middle.size):
        moved = np.zeros(middle.size)
        moved[place] = step
        columns.append((through(middle + moved) - through(middle - moved)) / (2.0 * step))
    expected = np.poly(np.array(columns).T)
    np.testing.assert_allclose(np.poly(orbit.monodromy), expected, atol=1e-4 * np.abs(expected).max())
    exact = orbit.exact_determinant
    assert abs(orbit.determinant - exact) <= 1e-12 * np.prod(np.linalg.norm(orbit.monodromy, axis=1))
