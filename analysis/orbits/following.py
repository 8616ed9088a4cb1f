"""Orbits followed over a parameter, through folds, with the points where they change: equations.md 4.4 to 4.13.

The unknowns are those of an orbit (with a force the phases of its impacts) and the parameter. A step goes along the
branch (pseudo-arclength), so that a fold is an ordinary point. Each event is the sign change of a function along the
branch; steps of partial length narrow it down to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.orbits.branch import CLOSED, Branch, BranchOrbit, SpecialPoint, joined
from vibroimpact.analysis.orbits.branch_points import (
    BRANCH_POINT,
    LEVEL,
    NEAR,
    bordered_determinant,
    end_of,
    interpolated_zeros,
)
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY, Corner, next_corner
from vibroimpact.analysis.orbits.periodic import CLOSE, TURN, OrbitError, PeriodicOrbit, Trial, tried
from vibroimpact.analysis.orbits.sign_changes import (
    is_explained,
    is_of_graze,
    turns_at_graze,
    turns_round,
)
from vibroimpact.analysis.orbits.symmetry import differences
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

MOST_NEWTON = 12
EASY_NEWTON = 3
"""Number of Newton steps up to which the next step along the branch is made longer."""
MOST_TURN = 0.1
"""Change of the branch's direction between points, rad, above which a step is repeated with half its length."""
SHORTEST = 1e-9
"""Step along the branch, over the longest, below which the branch ends."""
STABILITY_CHANGE = "stability change"
"""Kind of a point where the stability changes for none of the known reasons."""
END = "end of the range"
"""End of a branch at a bound of the parameter."""
SLOWED = "its impacts lose their speed"
"""End of a branch without a force whose impacts have no speed where nothing gives energy."""
TOGETHER = 1e-3
"""Difference of the phases of two impacts, rad, below which a branch that ends there ends because of it."""
INTERPOLATED = 100.0
"""Distance from the stops at an interpolated branch point, over that of orbits, above which it is none."""
LOCATED = 1e-13
"""Width of a bracket, over the step along the branch, below which a point counts as found."""

BodyAt = Callable[[float], ImpactingBody]


@dataclass(frozen=True, slots=True)
class FollowSettings:
    """Settings for following a branch.

    Attributes
    ----------
    lowest, highest : float
        Range of the parameter.
    longest : float
        Largest step along the branch; the range of the parameter counts as 1, a radian of all phases as 1.
    most_orbits : int
        Number of orbits after which a branch ends.
    """

    lowest: float
    highest: float
    longest: float = 0.01
    most_orbits: int = 20_000

    @property
    def span(self) -> float:
        """Range of the parameter."""
        return self.highest - self.lowest


