"""Motions that grow, against closed forms: equations.md 1.9."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpmath import mp, mpf
from support.structure import DONE, IMPACT_LIMIT, UNBOUNDED, Modes, Stop, Structure

EPSILON = float(np.finfo(np.float64).eps)
STOPS = [Stop([1.0], 1.0), Stop([1.0], -1.0, side="lower")]


@pytest.mark.parametrize("speed", [1.0 + 1e-9, 1.1, 2.0, 50.0])
def test_an_elastic_pendulum_between_stops_keeps_its_period(speed: float) -> None:
    # x = -cosh t + V sinh t from stop to stop: half a period is 2 artanh(1 / V), for V > 1
    with Structure(Modes([-1.0]), STOPS, [-1.0], [speed]) as body:
        assert body.advance(1e9, most_impacts=2000) == IMPACT_LIMIT
        times, speeds = body.impacts[:, 1], body.impacts[:, 3]
    half = float(2 * mp.atanh(1 / mpf(speed)))
    # the time over the top, where a speed of sqrt(V^2 - 1) is left, multiplies an error of the speed
    slack = 1e-14 / (speed**2 - 1.0) + EPSILON * times[-1]
    assert np.abs(np.diff(times) - half).max() <= slack
    assert np.abs(speeds / speed - 1.0).max() <= 1e-14


@pytest.mark.parametrize("speed", [0.2, 0.9, 1.0 - 1e-9])
def test_a_slow_pendulum_stays_on_its_side(speed: float) -> None:
    # x = cosh t - V sinh t turns back at sqrt(1 - V^2): the flight takes 2 artanh V
    with Structure(Modes([-1.0]), STOPS, [1.0], [-speed]) as body:
        assert body.advance(1e9, most_impacts=50) == IMPACT_LIMIT
        times, contacts = body.impacts[:, 1], body.impacts[:, 5]
    assert set(contacts) == {1.0}
    slack = 1e-14 / (1.0 - speed**2) + EPSILON * times[-1]
    assert np.abs(np.diff(times) - float(2 * mp.atanh(mpf(speed)))).max() <= slack


def symmetric_orbit(force: float, w: float, r: float) -> tuple[float, float]:
    """Return phase and speed V of x'' - x = force cos(w t) that flies from -1 to 1 in half a period, by Newton."""
    with mp.workdps(40):
        half, amplitude = mp.pi / mpf(w), -mpf(force) / (1 + mpf(w) ** 2)

        def ends(phase: mpf, speed: mpf) -> tuple[mpf, mpf]:
            x, v = -1 - amplitude * mp.cos(phase), r * speed + amplitude * w * mp.sin(phase)
            c, s = mp.cosh(half), mp.sinh(half)
            at, going = x * c + v * s, x * s + v * c
            return (
                at - amplitude * mp.cos(phase) - 1,
                going + amplitude * w * mp.sin(phase) - speed,
            )

        phase, speed = mp.findroot(ends, (mpf("2.5"), mpf("2.5")))
        return float(phase), float(speed)


def test_a_forced_pendulum_meets_both_stops_once_a_period() -> None:
    force, w, r = 3.0, 1.3, 0.6
    phase, speed = symmetric_orbit(force, w, r)
    stops = [Stop([1.0], 1.0, restitution=r), Stop([1.0], -1.0, side="lower", restitution=r)]
    with Structure(Modes([-1.0], 0.0, [force], w, phase), stops, [-1.0], [r * speed]) as body:
        assert body.advance(1e9, most_impacts=4) == IMPACT_LIMIT
        rows = body.impacts
    assert np.abs(rows[:, 1] - math.pi / w * np.arange(1, 5)).max() <= 1e-9
    assert np.abs(rows[:, 3] / speed - 1.0).max() <= 1e-9


def test_a_self_excited_oscillator_between_stops_settles_on_its_limit_cycle() -> None:
    # half a cycle: from -1 with speed r V to 1 with speed V; V by the 40-digit flow
    ratio, r = 0.05, 0.9
    stops = [Stop([1.0], 1.0, restitution=r), Stop([1.0], -1.0, side="lower", restitution=r)]
    with Structure(Modes([1.0], -ratio), stops, [0.1], [0.0]) as body:
        assert body.advance(1e9, most_impacts=3000) == IMPACT_LIMIT
        rows = body.impacts
    with mp.workdps(40):
        d, w = mpf(ratio), mp.sqrt(1 - mpf(ratio) ** 2)

        def ends(time: mpf, speed: mpf) -> tuple[mpf, mpf]:
            grown, c, s = mp.exp(d * time), mp.cos(w * time), mp.sin(w * time) / w
            x, v = mpf(-1), mpf(r) * speed
            return grown * ((c - d * s) * x + s * v) - 1, grown * (-s * x + (c + d * s) * v) - speed

        time, speed = mp.findroot(ends, (mpf("1.2"), mpf(float(rows[-1, 3]))))
    assert abs(rows[-1, 1] - rows[-2, 1] - float(time)) <= 1e-11
    assert abs(rows[-1, 3] / float(speed) - 1.0) <= 1e-12


def test_a_buckled_body_rests_on_the_stop_that_it_falls_on() -> None:
    with Structure(Modes([-2.0], 0.1), [Stop([1.0], 1.0, restitution=0.5)], [1e-3], [0.0]) as body:
        assert body.advance(100.0) == DONE
        assert body.statuses == ("held",)
        assert body.forces[0] == pytest.approx(4.0, rel=1e-14)  # w^2 times 1 m pushes it on


def test_a_motion_away_from_its_only_stop_is_unbounded_at_once() -> None:
    stop = Stop([1.0], 1.0, restitution=0.9)
    with Structure(Modes([-1.0]), [stop], [0.5], [1.2], ends_unbounded=True) as body:
        assert body.advance(100.0) == UNBOUNDED
        rows = body.impacts
        # it leaves with 0.9 V > 1, which carries it over the top
        assert len(rows) == 1
        assert body.time == rows[0, 1]


def test_a_motion_without_a_stop_ends_at_its_limit() -> None:
    with Structure(Modes([-1.0]), [], [1.0], [0.0], observed=[1.0], displacement_limit=1e9) as body:
        assert body.advance(1e4) == UNBOUNDED
        assert body.time == pytest.approx(float(mp.acosh(mpf(10) ** 9)), rel=1e-15)


def test_a_motion_without_a_limit_goes_on_until_numbers_end() -> None:
    with Structure(Modes([-1.0]), [], [1.0], [0.0], observed=[1.0]) as body:
        assert body.advance(300.0) == DONE
        assert body.displacement[0] == pytest.approx(math.cosh(300.0), rel=1e-13)


def test_a_stop_that_forcing_may_bring_back_ends_nothing() -> None:
    # the force pushes it over the top again and again: the motion is bounded for ever
    stops = [Stop([1.0], 1.0, restitution=0.6), Stop([1.0], -1.0, side="lower", restitution=0.6)]
    with Structure(Modes([-1.0], 0.0, [3.0], 1.3), stops, [0.0], [0.0], ends_unbounded=True) as body:
        assert body.advance(1e9, most_impacts=20000) == IMPACT_LIMIT


def test_damping_that_couples_modes_may_give_energy() -> None:
    coupling = [[-0.1, 0.3], [0.3, -0.2]]
    with Structure(
        Modes([1.0, 2.0], coupling=coupling), [], [1.0, 0.0], observed=[1.0, 1.0], displacement_limit=1e6
    ) as body:
        assert body.advance(1e4) == UNBOUNDED
        assert abs(body.displacement.sum()) == pytest.approx(1e6, rel=1e-12)
