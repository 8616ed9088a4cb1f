"""Orbits on a spring with a dashpot that never pull, against 40 digits: equations.md 6.9, 4.18."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf

from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form
from vibroimpact.fmus.bodies.impacting_body import Press

RATIO, FORCE, STOP = 0.05, 0.5, 0.8
Pair = tuple[mpf, mpf]


def oscillator(w: float, stiffness: float, damping: float) -> ImpactingBody:
    """Return an oscillator of mass and natural frequency 1 below a stop that yields."""
    one, press = np.ones(1), Press("kelvin_voigt", stiffness, damping)
    stop = Contact(one, 1.0, STOP, 0.0, press=press)
    return ImpactingBody(one, RATIO * one, FORCE * one, 0.0 * one, w, 0.0, (stop,), one)


def motion(stiffness: mpf, damping: mpf, held: mpf, w: mpf, t: mpf, start: Pair) -> Callable[[mpf], Pair]:
    """Return x and x' after a time, of x'' + damping x' + stiffness x = F cos w t + held, from the time t on."""
    decay, answer = damping / 2, mpf(FORCE) / mp.mpc(stiffness - w**2, damping * w)
    rate = mp.sqrt(stiffness - decay**2)

    def steady(time: mpf) -> Pair:
        turned = answer * mp.expj(w * time)
        return mp.re(turned) + held / stiffness, mp.re(1j * w * turned)

    x0, v0 = (a - b for a, b in zip(start, steady(t), strict=True))

    def at(u: mpf) -> Pair:
        left, c, s = mp.exp(-decay * u), mp.cos(rate * u), mp.sin(rate * u) / rate
        x = left * ((c + decay * s) * x0 + s * v0)
        v = left * (-stiffness * s * x0 + (c - decay * s) * v0)
        return x + steady(t + u)[0], v + steady(t + u)[1]

    return at


def contact_map(orbit: PeriodicOrbit) -> Callable[[mpf, mpf], Pair]:
    """Return the map (t, V) -> (t, V) from the beginning of a contact to that of the next."""
    w, press = mpf(orbit.body.angular_frequency), orbit.body.contacts[0].press
    assert press is not None
    k, c, stop = mpf(press.stiffness), mpf(press.damping), mpf(STOP)
    period = 2 * mp.pi / w

    def following(t: mpf, v: mpf) -> Pair:
        pressed = motion(1 + k, 2 * mpf(RATIO) + c, k * stop, w, t, (stop, v))
        force = lambda u: k * (pressed(u)[0] - stop) + c * pressed(u)[1]  # noqa: E731
        left = mpmath.findroot(force, mpf(orbit.durations[0]))
        away = motion(mpf(1), 2 * mpf(RATIO), mpf(0), w, t + left, pressed(left))
        flight = mpmath.findroot(lambda u: away(u)[0] - stop, period - left)
        return t + left + flight, away(flight)[1]

    return following


@pytest.mark.parametrize(
    ("w", "stiffness", "damping", "error"),
    [
        (1.2, 50.0, 1.0, 2e-14),
        (0.9, 50.0, 0.0, 2e-14),
        (1.1, 2.0, 0.5, 2e-14),
        # a stiff stop multiplies the rounding of displacements
        (1.3, 1e6, 300.0, 4e-13),
    ],
)
def test_orbits_and_multipliers_are_those_of_forty_digits(
    w: float, stiffness: float, damping: float, error: float
) -> None:
    found = closed_form(oscillator(w, stiffness, damping))
    assert found
    with mp.workdps(40):
        for orbit in found:
            following, period = contact_map(orbit), 2 * mp.pi / mpf(w)

            def off(
                t: mpf, v: mpf, after: Callable[[mpf, mpf], Pair] = following, turn: mpf = period
            ) -> Pair:
                end, fast = after(t, v)
                return end - t - turn, fast - v

            t, v = mpmath.findroot(off, (mpf(orbit.phases[0]) / mpf(w), mpf(orbit.velocities[0])))
            size = 1.0 + abs(orbit.multipliers[0])
            assert abs(float(t * mpf(w) - mpf(orbit.phases[0]))) < error * size
            assert abs(float(v - mpf(orbit.velocities[0]))) < error * size
            step = mpf(10) ** -15
            columns = []
            for dt, dv in ((step, 0), (0, step)):
                ends = [following(t + sign * dt, v + sign * dv) for sign in (1, -1)]
                columns.append([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
            derivative = np.poly(np.array(columns).T)
            # the monodromy matrix is the derivative of the contact map in other coordinates
            atol = 50.0 * error * np.abs(derivative).max()
            np.testing.assert_allclose(np.poly(orbit.monodromy), derivative, atol=atol)
            assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-12)
