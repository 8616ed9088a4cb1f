"""The flow of a linear system with constant coefficients, its samples at equal steps, and zeros of linear functions."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats

STEP = 0.4
"""Length of a step times the fastest rate: the power series over a step then ends below rounding."""
ORDER = 17
"""Order of the power series over a step."""
ORDERS = np.arange(ORDER + 1.0)
BISECTIONS = 80
"""Largest number of steps of the search for a zero within a step."""


class LinearFlow:
    """The flow of y' = matrix y: equations.md 4.18.

    Parameters
    ----------
    matrix : array, shape (n, n)
        1/s.
    rate : float
        Bound of the rates of its motions, 1/s.
    """

    def __init__(self, matrix: Floats, rate: float) -> None:
        self.matrix = matrix
        self.rate = rate
        self.step = STEP / rate
        self._powers: list[Floats] = []

    def reversed(self) -> LinearFlow:
        """Return the flow backwards in time."""
        return LinearFlow(-self.matrix, self.rate)

    @cached_property
    def _terms(self) -> Floats:
        """Terms of the power series of the flow over a step, each as a row of a matrix, shape (order + 1, n n)."""
        terms = [np.eye(self.matrix.shape[0])]
        for order in range(1, ORDER + 1):
            terms.append(terms[-1] @ self.matrix * (self.step / order))
        return np.array(terms).reshape(ORDER + 1, -1)

    def _series(self, time: float) -> Floats:
        """Return the flow over a time within a step, by its power series."""
        return ((time / self.step) ** ORDERS @ self._terms).reshape(self.matrix.shape)

    def over(self, time: float) -> Floats:
        """Return the flow over a time, s, shape (n, n)."""
        steps = int(time / self.step)
        found = self._series(time - steps * self.step)
        for bit in range(steps.bit_length()):
            if steps >> bit & 1:
                found = self._power(bit) @ found
        return found

    @property
    def one_step(self) -> Floats:
        """The flow over one step."""
        return self._power(0)

    def _power(self, bit: int) -> Floats:
        """Return the flow over 2^bit steps."""
        while len(self._powers) <= bit:
            last = self._powers[-1] if self._powers else None
            self._powers.append(self._series(self.step) if last is None else last @ last)
        return self._powers[bit]

    def samples(self, state: Floats, bit: int) -> Floats:
        """Return the states after 0 to 2^bit - 1 steps, shape (n, 2^bit)."""
        found = state[:, None]
        for each in range(bit):
            found = np.hstack([found, self._power(each) @ found])
        return found

    def along(self, state: Floats, times: Floats) -> Floats:
        """Return the states after times of at least 0, shape (n, times)."""
        steps = (times / self.step).astype(np.int64)
        bit = int(steps.max(initial=0)).bit_length()
        found = self.samples(state, bit)[:, steps]
        part = (times - steps * self.step) / self.step
        if not part.any():
            return found
        terms = (self._terms.reshape(-1, state.size) @ found).reshape(ORDER + 1, state.size, times.size)
        return np.asarray((terms * (part ** ORDERS[:, None])[:, None, :]).sum(axis=0))

    def polynomial(self, rows: Floats, state: Floats) -> Floats:
        """Return the power series in time of linear functions along the flow, the lowest order first.

        Parameters
        ----------
        rows : array, shape (m, n)
        state : array, shape (n,)

        Returns
        -------
        array, shape (order + 1, m)
            Valid over a step.
        """
        terms = (self._terms.reshape(-1, state.size) @ state).reshape(ORDER + 1, -1)
        return np.asarray((terms @ rows.T) / self.step ** ORDERS[:, None])


def value_of(series: Floats, time: float) -> float:
    """Return the value of a polynomial, the lowest order first."""
    value = 0.0
    for coefficient in series[::-1].tolist():
        value = value * time + coefficient
    return value


def zero_of(series: Floats, low: float, high: float) -> float:
    """Return the zero of a polynomial between two times at which its signs differ: Newton's method within bisection."""
    coefficients = series[::-1].tolist()
    first, last = value_of(series, low), value_of(series, high)
    time = low + (high - low) * abs(first) / (abs(first) + abs(last)) if first != last else low
    for _ in range(BISECTIONS):
        value = slope = 0.0
        for coefficient in coefficients:
            slope = slope * time + value
            value = value * time + coefficient
        low, high = (time, high) if (value > 0.0) == (first > 0.0) else (low, time)
        tried = time - value / slope if slope != 0.0 else low
        after = tried if low <= tried <= high else 0.5 * (low + high)
        if abs(after - time) <= 2.0 * np.finfo(float).eps * high:
            return after
        time = after
    return time
