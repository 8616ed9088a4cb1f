"""The equations of orbits whose period is unknown, of bodies that neither force nor stop drives: equations.md 4.16.

The first impact is at time 0. The unknowns are the logarithm of the period, the phases of the other impacts in it, and
the velocities before all impacts. Velocities are inverse hyperbolic sines: linear when slow, logarithms when fast.
Phases are of the orbit's own period, so that the clock of the body turns with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import OrbitEnd

TURN = 2.0 * np.pi
MOST_SPEED = 1e3
"""Largest speed of an impact, in the size of the motion at its slowest frequency: a faster one counts as unbounded."""
LARGEST_STEP = 0.5
"""Largest change of an unknown in a step of Newton's method: of the period's logarithm, of phases, rad."""


class OwnEquations(NamedTuple):
    """Errors of an orbit of unknown period.

    Attributes
    ----------
    end : OrbitEnd
        The arrays are valid if it is `done`.
    errors : array, shape (2 p,)
        Distances beyond the stops, m, then errors of the speeds over the slowest natural angular frequency, m.
    slopes : array, shape (2 p, 2 p)
        Their derivatives over the unknowns.
    body : ImpactingBody
        The body, with the period as its clock.
    phases, velocities : array, shape (p,)
        rad; m/s.
    """

    end: OrbitEnd
    errors: Floats
    slopes: Floats
    body: ImpactingBody
    phases: Floats
    velocities: Floats


def speed_unit(body: ImpactingBody) -> float:
    """Return the speed, m/s, that the unknowns count in: the size of the motion at its slowest frequency."""
    return body.scale * body.slowest


def is_unbounded(body: ImpactingBody, velocities: Floats) -> bool:
    """Tell whether an impact is faster than the search goes, m/s: the motion grows without bound."""
    return not velocities.max() < MOST_SPEED * speed_unit(body)


def unknowns_of(body: ImpactingBody, phases: Floats, velocities: Floats) -> Floats:
    """Return the unknowns of an orbit, shape (2 p,); the body has the period of the orbit as its clock."""
    period = np.log(TURN * body.slowest / body.angular_frequency)
    return np.concatenate([[period], phases[1:] - phases[0], np.arcsinh(velocities / speed_unit(body))])


def equations(body: ImpactingBody, contacts: NDArray[np.int32], unknowns: Floats) -> OwnEquations:
    """Return the errors of an orbit at the contacts of its impacts, with their derivatives."""
    count, unit = contacts.size, speed_unit(body)
    phases, speeds = np.append(0.0, unknowns[1:count]), unknowns[count:]
    clocked, velocities = body.with_period(float(np.exp(unknowns[0])) / body.slowest), unit * np.sinh(speeds)
    end, errors, slopes = clocked.kernel.errors(contacts, phases, velocities)
    scales = np.repeat([1.0, 1.0 / body.slowest], count)
    own = np.concatenate(
        [slopes[:, -1:], slopes[:, 1:count], slopes[:, count:-1] * (unit * np.cosh(speeds))], axis=1
    )
    return OwnEquations(end, scales * errors, scales[:, None] * own, clocked, phases, velocities)


def alternating_slopes(
    body: ImpactingBody, contacts: NDArray[np.int32], phases: Floats, velocities: Floats
) -> Floats:
    """Return derivatives over changes of phases and velocities that alternate from round to round, shape (2 p, 2 p).

    The body has the period of the orbit as its clock. The period is the mean of both rounds, and does not change.
    """
    count = contacts.size
    twice = np.concatenate([phases, phases + TURN]) / 2.0
    doubled = body.with_period(2.0 * body.period)
    slopes = doubled.kernel.errors(np.tile(contacts, 2), twice, np.tile(velocities, 2))[2][:, :-1]
    # errors of the first round; unknowns by kind, round and impact
    rounds = slopes.reshape(2, 2, count, 2, 2, count)[:, 0]
    own = (rounds[:, :, :, 0] - rounds[:, :, :, 1]).reshape(2 * count, 2 * count)
    scales = np.repeat([1.0, 1.0 / body.slowest], count)
    return np.asarray(scales[:, None] * own * np.repeat([0.5, speed_unit(body)], count))


def shortened(step: Floats, unknowns: Floats, count: int) -> Floats:
    """Return a step of the unknowns, or a part of it that keeps the impacts in their order within the period."""
    phases = np.concatenate([[0.0], unknowns[1:count], [TURN]])
    moved = np.concatenate([[0.0], step[1:count], [0.0]])
    closing = float(np.max(np.diff(moved) / np.diff(phases), initial=0.0))
    largest = float(np.abs(step[:count]).max())
    return step * min(1.0, 0.5 / max(closing, 0.5), LARGEST_STEP / max(largest, LARGEST_STEP))


def free_multipliers(monodromy: Floats, flow: Floats, rate: float) -> tuple[NDArray[np.complex128], float]:
    """Return the multipliers across a motion, and the multiplier 1 of the motion itself.

    Parameters
    ----------
    monodromy : array, shape (2 modes, 2 modes)
        Derivative of the state after an impact by that a period before.
    flow : array, shape (2 modes,)
        Rate of the state after the impact: the monodromy matrix leaves it as it is.
    rate : float
        Angular frequency that makes velocities of displacements, rad/s.
    """
    size = np.repeat([rate, 1.0], flow.size // 2)
    length = np.linalg.norm(size * flow)
    if not length > 0.0:  # a motion that vanishes
        return np.full(flow.size - 1, np.nan + 0j), float("nan")
    along = (size * flow) / length
    basis = np.linalg.qr(np.column_stack([along, np.eye(flow.size)]))[0]
    turned = basis.T @ (size[:, None] * monodromy / size) @ basis
    return np.linalg.eigvals(turned[1:, 1:]).astype(np.complex128), float(turned[0, 0])
