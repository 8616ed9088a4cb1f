"""Impacts of linear bodies in 40 digits, on a rigid or a Kelvin-Voigt stop: flights and contacts by their own modes.

The secant method finds the time of each event in any number of digits, starting from the time in a run. So the
reference checks the numbers of a run, not the list of its impacts. No eigenvalue may be double.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mpmath as mp

DIGITS = 70
"""Working digits: 40 are left where a stop is grazed."""


@dataclass(frozen=True)
class ExactBody:
    """Modal equations q'' + damping q' + natural^2 q = force cos(angular_frequency t), one row for each mode.

    Attributes
    ----------
    natural, damping, force : sequence of mpf
    shape : sequence of mpf
        Shape of the observed point in front of the stop: its displacement is shape . q.
    angular_frequency : float
    start : sequence of mpf
        Modal displacements, then modal velocities.
    """

    natural: Sequence[mp.mpf]
    damping: Sequence[mp.mpf]
    force: Sequence[mp.mpf]
    shape: Sequence[mp.mpf]
    angular_frequency: float
    start: Sequence[mp.mpf]


@dataclass(frozen=True)
class ExactStop:
    """An upper stop: rigid where its stiffness is 0."""

    position: float
    restitution: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


class _Piece:
    """A linear equation of motion, solved: state' = matrix state + constant + Re(force exp(i w t))."""

    def __init__(self, matrix: mp.matrix, constant: mp.matrix, force: mp.matrix, w: mp.mpf) -> None:
        self._rates, self._vectors = mp.eig(matrix)
        self._inverse = self._vectors**-1
        self._rest = -mp.lu_solve(matrix, constant)
        self._steady = mp.lu_solve(1j * w * mp.eye(matrix.rows) - matrix, force)
        self._w = w

    def _forced(self, time: mp.mpf) -> mp.matrix:
        wave = self._steady * mp.expj(self._w * time)
        return self._rest + wave.apply(mp.re)

    def flow(self, state: mp.matrix, start: mp.mpf, time: mp.mpf) -> mp.matrix:
        """Return the state at `time` from the state at `start`."""
        free = self._inverse * (state - self._forced(start))
        grown = mp.matrix([mp.exp(a * (time - start)) * x for a, x in zip(self._rates, free, strict=True)])
        return self._forced(time) + (self._vectors * grown).apply(mp.re)


class ExactMotion:
    """A body with a stop, followed from time 0."""

    def __init__(self, body: ExactBody, stop: ExactStop) -> None:
        with mp.workdps(DIGITS):
            n, self._stop = len(body.natural), stop
            self._shape, self._position = mp.matrix(body.shape).T, mp.mpf(stop.position)
            w = mp.mpf(body.angular_frequency)
            free = mp.zeros(2 * n)
            for j in range(n):
                free[j, n + j] = mp.mpf(1)
                free[n + j, j] = -(mp.mpf(body.natural[j]) ** 2)
                free[n + j, n + j] = -mp.mpf(body.damping[j])
            force, push = mp.zeros(2 * n, 1), mp.zeros(2 * n, 1)
            for j in range(n):
                force[n + j], push[n + j] = mp.mpf(body.force[j]), mp.mpf(body.shape[j])
            gap, rate = self._row(0, n), self._row(n, n)
            k, c = mp.mpf(stop.stiffness), mp.mpf(stop.damping)
            self._gap, self._rate, self._pressing = gap, rate, k * gap + c * rate
            self._free = _Piece(free, mp.zeros(2 * n, 1), force, w)
            if k:
                self._pressed = _Piece(free - push * self._pressing, push * k * self._position, force, w)
            self._push = push
            self.time, self.state = mp.mpf(0), mp.matrix(body.start)

    def _row(self, first: int, n: int) -> mp.matrix:
        row = mp.zeros(1, 2 * n)
        for j in range(n):
            row[first + j] = self._shape[j]
        return row

    def hit(self, near: float, duration: float = 0.0) -> tuple[mp.mpf, mp.mpf]:
        """Advance past the impact closest to a time; return time and velocity of this impact.

        Parameters
        ----------
        near : float
            Time of the impact in a run, s.
        duration : float
            Duration of the contact in that run, for a compliant stop, s.
        """
        with mp.workdps(DIGITS):
            self._go_on(self._free, lambda x: (self._gap * x)[0] - self._position, near)
            time, velocity = self.time, (self._rate * self.state)[0]
            if self._stop.stiffness:
                k = mp.mpf(self._stop.stiffness)
                self._go_on(
                    self._pressed,
                    lambda x: (self._pressing * x)[0] - k * self._position,
                    float(time) + duration,
                )
            else:
                mobility = (self._rate * self._push)[0]
                self.state -= self._push * ((1 + mp.mpf(self._stop.restitution)) * velocity / mobility)
            return time, velocity

    def at(self, time: float) -> tuple[mp.mpf, mp.mpf]:
        """Return displacement and velocity of the point in front of the stop; no impact may lie in between."""
        with mp.workdps(DIGITS):
            state = self._free.flow(self.state, self.time, mp.mpf(time))
            return (self._gap * state)[0], (self._rate * state)[0]

    def _go_on(self, piece: _Piece, quantity: Callable[[mp.matrix], mp.mpf], near: float) -> None:
        """Advance to the zero of a quantity of the state."""
        start, state = self.time, self.state

        def at(time: mp.mpf) -> mp.mpf:
            return quantity(piece.flow(state, start, time))

        guess = mp.mpf(near)
        apart = mp.mpf(10) ** -12 * (guess - start)
        self.time = mp.findroot(at, (guess, guess + apart), tol=mp.mpf(10) ** (-2 * 45), maxsteps=60)
        self.state = piece.flow(state, start, self.time)
