"""Bifurcations followed over two parameters: loci of folds, period doublings and grazes, equations.md 4.5 and 4.6.

The unknowns are the phases of the impacts and both parameters. The equations of the orbit are joined by one more: the
function with the sign change at the bifurcation. Where an impact of a locus loses its speed, the locus meets a graze:
a point of codimension 2. So is a graze between impacts at which a second maximum touches a stop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.analysis.orbits.following import (
    EASY_NEWTON,
    LOCATED,
    MOST_NEWTON,
    MOST_TURN,
    SHORTEST,
    BranchOrbit,
    FollowSettings,
    SpecialPoint,
)
from vibroimpact.analysis.orbits.periodic import TOUCHES, TURN, OrbitError, PeriodicOrbit, evaluated
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

FOLLOWED_KINDS = ("fold", "period doubling", "graze", "graze between impacts")
JUMP = 0.5
"""Change of the phase of the highest maximum, rad, above which it is another maximum."""
CHANGE = 1e-6
"""Change of an unknown for derivatives by differences; their error costs a Newton step, but no digit."""
SLOW = 1e-5
"""Speed of an impact, over the fastest, below which a locus of another kind ends at a graze."""
CLOSED = 1e-13
"""Change of the unknowns below which they count as found."""

BodyAt2 = Callable[[float, float], ImpactingBody]


@dataclass(frozen=True, eq=False)
class LocusPoint:
    """An orbit at its bifurcation."""

    values: tuple[float, float]
    """Values of both parameters."""
    orbit: PeriodicOrbit
    tangent: Floats
    """Direction of the locus, shape (p + 2,)."""


@dataclass(slots=True)
class Locus:
    """Locus of a bifurcation over two parameters.

    Attributes
    ----------
    kind : str
        `fold`, `period doubling`, `graze` or `graze between impacts`.
    points : list of LocusPoint
    special : list of tuple of (str, LocusPoint)
        Points of codimension 2: `graze` or `graze between impacts` on a locus of another kind; `another`, a second
        graze between impacts.
    ends : list of str
    origin : str
        Branch and point from which it starts.
    """

    kind: str
    points: list[LocusPoint] = field(default_factory=list)
    special: list[tuple[str, LocusPoint]] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)
    origin: str = ""


class LocusFollower:
    """Follows a bifurcation of a body that depends on two parameters.

    Parameters
    ----------
    body_at : callable
        Body for values of both parameters.
    first, second : FollowSettings
        Settings for both parameters; steps are those of the first.
    """

    def __init__(self, body_at: BodyAt2, first: FollowSettings, second: FollowSettings) -> None:
        self._body_at = body_at
        self._ranges = first, second
        self._spans = np.array([first.span, second.span])

    def locus(self, point: SpecialPoint, values: tuple[float, float]) -> Locus:
        """Follow a bifurcation both ways.

        Raises
        ------
        OrbitError
            The bifurcation is of a kind that cannot be followed.
        """
        sides = []
        for sign in (-1.0, 1.0):
            side = Locus(point.kind)
            for _ in self.walk(side, point.at, values, sign):
                pass
            sides.append(side)
        return joined_loci(*sides)

    def walk(
        self, locus: Locus, at: BranchOrbit, values: tuple[float, float], sign: float
    ) -> Iterator[LocusPoint]:
        """Follow one way, at first towards higher (+1) or lower (-1) values of the second parameter."""
        if locus.kind not in FOLLOWED_KINDS:
            raise OrbitError(f"loci: expected a {', a '.join(FOLLOWED_KINDS)}, got a {locus.kind}.")
        unknowns = np.concatenate([at.orbit.phases, np.array(values) / self._spans])
        tangent = self._tangent(locus.kind, at.orbit, unknowns)
        if tangent[-1] * sign < 0.0:
            tangent = -tangent
        now = LocusPoint(values, at.orbit, tangent)
        longest = self._ranges[0].longest
        step = 0.1 * longest
        locus.points.append(now)
        yield now
        while len(locus.points) < self._ranges[0].most_orbits:
            found = self._step(locus.kind, now, step)
            if found is None:
                step *= 0.5
                if step < SHORTEST * longest:
                    locus.ends.append(self._reason_for_end(locus, now, 1e-3 * longest))
                    return
                continue
            taken, newton = found
            end = self._end(locus, now, taken, step)
            if end is not None:
                reason, last = end
                if last is not None:
                    locus.points.append(last)
                    yield last
                locus.ends.append(reason)
                return
            locus.points.append(taken)
            yield taken
            now, step = taken, min(longest, step * (1.5 if newton <= EASY_NEWTON else 1.0))
        locus.ends.append(f"{self._ranges[0].most_orbits} orbits")

    # ---- equations ----

    def _made(self, orbit: PeriodicOrbit, unknowns: Floats) -> tuple[PeriodicOrbit, Floats, Floats]:
        phases = unknowns[:-2]
        body = self._body_at(*(unknowns[-2:] * self._spans))
        found = evaluated(body, orbit.contacts, phases, orbit.periods)
        made = PeriodicOrbit(body, orbit.periods, phases, orbit.contacts, found.velocities)
        return made, found.distances, found.distance_slopes

    def _equations(self, kind: str, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        made, distances, slopes = self._made(orbit, unknowns)
        if kind == "graze":
            test = float(made.velocities.min())
        elif kind == "graze between impacts":
            beyond, _, contact = made.highest
            test = beyond / made.body.scale if contact >= 0 else np.nan
        elif kind == "fold":
            test = float(np.linalg.det(slopes / made.body.scale))
        else:
            size = made.monodromy.shape[0]
            fast = float(np.prod(made.velocities))
            known = np.isfinite(made.monodromy).all()
            test = float(np.linalg.det(made.monodromy + np.eye(size))) * fast if known else np.nan
        if not np.isfinite(test):
            raise OrbitError("loci: expected impacts with a speed, and a maximum between them; got none.")
        return np.append(distances / made.body.scale, test)

    def _slopes(self, kind: str, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        columns = []
        for k in range(unknowns.size):
            ends = []
            for side in (1.0, -1.0):
                moved = unknowns.copy()
                moved[k] += side * CHANGE
                ends.append(self._equations(kind, orbit, moved))
            columns.append((ends[0] - ends[1]) / (2.0 * CHANGE))
        return np.column_stack(columns)

    def _tangent(self, kind: str, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        return np.asarray(np.linalg.svd(self._slopes(kind, orbit, unknowns))[2][-1], dtype=np.float64)

    def _step(
        self, kind: str, now: LocusPoint, step: float, most_turn: float = MOST_TURN
    ) -> tuple[LocusPoint, int] | None:
        start = np.concatenate([now.orbit.phases, np.array(now.values) / self._spans])
        unknowns = start + step * now.tangent
        try:
            slopes = self._slopes(kind, now.orbit, unknowns)
            for newton in range(MOST_NEWTON):  # noqa: B007  # the number is returned
                residual = self._equations(kind, now.orbit, unknowns)
                matrix = np.vstack([slopes, now.tangent])
                off = step - now.tangent @ (unknowns - start)
                change = np.linalg.solve(matrix, np.append(-residual, off))
                if not np.abs(change).max() < 0.5:
                    return None
                unknowns = unknowns + change
                if np.abs(change).max() < CLOSED * (1.0 + np.abs(unknowns).max()):
                    break
            else:
                return None
            orbit = self._made(now.orbit, unknowns)[0]
            tangent = self._tangent(kind, orbit, unknowns)
        except (OrbitError, np.linalg.LinAlgError):
            return None
        if tangent @ now.tangent < 0.0:
            tangent = -tangent
        if tangent @ now.tangent < np.cos(most_turn):
            return None
        values = unknowns[-2:] * self._spans
        return LocusPoint((float(values[0]), float(values[1])), orbit, tangent), newton

    # ---- ends ----

    def _end(
        self, locus: Locus, now: LocusPoint, taken: LocusPoint, step: float
    ) -> tuple[str, LocusPoint | None] | None:
        """Return the reason why a locus ends between two points, and the last point; None if it continues."""
        if locus.kind != "graze" and taken.orbit.velocities.min() <= 0.0 < now.orbit.velocities.min():
            found = self._last(locus.kind, now, step, lambda each: each.orbit.velocities.min() > 0.0)
            locus.special.append(("graze", found))
            return "graze", found
        between = locus.kind == "graze between impacts"
        if between and _is_other_maximum(now, taken):
            found = self._last(locus.kind, now, step, lambda each: not _is_other_maximum(now, each))
            locus.special.append(("another", found))
            return "another graze between impacts", found
        for place, settings in enumerate(self._ranges):
            for bound in (settings.lowest, settings.highest):
                before, after = now.values[place], taken.values[place]
                if before == bound and not settings.lowest <= after <= settings.highest:
                    return "end of the range", None
                if (before - bound) * (after - bound) < 0.0:
                    return "end of the range", self._located(locus.kind, now, step, _beyond(place, bound))
        if not between and taken.orbit.highest[0] > TOUCHES * taken.orbit.body.scale >= now.orbit.highest[0]:
            touch = self._located(locus.kind, now, step, _beyond_stop)
            if touch is not None:
                locus.special.append(("graze between impacts", touch))
            return "graze between impacts", touch
        return None

    def _reason_for_end(self, locus: Locus, now: LocusPoint, step: float) -> str:
        """Return the reason why a locus ends where no step is short enough; a special point may be added to it."""
        if locus.kind != "graze between impacts":
            return "cannot be followed further"
        slow = now.orbit.velocities.min() / now.orbit.velocities.max()
        if slow < SLOW:
            locus.special.append(("graze", self._without_speed(locus)))
            return "graze"
        found = self._step(locus.kind, now, step, most_turn=0.5 * np.pi)  # beyond a corner of two maxima
        if found is not None and _is_other_maximum(now, found[0]):
            locus.special.append(("another", now))
            return "another graze between impacts"
        return "cannot be followed further"

    def _without_speed(self, locus: Locus) -> LocusPoint:
        """Return the point where an impact has no speed, along the line through points next to it.

        An impact slower than the resolution of derivatives has a maximum next to it, and the locus cannot be followed.
        """
        now = locus.points[-1]
        slowest = now.orbit.velocities.min()
        faster = [each for each in locus.points if each.orbit.velocities.min() > 10.0 * slowest]
        before = faster[-1] if faster else locus.points[0]
        rows = [
            np.concatenate([each.orbit.phases, np.array(each.values) / self._spans]) for each in (before, now)
        ]
        part = slowest / (before.orbit.velocities.min() - slowest)
        unknowns = rows[1] + part * (rows[1] - rows[0])
        values = unknowns[-2:] * self._spans
        orbit = self._made(now.orbit, unknowns)[0]
        return LocusPoint((float(values[0]), float(values[1])), orbit, now.tangent)

    def _last(
        self, kind: str, now: LocusPoint, step: float, holds: Callable[[LocusPoint], bool]
    ) -> LocusPoint:
        """Return the last point of a step for which a condition holds: beyond it there may be no points."""
        part, beyond, last = 0.0, step, now
        while beyond - part > LOCATED * step:
            middle = 0.5 * (part + beyond)
            found = self._step(kind, now, middle)
            if found is None or not holds(found[0]):
                beyond = middle
            else:
                part, last = middle, found[0]
        return last

    def _located(
        self, kind: str, now: LocusPoint, step: float, test: Callable[[LocusPoint], float]
    ) -> LocusPoint | None:
        from scipy.optimize import brentq

        def at(part: float) -> float:
            found = (now, 0) if part == 0.0 else self._step(kind, now, part)
            return float(np.nan) if found is None else test(found[0])

        try:
            part = brentq(at, 0.0, step, xtol=LOCATED * step, rtol=4.0 * np.finfo(float).eps)
        except (ValueError, RuntimeError):
            return None
        found = self._step(kind, now, part)
        return None if found is None else found[0]


def joined_loci(backward: Locus, forward: Locus) -> Locus:
    """Return both ways from one point as one locus."""
    return Locus(
        forward.kind,
        backward.points[::-1] + forward.points[1:],
        backward.special[::-1] + forward.special,
        backward.ends + forward.ends,
        forward.origin,
    )


def _beyond(place: int, bound: float) -> Callable[[LocusPoint], float]:
    return lambda point: point.values[place] - bound


def _beyond_stop(point: LocusPoint) -> float:
    """Return the distance of the highest maximum beyond its stop, over the size of the motion; at least -1."""
    return max(point.orbit.highest[0] / point.orbit.body.scale, -1.0) - TOUCHES


def _is_other_maximum(one: LocusPoint, other: LocusPoint) -> bool:
    """Tell whether the highest maxima between impacts of two orbits are different maxima."""
    (_, at, contact), (_, at_other, contact_other) = one.orbit.highest, other.orbit.highest
    whole = TURN * one.orbit.periods
    moved = (at_other - other.orbit.phases[0]) - (at - one.orbit.phases[0])
    return contact != contact_other or abs(np.mod(moved + 0.5 * whole, whole) - 0.5 * whole) > JUMP
