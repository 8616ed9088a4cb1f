"""Motion of a structure by all its degrees of freedom, on one compliant stop: the trapezoidal rule at a small step.

The reference of reduced structures. Its error falls with the square of the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.orchestrator.structures.matrices import Matrices


def tip_motion(
    matrices: Matrices,
    point: Floats,
    force: tuple[float, float],
    stop: tuple[float, float],
    viscosity: float,
    end: float,
    steps: int,
) -> Floats:
    """Return the displacements of a point at equal steps from rest, shape (steps + 1,).

    Parameters
    ----------
    matrices : Matrices
    point : ndarray, shape (freedom,)
        The point, which the force and the stop act on.
    force : tuple of float
        Amplitude, N, and angular frequency, rad/s, of a force A cos(w t).
    stop : tuple of float
        Position, m, and stiffness, N/m, of a stop above the point.
    viscosity : float
        Damping over stiffness, C = viscosity K, s.
    end : float
        Time of the last step, s.
    """
    stiffness, mass = matrices.stiffness, matrices.mass
    step = end / steps
    half = 0.5 * step
    damping = viscosity * stiffness
    factors: Any = splu((mass + half * damping + half**2 * stiffness).tocsc())
    answer = factors.solve(point) * half**2  # displacement for a force of 1 N at the end of a step
    (amplitude, angular), (position, contact) = force, stop
    displacement, velocity = np.zeros(len(point)), np.zeros(len(point))
    acceleration = splu(mass.tocsc()).solve(point) * amplitude
    gain, found = float(point @ answer), np.zeros(steps + 1)
    for number in range(1, steps + 1):
        ahead = displacement + step * velocity + half**2 * acceleration
        faster = velocity + half * acceleration
        load = amplitude * np.cos(angular * number * step)
        free = factors.solve(point * load - damping @ faster - stiffness @ ahead)
        # the contact's force at the end of the step is that of its own displacement
        reached = float(point @ (ahead + half**2 * free))
        push = max(contact * (reached - position) / (1.0 + contact * gain), 0.0)
        acceleration = free - push * answer / half**2
        displacement = ahead + half**2 * acceleration
        velocity = faster + half * acceleration
        found[number] = point @ displacement
    return found
