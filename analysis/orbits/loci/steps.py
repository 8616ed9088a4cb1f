"""Steps along a locus of bifurcations over two parameters: equations.md 4.7 and 4.20.

The unknowns are those of the orbit and both parameters over their ranges. The errors of the orbit are joined by the
function that is 0 at the bifurcation. Symmetric orbits keep their symmetry: half of the errors are their distances from
it, so that the equations stay regular at a pitchfork.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vibroimpact.analysis.orbits.bifurcations import Bifurcation, LocusPoint
from vibroimpact.analysis.orbits.following import LOCATED, MOST_NEWTON, MOST_TURN, FollowSettings
from vibroimpact.analysis.orbits.mirrored_halves import halves_of
from vibroimpact.analysis.orbits.periodic import OrbitError, PeriodicOrbit, tried
from vibroimpact.analysis.orbits.pitchforks import PITCHFORK
from vibroimpact.analysis.orbits.symmetry import mirrored_contacts
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

CHANGE = 1e-6
"""Change of an unknown for derivatives by differences; their error costs a Newton step, but no digit."""
FOUND = 1e-13
"""Change of the unknowns below which they count as found."""
ZERO = 1e-6
"""Value of a function at the first point, over its value a step further, below which the locus begins at its zero."""
OFF_CHORD = 0.05
"""Distance from the line between two points of a locus, over their distance, below which an orbit is on the locus."""
BESIDE = 1e-3
"""Change of each parameter, over its range, at which the body must still have its mirror symmetry."""

BodyAt2 = Callable[[float, float], ImpactingBody]


class LocusSteps:
    """Equations of a bifurcation of a body that depends on two parameters, and steps along their solutions.

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

    def _kept_symmetric(self, start: Bifurcation) -> Bifurcation:
        """Return a bifurcation whose locus has symmetric orbits alone, if its orbit and both parameters are so."""
        halves = None if start.kind == "period doubling" else halves_of(start.orbit)
        if halves is not None and self._keep_symmetry(start.values):
            return replace(start, halves=halves)
        if start.kind == PITCHFORK:
            raise OrbitError(
                "loci: expected a pitchfork of symmetric orbits, and parameters that keep the mirror symmetry."
            )
        return start

    def _keep_symmetry(self, values: tuple[float, float]) -> bool:
        """Return whether the body has its mirror symmetry at other values of each parameter, too."""
        for place, settings in enumerate(self._ranges):
            moved = list(values)
            inwards = 1.0 if values[place] < 0.5 * (settings.lowest + settings.highest) else -1.0
            moved[place] += inwards * BESIDE * settings.span
            if mirrored_contacts(self._body_at(moved[0], moved[1])) is None:
                return False
        return True

    def _unknowns(self, orbit: PeriodicOrbit, values: tuple[float, float]) -> Floats:
        return np.concatenate([orbit.unknowns, np.array(values) / self._spans])

    def _made(self, orbit: PeriodicOrbit, unknowns: Floats) -> tuple[PeriodicOrbit, Floats]:
        """Return the orbit of some unknowns, with its errors over the size of the motion."""
        values = unknowns[-2:] * self._spans
        body = self._body_at(float(values[0]), float(values[1]))
        found = tried(body, orbit, unknowns[:-2])
        return found.orbit, found.errors / body.scale

    def _equations(self, start: Bifurcation, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        made, errors = self._made(orbit, unknowns)
        test = start.test(made)
        if start.halves is not None:
            errors = start.halves.errors(errors, unknowns[:-2])
        if not np.isfinite(test):
            raise OrbitError("loci: expected impacts with a speed, and a maximum between them; got none.")
        return np.append(errors, test)

    def _slopes(self, start: Bifurcation, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        columns = []
        for k in range(unknowns.size):
            ends = []
            for side in (1.0, -1.0):
                moved = unknowns.copy()
                moved[k] += side * CHANGE
                ends.append(self._equations(start, orbit, moved))
            columns.append((ends[0] - ends[1]) / (2.0 * CHANGE))
        return np.column_stack(columns)

    def _tangent(self, start: Bifurcation, orbit: PeriodicOrbit, unknowns: Floats) -> Floats:
        return np.asarray(np.linalg.svd(self._slopes(start, orbit, unknowns))[2][-1], dtype=np.float64)

    def _step(
        self, start: Bifurcation, now: LocusPoint, step: float, most_turn: float = MOST_TURN
    ) -> tuple[LocusPoint, int] | None:
        begin = self._unknowns(now.orbit, now.values)
        unknowns = begin + step * now.tangent
        try:
            slopes = self._slopes(start, now.orbit, unknowns)
            for newton in range(MOST_NEWTON):  # noqa: B007  # the number is returned
                residual = self._equations(start, now.orbit, unknowns)
                matrix = np.vstack([slopes, now.tangent])
                off = step - now.tangent @ (unknowns - begin)
                change = np.linalg.solve(matrix, np.append(-residual, off))
                if not np.abs(change).max() < 0.5:
                    return None
                unknowns = unknowns + change
                if np.abs(change).max() < FOUND * (1.0 + np.abs(unknowns).max()):
                    break
            else:
                return None
            orbit = self._made(now.orbit, unknowns)[0]
            tangent = self._tangent(start, orbit, unknowns)
        except (OrbitError, np.linalg.LinAlgError):
            return None
        if tangent @ now.tangent < 0.0:
            tangent = -tangent
        if tangent @ now.tangent < np.cos(most_turn):
            return None
        values = unknowns[-2:] * self._spans
        return LocusPoint((float(values[0]), float(values[1])), orbit, tangent), newton

    def _closes(self, first: LocusPoint, now: LocusPoint, taken: LocusPoint) -> bool:
        """Tell whether a step passes the first point of the locus, in the direction of the first step."""
        here, ahead, goal = (self._unknowns(each.orbit, each.values) for each in (now, taken, first))
        step, left = ahead - here, goal - here
        length = float(np.linalg.norm(step))
        part = float(left @ step) / length**2
        off = float(np.linalg.norm(left - part * step))
        return 0.0 < part <= 1.0 and off < OFF_CHORD * length and bool(first.tangent @ step > 0.0)

    def _matrix(self, start: Bifurcation, orbit: PeriodicOrbit, unknowns: Floats, second: Floats) -> Floats:
        """Return the derivatives of the errors by the unknowns of an orbit and the first parameter."""
        columns = []
        for axis in np.eye(unknowns.size) * CHANGE:
            ends = [
                self._equations(start, orbit, np.append(unknowns + side * axis, second))[:-1]
                for side in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]) / (2.0 * CHANGE))
        return np.column_stack(columns)

    def _zero(
        self,
        start: Bifurcation,
        now: LocusPoint,
        taken: LocusPoint,
        step: float,
        test: Callable[[LocusPoint], float],
        is_first: bool,
    ) -> tuple[float, LocusPoint] | None:
        """Return the part of a step at which a function changes its sign, and the point there; None without one."""
        before, after = test(now), test(taken)
        if not before * after < 0.0 or (is_first and abs(before) < ZERO * abs(after)):
            return None
        return self._located(start, now, step, test)

    def _last(
        self, start: Bifurcation, now: LocusPoint, step: float, holds: Callable[[LocusPoint], bool]
    ) -> tuple[float, LocusPoint]:
        """Return the last point of a step for which a condition holds, after its part of the step.

        Beyond it there may be no points.
        """
        part, beyond, last = 0.0, step, now
        while beyond - part > LOCATED * step:
            middle = 0.5 * (part + beyond)
            found = self._step(start, now, middle)
            if found is None or not holds(found[0]):
                beyond = middle
            else:
                part, last = middle, found[0]
        return part, last

    def _located(
        self, start: Bifurcation, now: LocusPoint, step: float, test: Callable[[LocusPoint], float]
    ) -> tuple[float, LocusPoint] | None:
        from scipy.optimize import brentq

        def at(part: float) -> float:
            found = (now, 0) if part == 0.0 else self._step(start, now, part)
            return float(np.nan) if found is None else test(found[0])

        try:
            part = brentq(at, 0.0, step, xtol=LOCATED * step, rtol=4.0 * np.finfo(float).eps)
        except (ValueError, RuntimeError):
            return None
        found = self._step(start, now, part)
        return None if found is None else (part, found[0])
