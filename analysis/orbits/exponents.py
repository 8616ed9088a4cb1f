"""Lyapunov exponents of a motion with impacts, from the saltation of its impacts: equations.md 4.11."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.analysis.orbits.recorded import Impacts, RecordedOrbit, recorded_orbit
from vibroimpact.analysis.orbits.yielding_stops.exponents import YieldingStretching
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.exponents import Stretching
from vibroimpact.fmus.errors import VibroimpactError

Integers = NDArray[np.int64]

FORGOTTEN = 1e-12
"""Share of an error of the first state that is left where impacts begin to count."""
SETTLING = 50
"""Number of impacts in which the directions turn to the stretched ones, before impacts count."""
BLOCKS = 20
"""Number of parts of a run whose scatter gives the standard error."""
LEAST = 10 * BLOCKS
"""Smallest number of impacts that count."""
_ON_ORBIT = 1e-6
"""Largest distance of impacts from an orbit that they are assumed to follow for ever, see `RecordedOrbit`."""
SUM_RULE = 1e-10
"""Largest difference of the sum of all exponents from its exact value, over the size of their terms."""


class ExponentError(VibroimpactError):
    """A run has no Lyapunov exponents, or they are unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class Exponents:
    """Lyapunov exponents of a run.

    Attributes
    ----------
    per_impact, standard_error : array, shape (2 modes,)
        The largest first; the error is the standard error of the mean over 20 parts of the run. Without a force the
        shape is (2 modes - 1,): the exponent 0 of the motion along itself is left out.
    interval : float
        Mean time between impacts, s: per_impact / interval are exponents per second.
    impacts : int
        Number of impacts that counted.
    sum_error : float
        Sum of the exponents minus its exact value 2 ln r - 2 interval sum z w, over the size of the terms. Where r
        falls with speed, the mean of ln(r (r + r' V)) takes the place of 2 ln r.
    """

    per_impact: Floats
    standard_error: Floats
    interval: float
    impacts: int
    sum_error: float

    @property
    def dimension(self) -> float:
        """Kaplan-Yorke dimension of the impact map's attractor; NaN where the largest exponent is not positive."""
        sums = np.cumsum(self.per_impact)
        if not self.per_impact[0] > 0.0 or not sums[-1] < 0.0:
            return float(np.nan)
        last = int(np.flatnonzero(sums > 0.0)[-1])
        return last + 1 + float(sums[last] / abs(self.per_impact[last + 1]))


def exponents_of(body: ImpactingBody, impacts: Impacts) -> Exponents:
    """Return the Lyapunov exponents of a motion from its impacts.

    The state follows from the impacts before, by the exact flow. The error of the first state decays with the modes,
    and impacts count once it is forgotten. The sum rule is checked. A periodic motion with too few impacts takes the
    multipliers of its orbit, which have no error.

    Parameters
    ----------
    body : ImpactingBody
    impacts : Impacts
        All impacts, in their order: none may be missing.

    Raises
    ------
    ExponentError
        There are too few impacts, a mode is undamped, an impact has no speed, or the sum rule does not hold.
    """
    count = impacts.times.size
    if count < 2 or not (impacts.velocities > 0.0).all():
        raise ExponentError(
            "lyapunov: expected impacts with a speed, got a motion without, or at rest on a stop."
        )
    if body.has_own_period:
        return _without_force(body, impacts)
    elapsed = np.diff(impacts.times, prepend=impacts.times[0])
    first = _first_that_counts(body, impacts)
    if count - first < LEAST:
        try:
            return _of_orbit(recorded_orbit(body, impacts))
        except OrbitError:
            raise ExponentError(
                f"lyapunov: expected {LEAST} impacts after the {first} of a transient, got {max(count - first, 0)}. "
                "Record more periods."
            ) from None
    edges = np.linspace(first, count, BLOCKS + 1).astype(int)
    sums, exact = _stretched(body, impacts, elapsed, edges)
    counted = count - first
    interval = float(elapsed[first:].sum()) / counted
    per_impact = sums.sum(axis=0) / counted
    means = sums / np.diff(edges)[:, None]
    order = np.argsort(-per_impact, kind="stable")
    off = abs(float(per_impact.sum()) - exact) / max(1.0, float(np.abs(per_impact).sum()))
    if not off <= SUM_RULE:
        raise ExponentError(
            f"lyapunov: expected exponents whose sum is {exact:.12g}, got {per_impact.sum():.12g}."
        )
    error = means.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    return Exponents(per_impact[order], error[order], interval, counted, off)


