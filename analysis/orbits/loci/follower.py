"""Bifurcations followed over two parameters, equations.md 4.5 to 4.7: folds, doublings, tori, pitchforks and grazes.

At points of codimension 2 the function of another bifurcation changes its sign, too. Loci of the other kind leave them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.orbits.bifurcations import (
    BETWEEN,
    FOLLOWED_KINDS,
    GRAZE,
    Bifurcation,
    Locus,
    LocusPoint,
    beyond,
    beyond_stop,
    is_other_maximum,
    joined_loci,
    meets_torus,
    nearly_symmetric,
    within,
)
from vibroimpact.analysis.orbits.branch import CLOSED, SpecialPoint
from vibroimpact.analysis.orbits.following import EASY_NEWTON, SHORTEST
from vibroimpact.analysis.orbits.loci.corners import CORNER, TwoTouches, corner_of
from vibroimpact.analysis.orbits.loci.fold_extrema import kind_of_extremum
from vibroimpact.analysis.orbits.loci.steps import CHANGE, OFF_CHORD, ZERO, LocusSteps
from vibroimpact.analysis.orbits.periodic import TURN, OrbitError, PeriodicOrbit, grazes
from vibroimpact.analysis.orbits.pitchforks import (
    DEGENERATE,
    PITCHFORK,
    cubic_of,
    degenerate_near,
    fold_beside,
    is_pitchfork,
)
from vibroimpact.analysis.orbits.sign_changes import turns_round
from vibroimpact.analysis.orbits.symmetry import differences, mirror_image
from vibroimpact.fmus.bodies.impacting_body import Floats

SLOW = 1e-3
"""Speed of an impact, over the fastest, below which a locus of another kind ends at a graze."""
BEFORE_GRAZE = 1e-9
"""Distance of a maximum beyond its stop, over the motion, above which it touched before an impact lost its speed."""
SAME_POINT = 1e-7
"""Distance from a locus, in ranges of the parameters and radians, below which an orbit is on it."""
AT_BOUND = 1e-9
"""Distance from an end of a range, over the range, below which a located point is at this end."""
END_OF_RANGE = "end of the range"


@dataclass(frozen=True, slots=True)
class _Event:
    """Part of a step at which the locus meets another bifurcation or ends, and the point there."""

    part: float
    at: LocusPoint
    end: str = ""
    """Reason why the locus ends there, if it does."""
    special: str = ""
    start: Bifurcation | None = None
    beyond: Sequence[Bifurcation] = ()


class LocusFollower(LocusSteps):
    """Follows a bifurcation of a body that depends on two parameters; see `LocusSteps`."""

    def locus(self, point: SpecialPoint, values: tuple[float, float]) -> Locus:
        """Follow a bifurcation both ways.

        Raises
        ------
        OrbitError
            The bifurcation is of a kind that cannot be followed.
        """
        start = Bifurcation.of(point, values)
        ways = Locus(start.kind), Locus(start.kind)
        for _ in self.both_ways(*ways, start):
            pass
        return joined_loci(*ways)

    def both_ways(self, backward: Locus, forward: Locus, start: Bifurcation) -> Iterator[Locus]:
        """Follow to lower values of the second parameter, then to higher ones; a closed locus is passed once."""
        for way, sign in ((backward, -1.0), (forward, 1.0)):
            if backward.is_closed:
                return
            for _ in self.walk(way, start, sign):
                yield way

    def walk(self, locus: Locus, start: Bifurcation, sign: float) -> Iterator[LocusPoint]:
        """Follow one way, at first towards higher (+1) or lower (-1) values of the second parameter."""
        if locus.kind not in FOLLOWED_KINDS:
            raise OrbitError(f"loci: expected a {', a '.join(FOLLOWED_KINDS)}, got a {locus.kind}.")
        start = self._kept_symmetric(start)
        now = self._first(start, sign)
        longest = self._ranges[0].longest
        step = 0.1 * longest
        locus.points.append(now)
        yield now
        while len(locus.points) < self._ranges[0].most_orbits:
            found = self._step(start, now, step)
            if found is None:
                step *= 0.5
                if step < SHORTEST * longest:
                    locus.ends.append(self._reason_for_end(locus, start, now, 1e-3 * longest))
                    return
                continue
            taken, newton = found
            for event in self._events(start, now, taken, step, is_first=now is locus.points[0]):
                if event.at is not now:
                    locus.points.append(event.at)
                    yield event.at
                locus.special += [(event.special, event.at)] if event.special else []
                locus.starts += [event.start] if event.start is not None else []
                locus.beyond += event.beyond
                if event.end:
                    locus.ends.append(event.end)
                    return
            if len(locus.points) > 2 and self._closes(locus.points[0], now, taken):
                locus.points.append(locus.points[0])
                locus.ends.append(CLOSED)
                yield locus.points[0]
                return
            locus.points.append(taken)
            yield taken
            now, step = taken, min(longest, step * (1.5 if newton <= EASY_NEWTON else 1.0))
        locus.ends.append(f"{self._ranges[0].most_orbits} orbits")

    def _first(self, start: Bifurcation, sign: float) -> LocusPoint:
        """Return the first point of a locus; the orbit at a pitchfork becomes as good as those that follow."""
        tangent = self._tangent(start, start.orbit, self._unknowns(start.orbit, start.values))
        now = LocusPoint(start.values, start.orbit, -tangent if tangent[-1] * sign < 0.0 else tangent)
        found = self._step(start, now, 0.0) if start.kind == PITCHFORK else None
        return now if found is None else found[0]

    def goes_through(self, locus: Locus, start: Bifurcation) -> bool:
        """Tell whether a locus goes through a bifurcation or its mirror image."""
        return len(self.places_on(locus, start)) > 0

    def places_on(self, locus: Locus, start: Bifurcation) -> list[int]:
        """Return the indices of the points of a locus after which a bifurcation, or its mirror image, lies on it.

        The orbit may be counted from another impact and period.
        """
        image = mirror_image(start.orbit)
        return sorted(
            {
                place
                for each in (start.orbit, image)
                if each is not None
                for place in self._near(locus, start, each)
            }
        )

    def _near(self, locus: Locus, start: Bifurcation, orbit: PeriodicOrbit) -> Iterator[int]:
        """Yield the places of a locus next to an orbit that has the bifurcation."""
        like = locus.points[0].orbit
        if (locus.kind, like.periods, like.phases.size) != (start.kind, orbit.periods, orbit.phases.size):
            return
        path = np.array([self._unknowns(each.orbit, each.values) for each in locus.points])
        steps = np.diff(path, axis=0)
        lengths = np.sqrt((steps**2).sum(axis=1))
        for first in range(orbit.phases.size):
            if (np.roll(orbit.contacts, -first) != like.contacts).any():
                continue
            apart = path - self._unknowns(orbit.counted_from(first), start.values)
            if not orbit.body.has_own_period:
                apart[:, :-2] -= TURN * np.round(apart[:, :1] / TURN)
            shares = -(apart[:-1] * steps).sum(axis=1) / np.maximum(lengths**2, np.finfo(np.float64).tiny)
            off = apart[:-1] + np.clip(shares, 0.0, 1.0)[:, None] * steps
            near = np.flatnonzero(np.sqrt((off**2).sum(axis=1)) < SAME_POINT + OFF_CHORD * lengths).tolist()
            if start.kind != BETWEEN or any(
                not is_other_maximum(locus.points[each].orbit, orbit, first) for each in near
            ):
                yield from near

    # ---- events of a step ----

    def _events(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float, *, is_first: bool
    ) -> list[_Event]:
        """Return the events of a step, in order, up to the end of the locus; the first point may be a zero itself."""
        events = [
            *self._other_kinds(start, now, taken, step, is_first=is_first),
            *self._extremum(start, now, taken, step),
            *self._degenerate(start, now, taken, step, is_first=is_first),
            *self._symmetric_end(start, now, taken),
            *self._ends_of_range(start, now, taken, step),
            *self._grazes(start, now, taken, step, is_first=is_first),
        ]
        events.sort(key=lambda event: event.part)
        ends = [place for place, event in enumerate(events) if event.end]
        if ends:  # a zero at the end itself belongs to the locus that leaves the end
            last = events[ends[0]]
            events = [each for each in events if each is last or each.part < last.part - ZERO * step]
        if start.kind == "torus" and not ends and not turns_round(taken.orbit.multipliers):
            double = taken.orbit.multipliers[np.argmin(np.abs(np.abs(taken.orbit.multipliers) - 1.0))].real
            is_breaking = start.halves is not None and is_pitchfork(now.orbit)
            one = PITCHFORK if is_breaking else "fold"
            return [_Event(0.0, now, one if double > 0.0 else "period doubling")]
        return events

    def _other_kinds(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float, *, is_first: bool
    ) -> Iterator[_Event]:
        """Yield the bifurcations of other kinds that the locus passes; a torus may end there.

        A stop that yields has no slopes at a graze: they differ with a contact and without it.
        """
        if start.kind == GRAZE and now.orbit.body.yields:
            return
        for kind, test in start.smooth.items():
            if kind == start.kind or (
                kind == "torus" and (now.orbit.body.frequencies.size < 2 or start.kind == GRAZE)
            ):
                continue
            found = self._zero(start, now, taken, step, lambda each, of=test: of(each.orbit), is_first)  # type: ignore[misc]  # of a lambda with a default
            if found is None or (kind == "torus" and not meets_torus(found[1].orbit.multipliers)):
                continue
            part, at = found
            is_last = start.kind == "torus" and not turns_round(taken.orbit.multipliers)
            yield _Event(part, at, kind if is_last else "", kind, Bifurcation(kind, at.orbit, at.values))

    def _extremum(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float
    ) -> Iterator[_Event]:
        """Yield the extremum of the second parameter along a locus of folds."""
        if start.kind != "fold" or not now.tangent[-1] * taken.tangent[-1] < 0.0:
            return
        found = self._located(start, now, step, lambda each: float(each.tangent[-1]))
        if found is not None:
            part, at = found
            unknowns = self._unknowns(at.orbit, at.values)
            kind = kind_of_extremum(
                at.tangent, lambda each: self._matrix(start, at.orbit, each, unknowns[-1:]), unknowns[:-1]
            )
            yield _Event(part, at, special=kind)

    def _degenerate(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float, *, is_first: bool
    ) -> Iterator[_Event]:
        """Yield the point of a locus of pitchforks at which folds of broken orbits begin."""
        halves = start.halves
        if start.kind != PITCHFORK or halves is None:
            return

        def cubic(each: LocusPoint) -> float:
            return cubic_of(halves, each.orbit, self._made, np.array(each.values) / self._spans)

        found = self._zero(start, now, taken, step, cubic, is_first)
        if found is not None:
            part, at = found
            beside = fold_beside(at.orbit, np.array(at.values) / self._spans, self._made, CHANGE)
            fold = None
            if beside is not None:
                first, second = beside[1] * self._spans
                fold = Bifurcation("fold", beside[0], (float(first), float(second)))
            yield _Event(part, at, special=DEGENERATE, start=fold)

    def _symmetric_end(self, start: Bifurcation, now: LocusPoint, taken: LocusPoint) -> Iterator[_Event]:
        """Yield the end of a locus of folds of broken orbits that a step passes: mirror images follow."""
        if start.kind != "fold" or start.halves is not None:
            return
        if not (nearly_symmetric(now.orbit) and nearly_symmetric(taken.orbit)):
            return
        apart = [self._broken(each.orbit) for each in (now, taken)]
        if float(apart[0] @ apart[1]) < 0.0:
            at = self._degenerate_near(now)
            if at is not None:
                yield _Event(0.0, at, DEGENERATE, DEGENERATE, Bifurcation(PITCHFORK, at.orbit, at.values))

    def _broken(self, orbit: PeriodicOrbit) -> Floats:
        """Return the unknowns of the mirror image less those of an orbit next to it."""
        image = mirror_image(orbit)
        apart = None if image is None else differences(orbit, image)
        return np.zeros(orbit.unknowns.size) if apart is None else apart

    def _degenerate_near(self, now: LocusPoint) -> LocusPoint | None:
        """Return the degenerate pitchfork next to a fold of broken orbits; None if there is none."""
        if not self._keep_symmetry(now.values):
            return None
        found = degenerate_near(now.orbit, np.array(now.values) / self._spans, self._made)
        if found is None:
            return None
        first, second = found[1] * self._spans
        return LocusPoint((float(first), float(second)), found[0], now.tangent)

    def _ends_of_range(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float
    ) -> Iterator[_Event]:
        for place, settings in enumerate(self._ranges):
            for bound in (settings.lowest, settings.highest):
                before, after = now.values[place], taken.values[place]
                if before == bound and not settings.lowest <= after <= settings.highest:
                    yield _Event(0.0, now, END_OF_RANGE)
                elif (before - bound) * (after - bound) < 0.0:
                    part, at = self._located(start, now, step, beyond(place, bound)) or self._last(
                        start, now, step, within(place, settings.lowest, settings.highest)
                    )
                    if abs(at.values[place] - bound) < AT_BOUND * settings.span:
                        at = replace(
                            at, values=(bound, at.values[1]) if place == 0 else (at.values[0], bound)
                        )
                    yield _Event(part, at, END_OF_RANGE)

    def _grazes(
        self, start: Bifurcation, now: LocusPoint, taken: LocusPoint, step: float, *, is_first: bool
    ) -> Iterator[_Event]:
        """Yield the graze of a step, after which the orbit is none: of an impact, or of a maximum between impacts."""
        speeds, end = start.other_speeds(taken.orbit), CORNER if start.kind in (GRAZE, BETWEEN) else ""
        slowest = int(speeds.argmin())
        if speeds[slowest] <= 0.0:
            if is_first and abs(now.orbit.velocities[slowest]) < ZERO * abs(speeds[slowest]):
                yield _Event(0.0, now, end or GRAZE)
                return
            part, at = self._last(start, now, step, lambda each: each.orbit.velocities[slowest] > 0.0)
            if start.kind != BETWEEN and beyond_stop(at.orbit) > BEFORE_GRAZE:
                yield self._touch(start, now, part)
                return
            other = Bifurcation(GRAZE, at.orbit, at.values, slowest)
            yield _Event(part, at, end or GRAZE, GRAZE, other, self._met(start, at, slowest, now))
        elif start.kind == BETWEEN:
            if is_other_maximum(now.orbit, taken.orbit):
                part, at = self._last(
                    start, now, step, lambda each: not is_other_maximum(now.orbit, each.orbit)
                )
                other = Bifurcation(BETWEEN, taken.orbit, taken.values)
                yield _Event(part, at, CORNER, "another", other, self._met(start, at, taken.orbit, now))
        elif beyond_stop(taken.orbit) > 0.0:
            if is_first and abs(beyond_stop(now.orbit)) < ZERO * beyond_stop(taken.orbit):
                yield _Event(0.0, now, end or BETWEEN)
                return
            yield self._touch(start, now, step)

    def _touch(self, start: Bifurcation, now: LocusPoint, step: float) -> _Event:
        """Return the event of a maximum that touches a stop, for a locus of other bifurcations."""
        found = self._located(start, now, step, lambda each: beyond_stop(each.orbit))
        part, at = found or self._last(start, now, step, lambda each: beyond_stop(each.orbit) <= 0.0)
        other = Bifurcation(BETWEEN, at.orbit, at.values)
        end = CORNER if start.kind == GRAZE else BETWEEN
        return _Event(part, at, end, BETWEEN, other, self._met(start, at, at.orbit, now))

    def _met(
        self, start: Bifurcation, at: LocusPoint, other: int | PeriodicOrbit, near: LocusPoint
    ) -> list[Bifurcation]:
        """Return the grazes of other orbits that meet a locus of grazes at its corner."""
        return self._corner(start, at, other, near)[1] if start.kind in (GRAZE, BETWEEN) else []

    def _corner(
        self, start: Bifurcation, at: LocusPoint, other: int | PeriodicOrbit, near: LocusPoint
    ) -> tuple[LocusPoint | None, list[Bifurcation]]:
        """Return the point of a locus at a corner, None if it is not found, and the grazes of other orbits there."""
        touches = TwoTouches(start, at.orbit, other, near.orbit)
        found = corner_of(touches, np.array(at.values) / self._spans, self._made, CHANGE)
        if found is None:
            return None, []
        first, second = found.parameters * self._spans
        values = float(first), float(second)
        others = [Bifurcation(GRAZE, orbit, values, impact) for orbit, impact in found.beyond]
        return LocusPoint(values, found.at, at.tangent), others

    def _reason_for_end(self, locus: Locus, start: Bifurcation, now: LocusPoint, step: float) -> str:
        """Return the reason why a locus ends where no step is short enough; a special point may be added to it."""
        is_nearly = start.halves is None and nearly_symmetric(now.orbit)
        if locus.kind == "fold" and is_nearly:
            degenerate = self._degenerate_near(now)
            if degenerate is not None:
                locus.points.append(degenerate)
                locus.special.append((DEGENERATE, degenerate))
                locus.starts.append(Bifurcation(PITCHFORK, degenerate.orbit, degenerate.values))
                return DEGENERATE
        no_further = f"cannot be followed further{': its orbits become symmetric' * is_nearly}"
        if locus.kind != BETWEEN:
            return no_further
        slowest = int(now.orbit.velocities.argmin())
        if len(locus.points) == 1 and grazes(now.orbit)[slowest]:
            return CORNER  # the locus begins there, and leaves in the other direction
        fastest = max(float(each.orbit.velocities.max()) for each in locus.points)
        if now.orbit.velocities[slowest] < SLOW * fastest and len(locus.points) > 1:
            faster = [each for each in locus.points if each.orbit.velocities.min() > SLOW * fastest]
            near = faster[-1] if faster else locus.points[0]
            at, others = self._corner(start, self._without_speed(locus), slowest, near)
            if at is not None:
                locus.special.append((GRAZE, at))
                silent = int(at.orbit.velocities.argmin())
                locus.starts.append(Bifurcation(GRAZE, at.orbit, at.values, silent))
                locus.beyond += others
                return CORNER
        found = self._step(start, now, step, most_turn=0.5 * np.pi)  # beyond a corner of two maxima
        if found is not None and is_other_maximum(now.orbit, found[0].orbit):
            locus.special.append(("another", now))
            locus.starts.append(Bifurcation(BETWEEN, found[0].orbit, found[0].values))
            locus.beyond += self._met(start, now, found[0].orbit, now)
            return CORNER
        return no_further

    def _without_speed(self, locus: Locus) -> LocusPoint:
        """Return the point where an impact has no speed, along the line through points next to it.

        An impact slower than the resolution of derivatives has a maximum next to it, and the locus cannot be followed.
        """
        now = locus.points[-1]
        slowest = now.orbit.velocities.min()
        faster = [each for each in locus.points if each.orbit.velocities.min() > 10.0 * slowest]
        before = faster[-1] if faster else locus.points[0]
        rows = [self._unknowns(each.orbit, each.values) for each in (before, now)]
        part = slowest / (before.orbit.velocities.min() - slowest)
        unknowns = rows[1] + part * (rows[1] - rows[0])
        values = unknowns[-2:] * self._spans
        return LocusPoint(
            (float(values[0]), float(values[1])), self._made(now.orbit, unknowns)[0], now.tangent
        )
