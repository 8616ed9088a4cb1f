"""Orbits on a stop whose restitution falls with speed, against 40 digits and the engine: equations.md 4.2, 4.3."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf

import vibroimpact as vi
from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY
from vibroimpact.analysis.orbits.following import Follower, FollowSettings

RATIO, FORCE, STOP, RESTITUTION = 0.05, 0.5, 0.8, 0.8
Pair = tuple[mpf, mpf]


def oscillator(w: float, yield_velocity: float) -> ImpactingBody:
    """Return an oscillator of mass and natural frequency 1."""
    one = np.ones(1)
    stop = Contact(one, 1.0, STOP, RESTITUTION, yield_velocity=yield_velocity)
    return ImpactingBody(one, RATIO * one, FORCE * one, 0.0 * one, w, 0.0, (stop,), one)


def impact_map(w: float, yield_velocity: float) -> Callable[[mpf, mpf, mpf], Pair]:
    """Return the map (t, V) -> (t, V) at the next impact near a given time, in 40 digits: equations.md 1.2, 1.3."""
    z, falls = mpf(RATIO), mpf(yield_velocity)
    rate = mp.sqrt(1 - z * z)
    answer = mpf(FORCE) / mp.mpc(1 - mpf(w) ** 2, 2 * z * mpf(w))

    def steady(t: mpf) -> Pair:
        turned = answer * mp.expj(mpf(w) * t)
        return mp.re(turned), mp.re(1j * mpf(w) * turned)

    def following(t: mpf, v: mpf, near: mpf) -> Pair:
        r = mpf(RESTITUTION) * min(mpf(1), (v / falls) ** (-mpf(1) / 4))
        x0, v0 = (a - b for a, b in zip((mpf(STOP), -r * v), steady(t), strict=True))

        def at(end: mpf) -> Pair:
            u = end - t
            left, c, s = mp.exp(-z * u), mp.cos(rate * u), mp.sin(rate * u) / rate
            x = left * ((c + z * s) * x0 + s * v0)
            fast = left * (-s * x0 + (c - z * s) * v0)
            return x + steady(end)[0], fast + steady(end)[1]

        end = mpmath.findroot(lambda each: at(each)[0] - mpf(STOP), near)
        return end, at(end)[1]

    return following


def in_forty_digits(orbit: PeriodicOrbit, yield_velocity: float) -> tuple[Pair, np.ndarray]:
    """Return time and speed of the impact of P(1,1) near an orbit, and the derivative of the impact map."""
    w = orbit.body.angular_frequency
    following, period = impact_map(w, yield_velocity), 2 * mp.pi / mpf(w)
    start = mpf(orbit.phases[0]) / mpf(w), mpf(orbit.velocities[0])

    def off(t: mpf, v: mpf) -> Pair:
        end, fast = following(t, v, start[0] + period)
        return end - t - period, fast - v

    found = mpmath.findroot(off, start)
    t, v, step = found[0], found[1], mpf(10) ** -15
    columns = []
    for dt, dv in ((step, 0), (0, step)):
        ends = [following(t + sign * dt, v + sign * dv, t + period) for sign in (1, -1)]
        columns.append([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
    return (t * mpf(w), v), np.array(columns).T


@pytest.mark.parametrize(("w", "yield_velocity"), [(1.0, 0.1), (0.6, 0.01), (1.4, 0.5)])
def test_orbits_and_multipliers_are_those_of_forty_digits(w: float, yield_velocity: float) -> None:
    found = closed_form(oscillator(w, yield_velocity))
    assert found
    with mp.workdps(40):
        for orbit in found:
            (phase, speed), derivative = in_forty_digits(orbit, yield_velocity)
            size = 1.0 + abs(orbit.multipliers[0])
            assert abs(float(phase - mpf(orbit.phases[0]))) < 1e-14 * size
            assert abs(float(speed - mpf(orbit.velocities[0]))) < 1e-14 * size
            # the monodromy matrix is the derivative of the impact map in other coordinates
            np.testing.assert_allclose(
                np.poly(orbit.monodromy), np.poly(derivative), atol=1e-12 * np.abs(np.poly(derivative)).max()
            )
            assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-12)


def scene(w: float = 1.0, yield_velocity: float = 0.1) -> dict[str, Any]:
    """Return the same oscillator as a scene."""
    return {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": RATIO},
        "forcing": {"amplitude": FORCE, "angular_frequency": w},
        "stop": [{"position": STOP, "restitution": RESTITUTION, "yield_velocity": yield_velocity}],
        "record": {"transient_periods": 200, "recorded_periods": 300, "impacts": True},
    }


def test_a_long_run_ends_on_the_orbit_and_its_exponents_are_the_logarithms_of_the_multipliers() -> None:
    (orbit,) = vi.find_orbits(scene(), 1)
    run = vi.run(scene())
    assert run.vibroimpact.impacts().impact_velocity.values[-1] == pytest.approx(
        orbit.velocities[0], rel=1e-13
    )
    found = vi.lyapunov(run)
    np.testing.assert_allclose(found.lyapunov_exponent, np.log(np.abs(orbit.multipliers)), atol=1e-6)
    assert float(found.lyapunov_exponent.sum()) == pytest.approx(np.log(orbit.exact_determinant), rel=1e-12)


def test_multipliers_are_those_of_differences_of_the_engine() -> None:
    (orbit,) = vi.find_orbits(scene(), 1)
    phase, speed, step = float(orbit.phases[0]), float(orbit.velocities[0]), 1e-6
    contact = orbit.body.contacts[0]

    def following(dt: float, dv: float) -> np.ndarray:
        """Return time and speed of the next impact of the engine, after an impact of a changed time and speed."""
        left = -float(contact.restitution_at(speed + dv)) * (speed + dv)
        changed = scene() | {"record": {"recorded_periods": 2, "impacts": True}}
        changed["body"] = changed["body"] | {"displacement_start": STOP, "velocity_start": left}
        changed["forcing"] = changed["forcing"] | {"phase": phase + dt}
        rows = vi.run(changed).vibroimpact.impacts()
        return np.array([dt + float(rows.impact_time[0]), float(rows.impact_velocity[0])])

    columns = [(following(*(step * e)) - following(*(-step * e))) / (2.0 * step) for e in np.eye(2)]
    np.testing.assert_allclose(np.poly(np.array(columns).T), np.poly(orbit.monodromy), atol=1e-6)


def test_branches_over_the_yield_velocity_and_the_frequency_are_orbits_of_the_closed_form() -> None:
    bodies = (partial(oscillator, 1.0), 0.01, 3.0), (partial(oscillator, yield_velocity=0.1), 0.8, 1.2)
    for body_at, low, high in bodies:
        value = 0.5 * (low + high)
        start = closed_form(body_at(value))[0]
        branch = Follower(body_at, FollowSettings(low, high, 0.1)).branch(start, value)
        assert branch.ends == ["end of the range"] * 2
        assert {point.kind for point in branch.points} <= {AT_YIELD_VELOCITY}
        # the orbit at a corner stands for each side by a speed that is off by SAME_SPEED
        corners = {each.at.value for each in branch.points}
        for each in [each for each in branch.orbits[::8] if each.value not in corners]:
            (orbit,) = closed_form(each.orbit.body)
            assert each.orbit.velocities[0] == pytest.approx(orbit.velocities[0], rel=1e-12)
    # above its own speed the yield velocity changes nothing
    assert closed_form(oscillator(1.0, 3.0))[0].velocities == closed_form(oscillator(1.0, 0.0))[0].velocities


def test_followed_impacts_have_the_restitution_of_their_speed() -> None:
    found = vi.follow(scene(), "stop[1].yield_velocity", 0.05, 0.2, step=0.2, doublings=0)
    speed, falls = found["impact_velocity"].values, found["yield_velocity"].values
    kept = RESTITUTION * (speed / falls) ** -0.25
    assert speed.size > 4
    np.testing.assert_allclose(found["impact_restitution"].values, kept, rtol=1e-14)
    np.testing.assert_allclose(found["impact_impulse"].values, (1.0 + kept) * speed, rtol=1e-14)


def test_branches_pass_the_corner_at_the_yield_velocity_on_their_way_to_the_graze() -> None:
    grazes = []
    for falls in (0.1, 0.5):
        follower = Follower(partial(oscillator, yield_velocity=falls), FollowSettings(1.2, 2.2, 0.2))
        branch = follower.branch(closed_form(oscillator(1.25, falls))[0], 1.25)
        assert branch.ends == ["end of the range", "graze"]
        assert any(each.orbit.falling[0] for each in branch.orbits)
        assert not branch.orbits[-1].orbit.falling[0]
        grazes.append(next(point.at.value for point in branch.points if point.kind == "graze"))
    # the free oscillator reaches the stop there, whatever the law of the stop
    w = grazes[0]
    assert FORCE / np.hypot(1.0 - w * w, 2.0 * RATIO * w) == pytest.approx(STOP, rel=1e-11)
    assert grazes[1] == pytest.approx(w, abs=1e-11)


def test_slow_impacts_keep_the_orbits_of_a_constant_restitution() -> None:
    for falls in (2.0, 1e300):
        for one, other in zip(
            closed_form(oscillator(1.1, falls)), closed_form(oscillator(1.1, 0.0)), strict=True
        ):
            assert abs(one.phases[0] - other.phases[0]) < 1e-14
            np.testing.assert_allclose(one.monodromy, other.monodromy, atol=1e-13)


def test_the_restitution_of_an_ever_smaller_yield_velocity_is_0() -> None:
    (plastic,) = closed_form(oscillator(1.0, 1e-308))
    one = np.ones(1)
    dead = Contact(one, 1.0, STOP, 0.0)
    (expected,) = closed_form(ImpactingBody(one, RATIO * one, FORCE * one, 0.0 * one, 1.0, 0.0, (dead,), one))
    assert plastic.velocities[0] == pytest.approx(expected.velocities[0], rel=1e-12)