def _stretched(
    body: ImpactingBody, impacts: Impacts, elapsed: Floats, edges: Integers
) -> tuple[Floats, float]:
    """Return the stretching of the directions between the edges, and the exact sum of the exponents per impact."""
    first, blocks = int(edges[0]), list(itertools.pairwise(edges.tolist()))
    if body.yields:
        if body.frequencies.size > 1:
            raise ExponentError(
                "lyapunov: expected a periodic motion or one mode, where stops yield, got several modes: the impacts "
                "do not show their state."
            )
        yielding = YieldingStretching(body, impacts)
        try:
            yielding.along(1, first)
            sums = np.array([yielding.along(*each) for each in blocks])
        except OrbitError as problem:
            raise ExponentError(f"lyapunov: {problem}.") from problem
        return sums, float(yielding.shrinking[first:].mean())
    moving = Stretching(
        body.kernel,
        impacts.contacts.astype(np.int32),
        impacts.phases,
        elapsed,
        impacts.velocities,
        _first_state(body, impacts),
    )
    moving.along(1, first)
    sums = np.array([moving.along(*each) for each in blocks])
    decay = 2.0 * float(elapsed[first:].mean()) * body.decay
    shrinking = body.shrinking(impacts.contacts[first:], impacts.velocities[first:])
    return sums, float(np.mean(np.log(shrinking))) - decay


def _of_orbit(recorded: RecordedOrbit) -> Exponents:
    """Return the exponents of a periodic orbit: the logarithms of its multipliers, over its number of impacts."""
    if recorded.distance > _ON_ORBIT:
        raise OrbitError("chaos passes unstable orbits, near which it stays a while")
    orbit = recorded.orbit
    sizes = np.abs(orbit.multipliers)
    if not (sizes > 0.0).all():
        raise OrbitError("an orbit that grazes, or that forgets all, has no logarithms of its multipliers")
    count = orbit.phases.size
    per_impact = np.log(sizes) / count
    exact = float(np.log(orbit.exact_determinant)) / count
    off = abs(float(per_impact.sum()) - exact) / max(1.0, float(np.abs(per_impact).sum()))
    if not off <= SUM_RULE:
        raise OrbitError("its multipliers break the sum rule")
    interval = orbit.period / count
    return Exponents(per_impact, np.zeros(sizes.size), interval, count, off)


def _without_force(body: ImpactingBody, impacts: Impacts) -> Exponents:
    """Return the exponents of the periodic orbit of a body without a force: its modes grow, and forget no error."""
    try:
        return _of_orbit(recorded_orbit(body, impacts))
    except OrbitError as problem:
        reason = str(problem).removeprefix("orbit: ")
        raise ExponentError(
            f"lyapunov: expected a periodic orbit of a body without a force, got none: {reason}."
        ) from None


def _first_that_counts(body: ImpactingBody, impacts: Impacts) -> int:
    if body.frequencies.size == 1:
        return 1 + SETTLING
    slow = body.slowest_decay
    if not slow > 0.0:
        raise ExponentError(
            "lyapunov: expected damping of all modes with springs, without which a state is never forgotten, got none."
        )
    forgotten = impacts.times[0] - np.log(FORGOTTEN) / slow
    return int(np.searchsorted(impacts.times, forgotten)) + SETTLING


def _first_state(body: ImpactingBody, impacts: Impacts) -> Floats:
    """Return a state after the first impact: exact for one mode, otherwise the contact's own, with the rest at rest."""
    contact = body.contacts[impacts.contacts[0]]
    speed = impacts.velocities[0]
    away = -contact.direction * contact.restitution_at(speed) * speed
    along = contact.shape * contact.mass
    return np.concatenate([along * contact.position, along * away])
