"""Algebraic loops: inputs that depend on each other at one instant, solved by Newton's method.

A loop's inputs x are consistent where the outputs that they cause, times the gains of the connections, are these
inputs: F(x) = x. The slopes G of F come from the FMUs' directional derivatives or from differences. Between two
evaluations of the slopes, Broyden's good method corrects them (Broyden, Math. Comp. 19 (1965) 577).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.loops.link import Link
from vibroimpact.orchestrator.importer.loops.slopes import Slopes, scaling_of, singular_values

Floats = NDArray[np.float64]

#: Most steps of Newton's method, and most halvings of a step that makes the residual no smaller.
NEWTON_STEPS = 60
HALVINGS = 12
#: Relative residual that is rounding, and most steps from a solution towards it.
ROUNDING, POLISHING_STEPS = 1e-15, 3
#: Ratio of the residuals after and before a step, above which the slopes are evaluated anew, and below which they need
#: no correction.
SLOW, EXACT = 0.25, 1e-6
#: Least relative decrease of the residual, for the whole step, that keeps a step.
LEAST_DECREASE = 1e-4
#: Most substitutions of the whole numbers and truth values in a loop, for each connection.
SUBSTITUTIONS = 100
#: Singular value of I - G, relative to the largest and at least to 1, below which a loop counts as singular.
#: Differences have errors of 1e-10.
SINGULAR = 1e-8


class Loop:
    """One algebraic loop.

    Parameters
    ----------
    links : sequence of Link
        Its connections.
    depends : sequence of frozenset of int
        For each connection the connections, by their places in the loop, that its output is declared to depend on.

    Attributes
    ----------
    name : str
        Its connections.
    x : ndarray, shape (connections,)
        Its inputs: the last solution, at which the next one begins.
    residual, worst : float
        Largest relative change of its inputs that the last solution leaves, and the largest of the run.
    is_singular : bool
        The slopes at a solution have left a combination of inputs open.
    """

    def __init__(self, links: Sequence[Link], depends: Sequence[frozenset[int]], slopes: Slopes) -> None:
        self.links = tuple(links)
        self.name = " , ".join(link.name for link in links)
        self._slopes = slopes
        self._depends = depends
        self._real = np.array([link.is_real for link in links])
        self._tolerances = np.array([link.tolerance for link in links])
        self._nominals = np.array([link.nominal for link in links])
        self.x = np.zeros(len(links))
        self.begin()

    def begin(self) -> None:
        """Forget slopes and sizes of an earlier run."""
        self._g: Floats | None = None
        self._inverse: Floats | None = None
        self._first, self._ratios = _joined(self.links)
        self._units = np.ones(len(self.links))
        self._is_stale = True
        self._seen = np.zeros(len(self.links))
        self.residual, self.worst, self.is_singular = 0.0, 0.0, False

    def take_start(self) -> None:
        """Begin the next solution at the present values of the inputs, of which one output gives like values."""
        starts = np.array([link.start() for link in self.links])
        self._first, self._ratios = _joined(self.links)
        self.x = np.where(self._real, self._ratios @ starts[self._first], starts)

    def solve(self, time: float) -> None:
        """Make the inputs consistent at `time`, s; ComponentError with names and residual if they do not become so."""
        for _ in range(SUBSTITUTIONS * len(self.links)):
            values = self._solve_real(time)
            if not np.all(np.isfinite(values)):
                raise self._error(time, values, "values without a number beside the solution")
            changed = np.flatnonzero(~self._real & (values != self.x))
            if len(changed) == 0:
                self.worst = max(self.worst, self.residual)
                return
            self.x[changed[0]] = values[changed[0]]  # one at a time: the others may not change any more
        names = " , ".join(link.name for link in self.links if not link.is_real)
        raise ComponentError(
            f"algebraic loop {self.name} at time {time:.17g}: expected whole numbers, truth values and values of "
            f"clocks that settle by substitution, got {names} that still change after {SUBSTITUTIONS} substitutions "
            f"each (relative residual of the real numbers {self.residual:.3g}). "
            "Break the loop with a component that has a state.",
            time=time,
        )

    def write(self) -> None:
        """Write the inputs of the last solution."""
        for link, value in zip(self.links, self.x, strict=True):
            link.write(value)

    def check_solution(self) -> None:
        """Evaluate the slopes at the solution, and note whether it is singular."""
        if np.any(self._real):
            self._renew(self._evaluate(self.x))
            self._evaluate(self.x)
            self.is_singular = self.is_singular or self._smallest() <= SINGULAR

    # ---- Newton's method ----

    def _solve_real(self, time: float) -> Floats:
        """Solve for the real numbers, the others held; returns the values that the solution's outputs give."""
        values = self._evaluate(self.x)
        start = np.where(self._real, values, self.x)
        if not np.all(np.isfinite([self.x, start])):
            raise self._error(time, values, "no finite values to begin at (start values of its inputs help)")
        found, solved = self._iterate(values)
        if not solved:  # once more from the values that the outputs give at the start
            self.x = start
            found, solved = self._iterate(self._evaluate(start))
        if not solved:
            self._settle_for(time, found)
        self._seen = np.maximum(self._seen, np.abs(self.x))
        return found

    def _iterate(self, values: Floats) -> tuple[Floats, bool]:
        """Step to smaller residuals; returns the last values that the outputs give, and whether they are consistent."""
        for count in range(NEWTON_STEPS + 1):
            rest = self._rest(values)
            sizes = np.maximum(np.abs(self.x), np.abs(np.where(self._real, values, 0.0)))
            if np.all(np.abs(rest) <= ROUNDING * sizes):
                self.residual = float(np.max(np.abs(rest) / np.where(sizes > 0.0, sizes, 1.0), initial=0.0))
                return values, True
            scale = self._scale(values)
            self.residual = float(np.max(np.abs(rest) / scale, initial=0.0))
            if np.all(np.abs(rest) <= self._tolerances * scale):
                return self._polish(values, rest), True
            found = self._improve(values, rest) if count < NEWTON_STEPS else None
            if found is None:
                break
            values = found
        return values, False

    def _polish(self, values: Floats, rest: Floats) -> Floats:
        """Make steps from a solution while they make its residual smaller; returns the values there.

        Moves between two solutions multiply a residual by the gain of the loop.
        """
        for _ in range(POLISHING_STEPS):
            if self._g is None or self.residual <= ROUNDING:
                break
            found = self._try_step(values, rest, halvings=0)
            if found is None:
                break
            values, rest = found, self._rest(found)
            self.residual = float(np.max(np.abs(rest) / self._scale(values), initial=0.0))
        return values

    def _improve(self, values: Floats, rest: Floats) -> Floats | None:
        """Make one step to smaller residuals; returns the values there, or None where no step finds any."""
        was_stale = self._is_stale
        if was_stale:
            self._renew(values)
        found = self._try_step(values, rest)
        if found is None and not was_stale:
            self._renew(values)
            found = self._try_step(values, rest)
        return found

    def _try_step(self, values: Floats, rest: Floats, halvings: int = HALVINGS) -> Floats | None:
        """Make a Newton step, halved until it makes the residual smaller; a step that may be halved corrects G."""
        if self._inverse is None:
            self._inverse = self._pseudo_inverse()
        weights, scale = 1.0 / self._units, self._scale(values)
        before = _sizes(rest, weights, scale)
        start, step, share = self.x, self._inverse @ rest, 1.0
        if not np.all(np.isfinite(step)):
            return None
        for _ in range(halvings + 1):
            self.x = start + share * step
            there = self._evaluate(self.x)
            after = _sizes(self._rest(there), weights, scale)
            if np.any(after <= (1.0 - LEAST_DECREASE * share) * before):  # false for NaN
                if halvings and after[0] > EXACT * before[0]:  # else the response to the step is rounding
                    self._correct(self.x - start, there - values, weights)
                    self._is_stale = bool(after[0] > SLOW * before[0])
                return there
            share /= 2.0
        self.x = start
        self._evaluate(start)
        return None

    def _pseudo_inverse(self) -> Floats:
        """Return (I - G)^-1 without the combinations of inputs that the loop leaves open; NaN where G is not finite."""
        g = self._joint_slopes()
        d = scaling_of(g)
        matrix = np.eye(len(d)) - g * d[None, :] / d[:, None]
        if not np.all(np.isfinite(matrix)):
            return np.full((len(self.x), len(self.x)), np.nan)
        u, sizes, v = np.linalg.svd(matrix)
        is_open = sizes <= SINGULAR * max(1.0, float(sizes[0]))
        shares = np.where(is_open, 0.0, 1.0) / np.where(is_open, 1.0, sizes)
        found = np.zeros((len(self.x), len(self.x)))
        found[:, self._first] = self._ratios @ (d[:, None] * (v.T * shares @ u.T) / d[None, :])
        found[~self._real] = 0.0
        return found

    def _joint_slopes(self) -> Floats:
        """Return the slopes over one input of each output: inputs that share an output depend on nothing more."""
        assert self._g is not None
        found: Floats = self._g[self._first] @ self._ratios
        return found

    def _correct(self, moved: Floats, responded: Floats, weights: Floats) -> None:
        """Correct the slopes by Broyden's good method, in scaled inputs."""
        assert self._g is not None
        along = np.where(self._real, weights**2 * moved, 0.0)
        size = float(along @ moved)
        if size > 0.0 and np.all(np.isfinite(responded[self._real])):
            missed = np.where(self._real, responded - self._g @ moved, 0.0)
            self._g = self._g + np.outer(missed, along / size)
            self._inverse = None

    def _renew(self, values: Floats) -> None:
        """Evaluate the slopes at the present inputs, at which the outputs give `values`."""
        self._g = self._slopes.at(self.links, self._depends, self.x, values)
        units = np.abs(self._ratios) @ scaling_of(self._joint_slopes())
        self._units, self._inverse = np.where(units > 0.0, units, 1.0), None
        self._is_stale = False

    # ---- residuals ----

    def _evaluate(self, x: Floats) -> Floats:
        """Write inputs and return what the outputs give; NaN where an FMU discards them."""
        if not all([link.write(value) for link, value in zip(self.links, x, strict=True)]):
            return np.full(len(x), np.nan)
        return np.array([link.read() for link in self.links])

    def _rest(self, values: Floats) -> Floats:
        return np.where(self._real, values - self.x, 0.0)

    def _scale(self, values: Floats) -> Floats:
        """Return the sizes of the terms of which the inputs are sums, and so of their rounding."""
        sizes = np.maximum(np.abs(self.x), np.abs(np.where(self._real, values, 0.0)))
        if self._g is not None and np.all(np.isfinite(self._g)):
            sizes = np.maximum(sizes, np.max(np.abs(self._g * self.x[None, :]), axis=1))
        return np.where(sizes > 0.0, sizes, 1.0)

    def _settle_for(self, time: float, values: Floats) -> None:
        """Accept a residual that no step makes smaller if it is the rounding of larger values, else raise."""
        floor = np.maximum(np.maximum(self._seen, self._nominals), self._scale(values))
        rest = np.abs(self._rest(values))
        if np.all(rest <= self._tolerances * floor):
            self.residual = float(np.max(rest / floor, initial=0.0))
            return
        self._renew(values)
        raise self._error(time, values, self._verdict())

    def _smallest(self) -> float:
        """Return the smallest singular value of I - G, over the largest and at least over 1."""
        sizes = singular_values(self._joint_slopes())
        return float(sizes[-1] / max(1.0, sizes[0]))

    def _verdict(self) -> str:
        """Return the reason in the slopes of a loop that has not settled."""
        assert self._g is not None
        if not np.all(np.isfinite(self._g)):
            return "slopes that are not finite"
        slopes = self._joint_slopes()
        smallest, gain = self._smallest(), 1.0 - float(np.linalg.det(np.eye(len(slopes)) - slopes))
        numbers = f"smallest singular value of I - G {smallest:.3g}, gain 1 - det(I - G) = {gain:.6g}"
        if smallest <= SINGULAR:
            return f"a singular loop without a solution ({numbers})"
        return f"no inputs nearby with a smaller residual ({numbers})"

    def _error(self, time: float, values: Floats, got: str) -> ComponentError:
        rest = float(np.max(np.abs(self._rest(values)), initial=0.0))
        return ComponentError(
            f"algebraic loop {self.name} at time {time:.17g}: expected inputs that equal the outputs they cause, "
            f"got {got}; residual {rest:.3g}, relative residual {self.residual:.3g}. "
            "Break the loop with a component that has a state, or change its gain.",
            time=time,
        )


def _sizes(rest: Floats, weights: Floats, scale: Floats) -> Floats:
    """Return two sizes of a residual: in the units of the inputs, and relative to the terms of which they are sums.

    The first is rounding where large inputs are solved before small ones.
    """
    return np.array([np.linalg.norm(weights * rest), np.max(np.abs(rest) / scale, initial=0.0)])


def _joined(links: Sequence[Link]) -> tuple[NDArray[np.intp], Floats]:
    """Return the links with an output of their own, and the ratios of all inputs to those of these links.

    Real links from one output are joined: the largest gain stands for them.
    """
    groups: dict[object, list[int]] = {}
    for i, link in enumerate(links):
        groups.setdefault(link.output if link.is_real else i, []).append(i)
    first = [max(group, key=lambda i: abs(links[i].gain)) for group in groups.values()]
    ratios = np.zeros((len(links), len(first)))
    for k, group in enumerate(groups.values()):
        for i in group:
            ratios[i, k] = 1.0 if i == first[k] else links[i].gain / (links[first[k]].gain or 1.0)
    return np.array(first), ratios
