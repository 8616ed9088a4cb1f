"""Exact integrals over a flight of a forced mode, at any damping, also at resonance: equations.md 5.5.

Both integrands are quadratic in (w q, q', f cos, f sin), which evolves by a constant matrix. So an integral over a
flight is a quadratic form of its start. Over a step that is short against every rate it is a power series P. Over two
equal steps it is P + E' P E, with the flow E of the first step. The motion is not sampled, and no division by a
difference of rates occurs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHORT = 0.25
"""Largest rate times length for which a step is a power series."""
TERMS = 20
"""Terms of the power series; the last is (2 SHORT)^20 / 20!, far below rounding."""
_SPEED, _COSINE = 1, 2


class FlightWork(NamedTuple):
    """State and integrals of a mode over a flight."""

    end: Floats
    """w q and q' at its end, m/s kg^(1/2), shape (..., 2)."""
    forcing: Floats
    """Integral of f cos(phase) q', J, shape (...)."""
    squared: Floats
    """Integral of q'^2, J s, shape (...)."""
    damping: Floats
    """Loss to damping, J, shape (...): the integral of q' times the damping force on the mode."""


def flight_work(
    natural: Floats, damping_ratio: Floats, angular_frequency: float, lengths: Floats, start: Floats
) -> FlightWork:
    """Return the end of flights of modes, and the integrals over them, of shape (flights, modes).

    Natural angular frequencies (rad/s) and damping ratios have shape (modes,), lengths (s) shape (flights,). The
    angular frequency of the force is in rad/s. The start has w q, q', f cos(phase), f sin(phase) of each mode,
    shape (flights, modes, 4); f is the modal amplitude of the force.

    A free undamped mode has the mean q'^2 of a cosine over whole periods:

    >>> start = np.array([[[1.0, 0.0, 0.0, 0.0]]])
    >>> done = flight_work(np.array([1.0]), np.array([0.0]), 1.0, np.array([2.0 * np.pi]), start)
    >>> round(float(done.squared[0, 0] / np.pi), 12), bool(np.allclose(done.end, [1.0, 0.0]))
    (1.0, True)
    """
    shape = np.broadcast_shapes((lengths.size, 1), natural.shape)
    u = np.broadcast_to(lengths[:, None], shape).ravel()
    w, z = (np.broadcast_to(each, shape).ravel() for each in (natural, damping_ratio))
    rate = np.maximum(w * (1.0 + 2.0 * z), angular_frequency)
    # a length of zero, between two contacts at one instant, needs no step
    halvings = np.ceil(np.log2(np.maximum(rate * u / SHORT, 1.0))).astype(np.int64)
    matrix = _matrix(w, z, angular_frequency) * np.ldexp(u, -halvings)[:, None, None]
    moved, forms = _series(matrix, np.ldexp(u, -halvings))
    for step in range(int(halvings.max(initial=0))):
        on = halvings > step
        change = moved[on]
        flow = np.eye(4) + change
        # the change of the state is kept instead of the state: next to 1 its digits would be lost
        moved[on] = 2.0 * change + change @ change
        forms[:, on] += np.swapaxes(flow, -1, -2) @ forms[:, on] @ flow
    state = start.reshape(-1, 4)
    end = state + np.einsum("nij,nj->ni", moved, state)
    forcing, squared = np.einsum("ni,knij,nj->kn", state, forms, state)
    damping = 2.0 * damping_ratio * natural * squared.reshape(shape)
    return FlightWork(end[:, :2].reshape(*shape, 2), forcing.reshape(shape), squared.reshape(shape), damping)


