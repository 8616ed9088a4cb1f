"""Flights of bodies whose modes grow, against 40-digit flows: random stiffness and damping of any sign.

Each flight is checked on its own, from the state in which it began: growth would multiply the rounding of all before.
The clearance at its end has its error; a grid of the same flow shows that no contact was missed.
"""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.exact_motion import Oscillator, exact_flow
from support.structure import DONE, IMPACT_LIMIT, UNBOUNDED, Modes, Stop, Structure

FEW = settings(max_examples=40, derandomize=True, suppress_health_check=list(HealthCheck))
#: Error of a clearance at a contact, over the displacements that add up there.
RESIDUAL = 1e-14
#: Penetration of a stop between two contacts, likewise.
PENETRATION = 1e-9
#: Error of the energy balance over the energy that has been turned over.
BALANCE = 1e-9
MOST_FLIGHTS, GRID = 4, 8
#: Displacement at which a motion ends, m.
LIMIT = 1e6

Array = np.ndarray


@st.composite
def growing_modes(draw: st.DrawFn) -> Modes:
    """Draw one to four modes of which the first, at least, has a negative stiffness or damping."""
    kinds = st.sampled_from(("spring", "dashpot", "both", "neither", "tiny"))
    found = []
    for kind in [draw(kinds.filter(lambda kind: kind != "neither")), *draw(st.lists(kinds, max_size=3))]:
        w, ratio = draw(st.floats(0.3, 8.0)), draw(st.sampled_from([0.0, 0.02, 0.4, 1.0, 1.0 + 1e-9, 3.0]))
        w = -w if kind in ("spring", "both") else w
        if kind == "tiny":
            w, ratio = draw(st.sampled_from([-1e-9, -1e-4, 1e-6])), draw(st.sampled_from([0.0, -0.5]))
        found.append((w, -ratio if kind in ("dashpot", "both") else ratio))
    natural, ratios = zip(*sorted(found), strict=True)
    count = len(found)
    if not draw(st.booleans()):
        return Modes(natural, ratios)
    force = draw(st.lists(st.floats(-1.0, 1.0), min_size=count, max_size=count))
    return Modes(natural, ratios, force, draw(st.floats(0.3, 5.0)), draw(st.floats(-3.0, 3.0)))


@st.composite
def growing_bodies(draw: st.DrawFn) -> tuple[Modes, list[Stop], Array, Array]:
    """Draw a body that grows, one to three rigid stops, and a start on their free sides."""
    modes = draw(growing_modes())
    count = len(modes.natural)
    vector = st.lists(st.floats(-1.0, 1.0), min_size=count, max_size=count).map(np.array)
    q, p, stops = draw(vector), 2.0 * draw(vector), []
    for _ in range(draw(st.integers(1, 3))):
        shape = draw(vector)
        shape[draw(st.integers(0, count - 1))] += 1.5
        side, gap = draw(st.sampled_from(["upper", "lower"])), draw(st.floats(0.05, 1.0))
        position = float(shape @ q) + (gap if side == "upper" else -gap)
        restitution = draw(st.sampled_from([1.0, 0.9, 0.5, 0.0]))
        stops.append(Stop(shape, position, side=side, restitution=restitution))
    return modes, stops, q, p


def flow(modes: Modes, q: Array, p: Array, time: float, u: float) -> list[mpf]:
    """Return the modal displacements `u` after `time` in 40 digits."""
    force = np.broadcast_to(np.asarray(modes.force, dtype=np.float64), q.shape)
    found = []
    for j, (w, ratio) in enumerate(zip(modes.natural, modes.damping_ratio, strict=True)):
        one = Oscillator(1.0, 2.0 * ratio * abs(w), w * abs(w), float(force[j]), modes.angular_frequency)
        with mp.workdps(40):
            phase = mpf(modes.angular_frequency) * mpf(time) + mpf(modes.phase)
        found.append(exact_flow(one, (q[j], p[j]), u, phase)[0])
    return found


def clearance(stop: Stop, q: list[mpf]) -> tuple[mpf, float]:
    """Return the clearance of a stop, m, and the sizes of the displacements that add up there."""
    terms = [mpf(float(a)) * x for a, x in zip(np.asarray(stop.shape), q, strict=True)]
    sign = 1 if stop.side == "upper" else -1
    return sign * (mpf(stop.position) - sum(terms)), abs(stop.position) + sum(abs(float(x)) for x in terms)


def energy(modes: Modes, body: Structure) -> float:
    w = np.asarray(modes.natural)
    return float(0.5 * (body.velocity @ body.velocity + (w * np.abs(w)) @ body.displacement**2))


def turned_over(modes: Modes, body: Structure) -> float:
    w = np.asarray(modes.natural)
    here = 0.5 * (body.velocity @ body.velocity + w**2 @ body.displacement**2)
    return float(here + abs(body.forcing_work) + abs(body.damping_loss) + abs(body.contact_loss))


@FEW
@given(growing_bodies())
def test_each_flight_is_exact_and_misses_no_contact(given: tuple[Modes, list[Stop], Array, Array]) -> None:
    modes, stops, q, p = given
    with Structure(modes, stops, q, p, displacement_limit=LIMIT) as body:
        for _ in range(MOST_FLIGHTS):
            before, speed, time, resting = body.displacement, body.velocity, body.time, body.statuses
            ended = body.advance(3.0, most_impacts=1)
            if ended == UNBOUNDED or "held" in (*resting, *body.statuses) or body.time - time < 1e-6:
                break
            if ended == IMPACT_LIMIT:
                row = body.impacts[-1]
                found, size = clearance(
                    stops[int(row[5]) - 1], flow(modes, before, speed, time, row[1] - time)
                )
                reach = float(np.abs(np.asarray(stops[int(row[5]) - 1].shape)) @ np.abs(before))
                assert abs(found) <= RESIDUAL * (size + reach + abs(row[3]) * row[1])
            for u in np.linspace(0.0, body.time - time, GRID)[1:-1]:
                at = flow(modes, before, speed, time, u)
                for stop in stops:
                    room, size = clearance(stop, at)
                    assert room > -PENETRATION * size


@FEW
@given(growing_bodies())
def test_energies_balance(given: tuple[Modes, list[Stop], Array, Array]) -> None:
    modes, stops, q, p = given
    with Structure(modes, stops, q, p, energies=True, displacement_limit=LIMIT) as body:
        start, most = energy(modes, body), 0.0
        for _ in range(4):
            ended = body.advance(0.7, most_impacts=500)
            most = max(most, turned_over(modes, body))
            gained = body.forcing_work - body.damping_loss - body.contact_loss
            assert abs(energy(modes, body) - start - gained) <= BALANCE * most
            if ended == UNBOUNDED:
                break


@FEW
@given(growing_bodies(), st.integers(2, 7))
def test_the_time_of_an_unbounded_motion_does_not_depend_on_steps(
    given: tuple[Modes, list[Stop], Array, Array], steps: int
) -> None:
    modes, stops, q, p = given
    ends = []
    for count in (1, steps):
        with Structure(modes, stops[:1], q, p, displacement_limit=1e3, ends_unbounded=True) as body:
            for _ in range(count):
                ended = body.advance(20.0 / count, most_impacts=20)
                if ended != DONE:
                    break
            ends.append((ended, body.time, len(body.impacts)))
    (one, first, impacts), (other, second, more) = ends
    assert one == other
    assert impacts == more or one == IMPACT_LIMIT
    assert abs(first - second) <= 1e-6 * (1.0 + first)
