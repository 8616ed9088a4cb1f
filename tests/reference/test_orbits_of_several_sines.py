"""Orbits under several sines of one period, constant forces and moving stops, against solutions in 40 digits."""

from __future__ import annotations

from collections.abc import Sequence

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpc, mpf

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.search import orbits_of

GRAVITY, RATE, RESTITUTION = 9.81, 7.0, 0.5
"""A ball on a shaken table: m/s^2, rad/s, coefficient of restitution."""
ORDERS = 1, 2, 5
EXACT = 1e-13
"""Largest error of phases, over the slope of the distance, and of speeds."""


def ball(gamma: float) -> ImpactingBody:
    """Return a ball on a table that is shaken with the acceleration gamma g."""
    one = np.ones(1)
    table = Contact(one, -1.0, 0.0, RESTITUTION, {1: complex(gamma * GRAVITY / RATE**2)})
    return ImpactingBody(0.0 * one, 0.0 * one, 0.0 * one, -GRAVITY * one, RATE, 0.0, (table,), one)


LEAST = float(np.pi * (1.0 - RESTITUTION) / (1.0 + RESTITUTION))
"""Least acceleration of a table, over g, at which a ball meets it once a period."""
DOUBLING = 1.526823700519060864
"""Acceleration at which this motion doubles its period, from its 2 x 2 matrix in 40 digits."""


def test_a_ball_meets_the_table_once_a_period_above_the_least_acceleration() -> None:
    assert closed_form(ball(LEAST * (1.0 - 1e-9))) == ()
    for gamma in (LEAST * (1.0 + 1e-9), 1.2, 3.0):
        stable, unstable = sorted(closed_form(ball(gamma)), key=lambda each: -each.phases[0])
        for orbit in (stable, unstable):
            assert orbit.velocities[0] == pytest.approx(
                2.0 * np.pi / (1.0 + RESTITUTION) * GRAVITY / RATE, rel=1e-14
            )
            # the table rises with (1 - r) / 2 of the impact's speed
            rising = -gamma * GRAVITY / RATE * np.sin(orbit.phases[0])
            assert rising == pytest.approx(0.25 * orbit.velocities[0], rel=1e-12)
            assert orbit.determinant == pytest.approx(RESTITUTION**2, rel=1e-12)
        assert stable.is_physical
        assert not unstable.is_stable
    (orbit,) = (each for each in closed_form(ball(1.2)) if each.is_stable)
    assert orbit.multipliers[0] == pytest.approx(-0.03423203888828776 + 0.4988267910944146j, abs=1e-13)


def test_a_ball_on_a_table_doubles_its_period_where_its_matrix_says() -> None:
    start = next(each for each in closed_form(ball(1.3)) if each.is_stable)
    branch = Follower(ball, FollowSettings(1.0, 1.6, 0.02)).branch(start, 1.3)
    found = {point.kind: point.at.value for point in branch.points}
    assert found["fold"] == pytest.approx(LEAST, abs=1e-12)
    assert found["period doubling"] == pytest.approx(DOUBLING, abs=1e-11)
    doubled = [each for each in orbits_of(ball(1.55), 2, 2, starts=64) if each.is_stable]
    assert [each.name for each in doubled] == ["P(2,2)"]


NATURAL, RATIOS = (0.7, 1.9, 3.1), (0.05, 1.4, 0.02)
SHAPE, CLOCK, POSITION = (0.8, -0.5, 0.3), 0.9, 0.4
FORCES = (
    (0.4 + 0.1j, -0.6 + 0.3j, 0.2 - 0.9j),
    (0.3 - 0.5j, 0.7 + 0.0j, -0.8 + 0.6j),
    (-0.2 + 0.4j, 0.1 + 0.9j, 0.5 - 0.3j),
)
HELD, MOTION = (0.1, -0.2, 0.15), (0.1 + 0.05j, 0.03 - 0.04j, 0.01 + 0.01j)


