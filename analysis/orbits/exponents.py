"""Lyapunov exponents of a motion with impacts, from the saltation of its impacts: equations.md 4.11."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.analysis.orbits.recorded import Impacts, RecordedOrbit, recorded_orbit
from vibroimpact.analysis.orbits.yielding_stops.exponents import RecordedStretching
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
SUM_RULE_OF_POWERS = 1e-8
"""The same on power-law stops: their motion is known to 1e-9, and a long contact breaks the rule by up to 4e-10."""


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
    and impacts count once it is forgotten. On yielding stops, without a force, and with undamped modes a filter finds
    the state instead. The sum rule is checked. A periodic motion with too few impacts takes the multipliers of its
    orbit, which have no error.

    Parameters
    ----------
    body : ImpactingBody
    impacts : Impacts
        All impacts, in their order: none may be missing.

    Raises
    ------
    ExponentError
        There are too few impacts, an impact has no speed, or the sum rule does not hold.
    """
    count = impacts.times.size
    if count < 2 or not _can_be_followed(body, impacts):
        raise ExponentError(
            "lyapunov: expected impacts with a speed, got a motion without, or at rest on a stop."
        )
    if body.has_own_period:
        return _without_force(body, impacts)
    elapsed = np.diff(impacts.times, prepend=impacts.times[0])
    if body.yields or (body.frequencies.size > 1 and not body.slowest_decay > 0.0):
        return _of_run(_recorded_logarithms(body, impacts), elapsed) or _of_few_impacts(body, impacts)
    first = _first_that_counts(body, impacts)
    if impacts.times.size - first < LEAST:
        return _of_few_impacts(body, impacts, first)
    return _of_run(_stretched(body, impacts, elapsed, first), elapsed) or _of_few_impacts(body, impacts)


def _can_be_followed(body: ImpactingBody, impacts: Impacts) -> bool:
    """Return whether all impacts have a speed, or press a stop with damping again before it is left."""
    damped = [each.press is not None and each.press.damping > 0.0 for each in body.contacts]
    return bool(((impacts.velocities > 0.0) | np.array(damped, dtype=bool)[impacts.contacts]).all())


class _Logarithms(NamedTuple):
    """Stretching of directions from the first impact that counts on."""

    first: int
    edges: Integers
    sums: Floats
    """Between the edges, shape (block, direction)."""
    exact: float
    """Exact sum of the exponents per impact."""
    tolerance: float = SUM_RULE
    """Largest difference of their sum from it, over the size of their terms."""


def _of_run(found: _Logarithms | None, elapsed: Floats) -> Exponents | None:
    """Return the exponents of a stretching; None without one. ExponentError unless the sum rule holds."""
    if found is None:
        return None
    counted = elapsed.size - found.first
    per_impact = found.sums.sum(axis=0) / counted
    means = found.sums / np.diff(found.edges)[:, None]
    order = np.argsort(-per_impact, kind="stable")
    off = abs(float(per_impact.sum()) - found.exact) / max(1.0, float(np.abs(per_impact).sum()))
    if not off <= found.tolerance:
        raise ExponentError(
            f"lyapunov: expected exponents whose sum is {found.exact:.12g}, got {per_impact.sum():.12g}."
        )
    error = means.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    interval = float(elapsed[found.first :].sum()) / counted
    return Exponents(per_impact[order], error[order], interval, counted, off)


def _of_few_impacts(body: ImpactingBody, impacts: Impacts, first: int | None = None) -> Exponents:
    """Return the exponents of the periodic orbit of impacts that are too few; ExponentError without an orbit."""
    try:
        return _of_orbit(recorded_orbit(body, impacts))
    except OrbitError:
        count = impacts.times.size
        first = _first_known(body, impacts) if first is None else first
        if count >= LEAST and first >= count:
            raise ExponentError(
                f"lyapunov: expected contacts that follow from one another, got impact {first - SETTLING} that does "
                "not: contacts overlap, or the filter finds no first state."
            ) from None
        raise ExponentError(
            f"lyapunov: expected {LEAST} impacts after the {first} of a transient, got {max(count - first, 0)}. "
            "Record more periods."
        ) from None


def _first_known(body: ImpactingBody, impacts: Impacts) -> int:
    return RecordedStretching(body, impacts).first_known + SETTLING


def _recorded_logarithms(body: ImpactingBody, impacts: Impacts) -> _Logarithms | None:
    """Return the stretching of a motion whose state a filter finds; None for too few impacts with a known state."""
    count = impacts.times.size
    if count < LEAST:
        return None
    carried = RecordedStretching(body, impacts)
    first = carried.first_known + SETTLING
    if count - first < LEAST:
        return None
    edges = np.linspace(first, count, BLOCKS + 1).astype(int)
    sums = np.add.reduceat(carried.logarithms, edges[:-1], axis=0)
    powers = any(each.press is not None and not each.press.is_linear for each in body.contacts)
    exact = float(carried.shrinking[first:].mean())
    return _Logarithms(first, edges, sums, exact, SUM_RULE_OF_POWERS if powers else SUM_RULE)


def _stretched(body: ImpactingBody, impacts: Impacts, elapsed: Floats, first: int) -> _Logarithms:
    """Return the stretching by impacts on rigid stops, whose bodies forget the error of the first state."""
    edges = np.linspace(first, impacts.times.size, BLOCKS + 1).astype(int)
    moving = Stretching(
        body.kernel,
        impacts.contacts.astype(np.int32),
        impacts.phases,
        elapsed,
        impacts.velocities,
        _first_state(body, impacts),
    )
    moving.along(1, first)
    sums = np.array([moving.along(*each) for each in itertools.pairwise(edges.tolist())])
    decay = 2.0 * float(elapsed[first:].mean()) * body.decay
    shrinking = body.shrinking(impacts.contacts[first:], impacts.velocities[first:])
    return _Logarithms(first, edges, sums, float(np.mean(np.log(shrinking))) - decay)


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
    """Return the exponents of a body without a force: those of its periodic orbit, or else of its recorded motion."""
    try:
        return _of_orbit(recorded_orbit(body, impacts))
    except OrbitError as problem:
        elapsed = np.diff(impacts.times, prepend=impacts.times[0])
        timeless = impacts._replace(phases=np.zeros(impacts.times.size))
        found = _of_run(_recorded_logarithms(body, timeless), elapsed)
        if found is not None:
            return found
        reason = str(problem).removeprefix("orbit: ")
        raise ExponentError(
            f"lyapunov: expected a periodic orbit of a body without a force, or {LEAST} impacts after "
            f"{_first_known(body, timeless)} of a transient, got neither: {reason}."
        ) from None


def _first_that_counts(body: ImpactingBody, impacts: Impacts) -> int:
    if body.frequencies.size == 1:
        return 1 + SETTLING
    forgotten = impacts.times[0] - np.log(FORGOTTEN) / body.slowest_decay
    return int(np.searchsorted(impacts.times, forgotten)) + SETTLING


def _first_state(body: ImpactingBody, impacts: Impacts) -> Floats:
    """Return a state after the first impact: exact for one mode, otherwise the contact's own, with the rest at rest."""
    contact = body.contacts[impacts.contacts[0]]
    speed = impacts.velocities[0]
    away = -contact.direction * contact.restitution_at(speed) * speed
    along = contact.shape * contact.mass
    return np.concatenate([along * contact.position, along * away])