class Follower:
    """Follows orbits of a body that depends on a parameter.

    Parameters
    ----------
    body_at : callable
        Body for a value of the parameter.
    settings : FollowSettings
    """

    def __init__(self, body_at: BodyAt, settings: FollowSettings) -> None:
        self._body_at = body_at
        self.settings = settings

    def branch(self, orbit: PeriodicOrbit, value: float, origin: str = "") -> Branch:
        """Follow the branch of an orbit both ways, within its physical part and within the range.

        OrbitError: the orbit does not lie on a branch.
        """
        ways = [Branch(origin), Branch(origin)]
        for _ in self.both_ways(ways[0], ways[1], orbit, value):
            pass
        return joined(*ways)

    def both_ways(
        self, backward: Branch, forward: Branch, orbit: PeriodicOrbit, value: float
    ) -> Iterator[tuple[Branch, BranchOrbit]]:
        """Follow an orbit to lower values, then to higher values; a closed branch is passed once."""
        for branch, sign in ((backward, -1.0), (forward, 1.0)):
            if backward.is_closed:
                return
            for each in self.walk(branch, orbit, value, sign):
                yield branch, each

    def walk(self, branch: Branch, orbit: PeriodicOrbit, value: float, sign: float) -> Iterator[BranchOrbit]:
        """Follow one way, at first towards higher (+1) or lower (-1) values; the branch grows with each orbit."""
        first = self.on_branch(orbit, value, None)
        is_backward = first.tangent[-1] * sign < 0.0 or first.tangent[-1] == 0.0 > sign
        yield from self._orbits(branch, first.turned if is_backward else first)

    def leave(self, branch: Branch, start: BranchOrbit) -> Iterator[BranchOrbit]:
        """Follow orbits that begin at a special point, in the direction of `start`; the branch grows with each."""
        yield from self._orbits(branch, start, born=True)

    def _orbits(self, branch: Branch, start: BranchOrbit, *, born: bool = False) -> Iterator[BranchOrbit]:
        now, step, longest = start, 0.1 * self.settings.longest, self.settings.longest
        if not (born and now.orbit.turns > 1):
            branch.orbits.append(now)
            yield now
        while len(branch.orbits) < self.settings.most_orbits:
            found = self.step(now, step)
            corner = None if born else next_corner(self, now, step, found[0].orbit if found else None)
            if corner is not None:
                if (yield from self._to_corner(branch, now, corner)):
                    return
                now, step = branch.orbits[-1], 0.1 * longest
                continue
            too_near = found is not None and abs(found[0].border) < NEAR * abs(now.border)
            if found is None and (last := self._last(now, step)) is not None:
                yield from self._to_end(branch, now, last)
                return
            if found is None or too_near or (born and not found[0].orbit.is_physical):
                step *= 0.5
                if step < SHORTEST * longest or (found is None and self._is_at_end(now)):
                    branch.ends.append(f"cannot be followed beyond {now.value:.11g}{self._obstacle(now)}")
                    return
                continue
            taken, newton = found
            # an orbit next to its origin has no special points of its own yet
            closing = None if born else self._closing_step(branch.orbits[0], now, taken, step)
            if closing is not None:
                step, taken = closing
            if not born and (yield from self._passed(branch, now, taken, step)):
                return
            born = False
            branch.orbits.append(taken)
            yield taken
            if closing is not None:
                branch.ends.append(CLOSED)
                return
            now = taken
            step = min(longest, step * (1.5 if newton <= EASY_NEWTON else 1.0))
        branch.ends.append(f"{self.settings.most_orbits} orbits")

    def _to_corner(
        self, branch: Branch, now: BranchOrbit, corner: Corner
    ) -> Generator[BranchOrbit, None, bool]:
        """Add the events before a corner, and its orbit, to the branch; return whether the branch ends there."""
        before, orbit = BranchOrbit(*corner.before), corner.before.orbit
        if (yield from self._passed(branch, now, before, corner.place)):
            return True
        if orbit.turns > 1:
            branch.ends.append(f"{AT_YIELD_VELOCITY} of {orbit.once.name}")
        else:
            branch.points.append(SpecialPoint(AT_YIELD_VELOCITY, before, len(branch.orbits)))
        branch.orbits += [before, BranchOrbit(*corner.beyond)][: 1 if orbit.turns > 1 else 2]
        yield branch.orbits[-1]
        return orbit.turns > 1

    def _is_at_end(self, now: BranchOrbit) -> bool:
        """Return whether a branch is at the end of the range, as closely as its steps can be told apart."""
        bound = self.settings.lowest if now.tangent[-1] < 0.0 else self.settings.highest
        return abs(now.value - bound) < SHORTEST * self.settings.span

    def _last(self, now: BranchOrbit, step: float) -> BranchOrbit | None:
        """Return the orbit at the end of the range that a step would pass, where there is no body beyond; else None."""
        lowest, highest, span = self.settings.lowest, self.settings.highest, self.settings.span
        ahead = now.value + step * now.tangent[-1] * span
        bound = min(max(ahead, lowest), highest)
        if bound in (ahead, now.value):
            return None
        share = (bound - now.value) / (now.tangent[-1] * span)
        unknowns = expected = now.orbit.unknowns + share * now.tangent[:-1]
        close, least = CLOSE * now.orbit.body.scale, np.inf
        try:
            for _ in range(MOST_NEWTON):
                errors, slopes, orbit = self.residual(now.orbit, unknowns, bound)
                error = float(np.abs(errors).max())
                if error <= close and (error >= 0.5 * least or orbit.body.yields):
                    found = self.on_branch(orbit, bound, now.tangent, slopes)
                    is_next = np.abs(unknowns - expected).max() <= step
                    return found if is_next and found.tangent @ now.tangent >= np.cos(MOST_TURN) else None
                least = min(least, error)
                unknowns = unknowns - np.linalg.solve(slopes, errors)
        except (OrbitError, np.linalg.LinAlgError):
            return None
        return None

    def _to_end(self, branch: Branch, now: BranchOrbit, last: BranchOrbit) -> Iterator[BranchOrbit]:
        """Add the orbit at the end of the range, and the events before it, to the branch."""
        step = float(now.tangent @ self._difference(now, last))
        if not (yield from self._passed(branch, now, last, step)):
            branch.orbits.append(last)
            branch.ends.append(END)
            yield last

    def _obstacle(self, now: BranchOrbit) -> str:
        """Return the reason why no orbit is found beyond one, after a colon; an empty text if none is known."""
        gaps = np.diff(now.orbit.phases, append=now.orbit.phases[0] + TURN * now.orbit.periods)
        if gaps.min() < TOGETHER:
            return ": two impacts come together"
        if now.orbit.is_beyond_bounds:
            return ": its impacts grow without bound"
        try:
            self.matrix(
                now.orbit, now.orbit.unknowns, now.value + 1e-6 * self.settings.span * now.tangent[-1]
            )
        except OrbitError as problem:
            return f": {problem}"
        return ""

    def _passed(
        self, branch: Branch, now: BranchOrbit, taken: BranchOrbit, step: float
    ) -> Generator[BranchOrbit, None, bool]:
        """Add the events of a step to the branch; return whether the branch ends there."""
        for _, kind, at in self._events_in_order(now, taken, step):
            if kind not in at.tests and kind != STABILITY_CHANGE:
                branch.ends.append(kind)
                if kind.startswith(BRANCH_POINT):
                    branch.points.append(SpecialPoint(BRANCH_POINT, at, len(branch.orbits)))
                if at is not now:
                    branch.orbits.append(at)
                    yield at
                return True
            branch.points.append(SpecialPoint(kind, at, len(branch.orbits)))
            branch.orbits.append(at)
            yield at
            if kind.startswith("graze"):
                branch.ends.append(kind)
                return True
        return False

    # ---- one step ----

    def residual(self, orbit: PeriodicOrbit, unknowns: Floats, value: float) -> Trial:
        """Return errors, their slopes, and the orbit, for other unknowns and another parameter."""
        return tried(self._body_at(value), orbit, unknowns)

    def _over_value(
        self, orbit: PeriodicOrbit, unknowns: Floats, value: float, before: float = -1.0
    ) -> Floats:
        """Return the derivative of the errors by the parameter, measured in its range.

        `before` 0 takes the difference on one side, which is enough for a direction of Newton's method.
        """
        change = 1e-6 * max(abs(value), 1e-3 * self.settings.span)
        try:
            ends = [self.residual(orbit, unknowns, value + side * change).errors for side in (1.0, before)]
        except OrbitError:
            return self._over_value_at_bound(orbit, unknowns, value, change)
        return (ends[0] - ends[1]) * (self.settings.span / ((1.0 - before) * change))

    def _over_value_at_bound(
        self, orbit: PeriodicOrbit, unknowns: Floats, value: float, change: float
    ) -> Floats:
        """Return the derivative by the parameter from values on that side of a bound where there is a body."""
        inwards = change if value < 0.5 * (self.settings.lowest + self.settings.highest) else -change
        at, near, far = (self.residual(orbit, unknowns, value + n * inwards).errors for n in range(3))
        return (4.0 * near - 3.0 * at - far) * (self.settings.span / (2.0 * inwards))

    def matrix(self, orbit: PeriodicOrbit, unknowns: Floats, value: float) -> Floats:
        """Return the derivatives of the errors by all unknowns, shape (p, p + 1)."""
        slopes = self.residual(orbit, unknowns, value).slopes
        return np.column_stack([slopes, self._over_value(orbit, unknowns, value)])

    def on_branch(
        self, orbit: PeriodicOrbit, value: float, before: Floats | None, slopes: Floats | None = None
    ) -> BranchOrbit:
        """Return an orbit with the direction of its branch, which is near to a direction if there is one.

        `slopes` are those of the orbit's errors where they are known.
        """
        known = self.residual(orbit, orbit.unknowns, value).slopes if slopes is None else slopes
        matrix = np.column_stack([known, self._over_value(orbit, orbit.unknowns, value)])
        tangent: Floats = np.linalg.svd(matrix)[2][-1]
        if before is not None and tangent @ before < 0.0:
            tangent = -tangent
        return BranchOrbit(value, orbit, tangent, bordered_determinant(matrix, tangent))

    def step(self, now: BranchOrbit, step: float) -> tuple[BranchOrbit, int] | None:
        """Return the orbit a step further, and the number of Newton steps; None without an orbit that near."""
        span = self.settings.span
        before, close = now.orbit.unknowns, CLOSE * now.orbit.body.scale
        unknowns = before + step * now.tangent[:-1]
        value = now.value + step * now.tangent[-1] * span
        least, orbit = np.inf, now.orbit
        try:
            across = self._over_value(now.orbit, unknowns, value, before=0.0)
            for newton in range(MOST_NEWTON):  # noqa: B007  # the number is returned
                errors, slopes, orbit = self.residual(orbit, unknowns, value)
                error = float(np.abs(errors).max())
                small = error <= close
                if small and (error >= 0.5 * least or orbit.body.yields):
                    break
                least = min(least, error)
                ahead = now.tangent @ np.append(unknowns - before, (value - now.value) / span)
                matrix = np.vstack([np.column_stack([slopes, across]), now.tangent])
                change = np.linalg.solve(matrix, np.append(-errors, step - ahead))
                if not np.abs(change).max() < 1.0:
                    return None
                unknowns = unknowns + change[:-1]
                value += change[-1] * span
            else:
                if not least <= 1e3 * close:
                    return None
            taken = self.on_branch(orbit, float(value), now.tangent, slopes)
        except (OrbitError, np.linalg.LinAlgError):
            return None
        return (taken, newton) if taken.tangent @ now.tangent >= np.cos(MOST_TURN) else None

    def _closing_step(
        self, first: BranchOrbit, now: BranchOrbit, taken: BranchOrbit, step: float
    ) -> tuple[float, BranchOrbit] | None:
        """Return the step to the first orbit of the branch, and that orbit; None unless a step passes it."""
        # far from the first orbit, over the length of the step, there is nothing to compare
        if now is first or taken is first or abs(taken.value - first.value) > 4.0 * step * self.settings.span:
            return None
        before, beyond = (self._difference(first, each) for each in (now, taken))
        if not first.tangent @ before < 0.0 <= first.tangent @ beyond:
            return None
        farther = max(float(np.linalg.norm(each)) for each in (before, beyond))
        if farther > 2.0 * float(np.linalg.norm(beyond - before)):
            return None  # another part of the branch passes the same plane
        last = float(now.tangent @ self._difference(now, first))
        found = self.step(now, last) if last > 0.0 else None
        return None if found is None else (last, found[0])

    def _difference(self, one: BranchOrbit, other: BranchOrbit) -> Floats:
        """Return the difference of two orbits in the unknowns of the branch, whatever turn their phases start from."""
        apart = differences(one.orbit, other.orbit)
        assert apart is not None, "orbits of one branch hit their stops in one order"
        return np.append(apart, (other.value - one.value) / self.settings.span)

    # ---- events of a step ----

    def _events_in_order(
        self, now: BranchOrbit, taken: BranchOrbit, step: float
    ) -> list[tuple[float, str, BranchOrbit]]:
        """Return the events of a step, in order; a change of stability without a cause among them is an event, too."""
        events = list(self._events(now, taken, step))
        if not is_explained(now.orbit, taken.orbit, [kind for _, kind, _ in events]):
            events.append(self._stability_change(now, taken, step))
        return sorted(events, key=lambda event: event[0])

    def _stability_change(
        self, now: BranchOrbit, taken: BranchOrbit, step: float
    ) -> tuple[float, str, BranchOrbit]:
        """Return the place along a step where the stability changes, as closely as orbits are found there."""
        same, changed, at = 0.0, step, taken
        while changed - same > LOCATED * step:
            middle = 0.5 * (same + changed)
            found = self.step(now, middle)
            if found is None:
                break
            if found[0].orbit.is_stable == now.orbit.is_stable:
                same = middle
            else:
                changed, at = middle, found[0]
        return changed, STABILITY_CHANGE, at

    def _events(
        self, now: BranchOrbit, taken: BranchOrbit, step: float
    ) -> Iterator[tuple[float, str, BranchOrbit]]:
        settings, is_level = self.settings, False
        for kind in now.tests:
            sign, other = now.tests[kind], taken.tests[kind]
            if np.sign(sign) * np.sign(other) < 0.0 and np.isfinite(sign + other):
                if kind == BRANCH_POINT:
                    found = self._branch_point(now, step)
                    is_level = found is not None and abs(found[1].tangent[-1]) < LEVEL
                else:
                    found = self._located(now, step, kind)
                if found is None and kind == "graze" and now.orbit.body.has_own_period:
                    yield step, SLOWED, now  # an undamped mode in resonance hides the graze itself
                if found is None or (kind == "torus" and not turns_round(found[1].orbit.multipliers)):
                    continue
                # a branch that is level at a branch point turns because of the other branch
                is_end = is_of_graze(kind, found[1].orbit) or (
                    kind == "fold" and turns_at_graze(found[1].orbit)
                )
                if (kind != "fold" or not is_level) and not is_end:
                    yield found[0], end_of(kind, now.orbit, found[1].orbit), found[1]
        for bound in (settings.lowest, settings.highest):
            if now.value == bound and not settings.lowest <= taken.value <= settings.highest:
                yield 0.0, END, now
            elif (now.value - bound) * (taken.value - bound) < 0.0:
                found = self._located(now, step, bound)
                if found is not None:
                    yield found[0], END, replace(found[1], value=bound)

    def _branch_point(self, now: BranchOrbit, step: float) -> tuple[float, BranchOrbit] | None:
        """Return the place along a step where another branch crosses, and the orbit there: equations.md 4.13."""
        span = self.settings.span

        def at(place: float) -> tuple[Floats, float] | None:
            found = (now, 0) if place == 0.0 else self.step(now, place)
            if found is None:
                return None
            moved = found[0].orbit.unknowns - now.orbit.unknowns
            return np.append(moved, (found[0].value - now.value) / span), found[0].border

        for place, moved, slopes in interpolated_zeros(at, step):
            value = now.value + float(moved[-1]) * span
            errors, _, orbit = self.residual(now.orbit, now.orbit.unknowns + moved[:-1], value)
            if np.abs(errors).max() <= INTERPOLATED * CLOSE * orbit.body.scale:
                return place, BranchOrbit(value, orbit, slopes / np.linalg.norm(slopes), 0.0)
        return None

    def _located(self, now: BranchOrbit, step: float, kind: str | float) -> tuple[float, BranchOrbit] | None:
        """Return the place along a step where a test is 0 or the parameter has a value, and the orbit there."""
        from scipy.optimize import brentq

        missing = []

        def at(part: float) -> float:
            found = (now, 0) if part == 0.0 else self.step(now, part)
            if found is None:
                missing.append(part)
                return float(np.nan)
            return found[0].tests[kind] if isinstance(kind, str) else found[0].value - kind

        try:
            part = brentq(at, 0.0, step, xtol=LOCATED * step, rtol=4.0 * np.finfo(float).eps)
        except (ValueError, RuntimeError):
            return None
        found = self.step(now, part) if part > 0.0 and not missing else None
        return None if found is None else (part, found[0])
