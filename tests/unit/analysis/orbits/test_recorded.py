"""The orbit next to recorded impacts, separated from transients, from its halves, and from motion without a period."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import (
    Contact,
    ImpactingBody,
    OrbitError,
    PeriodicOrbit,
    closed_form,
    find_orbit,
)
from vibroimpact.analysis.orbits.recorded import Impacts, recorded_orbit

TURN = 2.0 * np.pi


def oscillator(force: float, rate: float) -> ImpactingBody:
    one = np.ones(1)
    return ImpactingBody(
        one, 0.04 * one, force * one, 0.0 * one, rate, 0.0, (Contact(one, 1.0, 0.8, 0.75),), one
    )


def recorded(orbit: PeriodicOrbit, rounds: int, begin: float = 1000.0) -> Impacts:
    """Return the impacts that a run records of an orbit: phases within a turn, velocities, and times from `begin`."""
    phases = (orbit.phases + TURN * orbit.periods * np.arange(rounds)[:, None]).ravel()
    times = begin + phases / orbit.body.angular_frequency
    contacts = np.tile(orbit.contacts, rounds).astype(np.int64)
    return Impacts(times, np.mod(phases, TURN), np.tile(orbit.velocities, rounds), contacts)


def test_impacts_of_one_a_period_are_p_1_1_though_rounded() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    found = recorded_orbit(orbit.body, recorded(orbit, 8))
    assert found.orbit.name == "P(1,1)"
    assert found.distance < 1e-14


def test_a_transient_that_alternates_is_told_and_is_no_orbit_of_twice_the_period() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    impacts = recorded(orbit, 8)
    wobble = 1e-4 * (-0.9) ** np.arange(8)
    found = recorded_orbit(orbit.body, impacts._replace(velocities=impacts.velocities * (1.0 + wobble)))
    assert found.orbit.name == "P(1,1)"
    assert found.distance == pytest.approx(1e-4 * 0.9**7, rel=1e-3)


def test_a_slow_transient_whose_halves_differ_more_than_rounds_do_goes_to_the_shorter_orbit() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    impacts = recorded(orbit, 16)
    wobble = 2e-3 * (-0.99) ** np.arange(16)
    found = recorded_orbit(orbit.body, impacts._replace(velocities=impacts.velocities * (1.0 + wobble)))
    assert found.orbit.name == "P(1,1)"
    assert found.distance == pytest.approx(2e-3, rel=0.2)


def test_the_halves_of_an_orbit_next_to_its_doubling_are_not_taken_for_one() -> None:
    orbit = find_orbit(oscillator(0.44, 0.88), 0.88 * np.array([0.59544845, 6.86299676]), None, 2)
    found = recorded_orbit(orbit.body, recorded(orbit, 4))
    assert found.orbit.name == "P(2,2)"
    # the last round may begin with either impact
    odd = recorded(orbit, 5)
    shifted = Impacts(*(column[1:] for column in odd[:4]))
    assert recorded_orbit(orbit.body, shifted).orbit.name == "P(2,2)"


def test_what_does_not_repeat_is_refused_in_words() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    impacts = recorded(orbit, 9)
    chaos = impacts._replace(velocities=np.random.default_rng(1).uniform(0.1, 1.0, 9))
    with pytest.raises(
        OrbitError, match="not periodic: 9 recorded impacts do not repeat within half of them"
    ):
        recorded_orbit(orbit.body, chaos)
    with pytest.raises(OrbitError, match="not periodic: 1 recorded"):
        recorded_orbit(orbit.body, recorded(orbit, 1))
    with pytest.raises(OrbitError, match="no impacts"):
        recorded_orbit(orbit.body, Impacts(*(column[:0] for column in impacts[:4])))


def test_impacts_of_another_body_have_no_orbit_next_to_them() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    with pytest.raises(OrbitError, match=r"no orbit P\(1,1\) of this body next to the recorded impacts"):
        recorded_orbit(oscillator(0.47, 1.1), recorded(orbit, 8))