def coupled_flight_work(
    natural: Floats, coupling: Floats, angular_frequency: float, lengths: Floats, start: Floats
) -> FlightWork:
    """Return the same for modes that the damping couples, from the integral M of z z' over each flight.

    The state z has w q of all modes, q' of all modes, cos(phase) and sin(phase), and obeys z' = A z. Over a short step
    M is a power series. Over two equal steps it is M + E M E', with the flow E of the first step. The damping between
    the modes (1/s) has shape (modes, modes); other arguments are those of `flight_work`.

    >>> start = np.array([[[1.0, 0.0, 0.0, 0.0]]])
    >>> done = coupled_flight_work(np.array([1.0]), np.array([[0.0]]), 1.0, np.array([2.0 * np.pi]), start)
    >>> round(float(done.squared[0, 0] / np.pi), 12), bool(np.allclose(done.end, [1.0, 0.0]))
    (1.0, True)
    """
    flights = [
        _coupled_flight(natural, coupling, angular_frequency, float(u), each)
        for u, each in zip(lengths, start, strict=True)
    ]
    return FlightWork(*(np.array(column) for column in zip(*flights, strict=True)))


def _coupled_flight(
    natural: Floats, coupling: Floats, angular_frequency: float, length: float, start: Floats
) -> FlightWork:
    """Return one flight, with arrays of shape (mode,)."""
    count = natural.size
    matrix = np.zeros((2 * count + 2, 2 * count + 2))
    moving = slice(count, 2 * count)
    matrix[:count, moving], matrix[moving, :count] = np.diag(natural), -np.diag(natural)
    matrix[moving, moving] = -coupling
    # the last two are cos and sin of the phase since the impact, times 1 N kg^(-1/2)
    matrix[moving, -2], matrix[moving, -1] = start[:, 2], -start[:, 3]
    matrix[-2, -1], matrix[-1, -2] = -angular_frequency, angular_frequency
    begin = np.concatenate([start[:, 0], start[:, 1], [1.0, 0.0]])
    rate = float(np.abs(matrix[: 2 * count, : 2 * count]).sum(axis=1).max())
    halvings = math.ceil(math.log2(max(max(rate, angular_frequency) * length / SHORT, 1.0)))
    step = math.ldexp(length, -halvings)
    moved, term = np.zeros_like(matrix), np.eye(len(matrix))
    derivative = np.outer(begin, begin)
    form = np.zeros_like(matrix)
    for order in range(1, TERMS + 1):
        term = step * (term @ matrix) / order
        moved += term
        form += step * derivative / order
        turned = step * (matrix @ derivative)
        derivative = (turned + turned.T) / order
    for _ in range(halvings):
        flow = np.eye(len(matrix)) + moved
        form += flow @ form @ flow.T
        moved = 2.0 * moved + moved @ moved
    end = begin + moved @ begin
    squares = form[moving, moving]
    forcing = start[:, 2] * form[-2, moving] - start[:, 3] * form[-1, moving]
    damping = (coupling * squares).sum(axis=1)
    return FlightWork(np.stack([end[:count], end[moving]], axis=1), forcing, np.diag(squares).copy(), damping)


def _matrix(w: Floats, z: Floats, angular_frequency: float) -> Floats:
    made = np.zeros((w.size, 4, 4))
    made[:, 0, 1] = w
    made[:, 1, 0], made[:, 1, 1], made[:, 1, 2] = -w, -2.0 * z * w, 1.0
    made[:, 2, 3], made[:, 3, 2] = -angular_frequency, angular_frequency
    return made


def _series(matrix: Floats, length: Floats) -> tuple[Floats, Floats]:
    """Return exp(matrix) - 1 and the forms of both integrals over a short step."""
    count = matrix.shape[0]
    moved, term = np.zeros_like(matrix), np.broadcast_to(np.eye(4), matrix.shape)
    derivative = np.zeros((2, count, 4, 4))
    derivative[0, :, _SPEED, _COSINE] = derivative[0, :, _COSINE, _SPEED] = 0.5
    derivative[1, :, _SPEED, _SPEED] = 1.0
    forms = np.zeros_like(derivative)
    for order in range(1, TERMS + 1):
        term = term @ matrix / order
        moved += term
        forms += derivative / order
        derivative = (np.swapaxes(matrix, -1, -2) @ derivative + derivative @ matrix) / order
    return moved, forms * length[:, None, None]