def three_modes() -> ImpactingBody:
    """Return a body of three modes under three sines and a constant force, on a stop that moves with three sines."""
    stop = Contact(np.array(SHAPE), 1.0, POSITION, 0.7, dict(zip(ORDERS, MOTION, strict=True)))
    further = {order: np.array(force) for order, force in zip(ORDERS, FORCES, strict=True)}
    natural, ratios, held, shape = (np.array(each) for each in (NATURAL, RATIOS, HELD, SHAPE))
    return ImpactingBody(natural, ratios, np.zeros(3), held, CLOCK, 0.0, (stop,), shape, further=further)


class InFortyDigits:
    """The same body, from the formulas of equations.md 1.2, 1.3 and 4.2 alone."""

    def __init__(self) -> None:
        self.w, self.r = mpf(CLOCK), mpf("0.7")
        self.natural, self.ratios = ([mpf(each) for each in row] for row in (NATURAL, RATIOS))
        self.shape = [mpf(each) for each in SHAPE]
        square = sum(each * each for each in self.shape)
        self.impulse = [each / square for each in self.shape]

    def _sum(self, amplitudes: Sequence[complex], time: mpf, derivative: int) -> mpf:
        return mp.fsum(
            mp.re(mpc(each) * (1j * order * self.w) ** derivative * mp.expj(order * self.w * time))
            for order, each in zip(ORDERS, amplitudes, strict=True)
        )

    def stop(self, time: mpf, derivative: int = 0) -> mpf:
        """Return the position of the stop, or a derivative."""
        return self._sum(MOTION, time, derivative) + (mpf(POSITION) if derivative == 0 else 0)

    def force(self, time: mpf) -> list[mpf]:
        """Return the modal forces."""
        return [
            mpf(HELD[j]) + self._sum([force[j] for force in FORCES], time, 0) for j in range(len(NATURAL))
        ]

    def steady(self, time: mpf, derivative: int) -> list[mpf]:
        """Return the steady modal displacements, or velocities."""
        found = []
        for j, (w, z) in enumerate(zip(self.natural, self.ratios, strict=True)):
            answers = [
                mpc(force[j]) / (w * w - (n * self.w) ** 2 + 2j * z * w * n * self.w)
                for n, force in zip(ORDERS, FORCES, strict=True)
            ]
            level = mpf(HELD[j]) / (w * w) if derivative == 0 else mpf(0)
            found.append(level + self._sum(answers, time, derivative))
        return found

    def propagator(self, u: mpf) -> list[tuple[mpf, mpf, mpf, mpf]]:
        """Return the free propagators of the modes."""
        found = []
        for w, z in zip(self.natural, self.ratios, strict=True):
            root, decay = mp.sqrt(mpc(z * z - 1)) * w, z * w
            c = mp.re(mp.exp(-decay * u) * mp.cosh(root * u))
            s = mp.re(mp.exp(-decay * u) * mp.sinh(root * u) / root)
            found.append((c + decay * s, s, -w * w * s, c - decay * s))
        return found

    def fly(self, state: list[mpf], time: mpf, u: mpf) -> list[mpf]:
        """Return the state after a flight."""
        n = len(NATURAL)
        x = [a - b for a, b in zip(state[:n], self.steady(time, 0), strict=True)]
        v = [a - b for a, b in zip(state[n:], self.steady(time, 1), strict=True)]
        ends = self.steady(time + u, 0) + self.steady(time + u, 1)
        moved = self.propagator(u)
        free = [p[0] * a + p[1] * b for p, a, b in zip(moved, x, v, strict=True)]
        free += [p[2] * a + p[3] * b for p, a, b in zip(moved, x, v, strict=True)]
        return [a + b for a, b in zip(free, ends, strict=True)]

    def gap(self, state: list[mpf], time: mpf, derivative: int) -> mpf:
        """Return the distance beyond the stop, or its rate."""
        n = len(NATURAL)
        row = state[n:] if derivative else state[:n]
        return mp.fsum(a * b for a, b in zip(self.shape, row, strict=True)) - self.stop(time, derivative)

    def struck(self, state: list[mpf], time: mpf) -> list[mpf]:
        """Return the state after an impact."""
        n, speed = len(NATURAL), self.gap(state, time, 1)
        return state[:n] + [
            a - (1 + self.r) * speed * d for a, d in zip(state[n:], self.impulse, strict=True)
        ]

    def orbit(self, periods: int, near: float) -> tuple[mpf, mpf, list[mpf]]:
        """Return phase and speed of the impact, and the state after it, of P(1,q) near a phase."""
        whole = 2 * mp.pi * periods / self.w
        parts = []
        for (a, b, c, e), d in zip(self.propagator(whole), self.impulse, strict=True):
            size = (a - 1) * (e - 1) - b * c
            parts.append((-(1 + self.r) * d * b / size, (1 + self.r) * d * (a - 1) / size))
        alpha = mp.fsum(p * x for p, (x, _) in zip(self.shape, parts, strict=True))
        beta = mp.fsum(p * u for p, (_, u) in zip(self.shape, parts, strict=True)) + 1 + self.r

        def speed(time: mpf) -> mpf:
            steady = mp.fsum(p * v for p, v in zip(self.shape, self.steady(time, 1), strict=True))
            return (steady - self.stop(time, 1)) / (1 - beta)

        def distance(time: mpf) -> mpf:
            steady = mp.fsum(p * x for p, x in zip(self.shape, self.steady(time, 0), strict=True))
            return steady - self.stop(time) + alpha * speed(time)

        time = mpmath.findroot(distance, mpf(near) / self.w)
        v = speed(time)
        after = [x + v * part for x, (part, _) in zip(self.steady(time, 0), parts, strict=True)]
        after += [x + v * part for x, (_, part) in zip(self.steady(time, 1), parts, strict=True)]
        end = self.struck(self.fly(after, time, whole), time + whole)
        assert max(abs(a - b) for a, b in zip(end, after, strict=True)) < mpf(10) ** -35
        return self.w * time, v, after

    def differences(self, periods: int, phase: mpf, after: list[mpf]) -> np.ndarray:
        """Return the monodromy matrix by central differences of the flow over the periods, from mid-flight on."""
        start = phase / self.w
        whole = 2 * mp.pi * periods / self.w
        apart, step = whole / 3, mpf(10) ** -13

        def through(state: list[mpf]) -> list[mpf]:
            """Return the state one train after `start + apart`, with its impact where the distance is 0."""
            begin = start + apart
            u = mpmath.findroot(lambda u: self.gap(self.fly(state, begin, u), begin + u, 0), whole - apart)
            hit = self.struck(self.fly(state, begin, u), begin + u)
            return self.fly(hit, begin + u, whole - u)

        middle = self.fly(after, start, apart)
        columns = []
        for place in range(len(middle)):
            high, low = list(middle), list(middle)
            high[place] += step
            low[place] -= step
            columns.append([(a - b) / (2 * step) for a, b in zip(through(high), through(low), strict=True)])
        return np.array([[float(each) for each in column] for column in columns]).T


@pytest.mark.parametrize("periods", [1, 2])
def test_three_sines_and_a_moving_stop_have_the_orbits_of_forty_digits(periods: int) -> None:
    found = closed_form(three_modes(), periods)
    assert found
    with mp.workdps(40):
        exact = InFortyDigits()
        for orbit in found:
            phase, speed, after = exact.orbit(periods, float(orbit.phases[0]))
            assert abs(float(phase - mpf(orbit.phases[0]))) <= EXACT
            assert abs(float(speed - mpf(orbit.velocities[0]))) <= EXACT
            np.testing.assert_allclose(orbit.states[0], [float(each) for each in after], atol=EXACT)
            if periods == 1:
                matrix = exact.differences(periods, phase, after)
                expected = np.linalg.eigvals(matrix)
                np.testing.assert_allclose(
                    np.poly(orbit.monodromy), np.poly(expected), atol=1e-11 * np.abs(np.poly(expected)).max()
                )
