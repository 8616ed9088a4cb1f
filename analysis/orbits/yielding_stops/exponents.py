"""The stretching of small changes by contacts with stops that yield: equations.md 4.11, 4.18."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.recorded import Impacts
from vibroimpact.analysis.orbits.yielding_stops.motion import yielding_motion
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

ARRIVES = 1e-6
"""Distance of a computed contact from the recorded one, over the size of the motion, above which one is missing."""


class YieldingStretching:
    """Directions carried along a motion of one mode from contact to contact, and their stretching.

    The state before each contact is known: the point is at its stop with the recorded speed.

    Parameters
    ----------
    body : ImpactingBody
        Of one mode.
    impacts : Impacts
        All contacts, in their order: none may be missing.
    """

    def __init__(self, body: ImpactingBody, impacts: Impacts) -> None:
        self._motion, self._impacts = yielding_motion(body), impacts
        self._directions = np.eye(2)
        self.shrinking = np.zeros(impacts.times.size)
        """Logarithm of the determinant from the contact before, known from its duration alone."""

    def along(self, first: int, last: int) -> Floats:
        """Continue along contacts `first` to `last` - 1; return the logarithms of the stretching of each direction.

        OrbitError: a recorded contact does not follow from the one before.
        """
        stretch = np.zeros(2)
        for k in range(first, last):
            self._directions, upper = np.linalg.qr(self._from_before(k) @ self._directions)
            stretch += np.log(np.maximum(np.abs(np.diag(upper)), np.finfo(np.float64).tiny))
        return stretch

    def _from_before(self, k: int) -> Floats:
        """Return the derivative of the state before a contact by the state before the contact before it."""
        motion, body = self._motion, self._motion.body
        elapsed = float(self._impacts.times[k] - self._impacts.times[k - 1])
        before = self._vector(k - 1)
        law = motion.passages[self._impacts.contacts[k - 1]]
        passage = law.through(before, elapsed)
        phase = self._impacts.phases[k - 1] + passage.duration * body.angular_frequency
        over = motion.forced.free.over(elapsed - passage.duration)
        off = (over @ motion.forced.vector(passage.after, phase) - self._vector(k))[motion.forced.motion]
        if not np.abs(off).max() <= ARRIVES * body.scale * max(1.0, body.angular_frequency):
            raise OrbitError(
                f"expected contacts that follow from one another, got impact {k + 1} that does not: the body turns "
                "round before it has left the stop"
            )
        decay = 2.0 * float((body.damping_ratios * body.frequencies).sum())
        self.shrinking[k] = np.log(passage.shrinking) - decay * elapsed
        return np.asarray(over[motion.forced.motion, motion.forced.motion] @ passage.tangent)

    def _vector(self, k: int) -> Floats:
        """Return the vector of the state before a recorded contact."""
        impacts, motion = self._impacts, self._motion
        phase, speed = float(impacts.phases[k]), float(impacts.velocities[k])
        return motion.forced.vector(motion.at_stop(int(impacts.contacts[k]), phase, speed), phase)
