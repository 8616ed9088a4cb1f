"""The force that two bodies in contact hold on each other over a step: equal and opposite, so that momentum is exact.

- With a yielding law the force does the work of the law over the step. It is the mean of the elastic part over the way
  (a discrete gradient, so that energy is closed) and of the rest over time.
- With the law restitution, bodies rest on each other after their impacts. Their force leaves no relative velocity at
  the end of the step.

Both forces depend on the end of the step, which is repeated until end and force agree.
"""

from __future__ import annotations

import math

from vibroimpact.orchestrator.importer.pairs.ends import Motion
from vibroimpact.orchestrator.importer.specification import PairSpec
from vibroimpact.orchestrator.importer.stop_contacts.step_path import NODES, StepPath

#: Difference of the held force from the force that the step requires, relative to the contact's largest; below it they
#: agree.
FORCE_TOLERANCE = 1e-12
#: Way over a step, relative to the penetration, below which the elastic force is taken in its middle.
SHORT_WAY = 1e-7
#: Part of the gap that has opened between two resting bodies, closed again in one step.
CLOSING = 0.2


class PairLaw:
    """A yielding law: force and potential of a penetration (m) and its rate (m/s)."""

    def __init__(self, spec: PairSpec) -> None:
        self._stiffness = spec.stiffness
        self._damping = 0.0 if spec.law == "hertz" else spec.damping
        self._exponent = {"kelvin_voigt": 1.0, "hertz": 1.5}.get(spec.law, spec.exponent)
        self._is_linear = spec.law == "kelvin_voigt"

    def elastic(self, penetration: float) -> float:
        """Return the force at rest, N."""
        return self._stiffness * penetration**self._exponent if penetration > 0.0 else 0.0

    def force(self, penetration: float, rate: float) -> float:
        """Return the force, N; it never pulls."""
        if not penetration > 0.0:
            return 0.0
        spring = self.elastic(penetration)
        drag = self._damping * rate * (1.0 if self._is_linear else spring)
        return max(0.0, spring + drag)

    def potential(self, penetration: float) -> float:
        """Return the elastic energy, J."""
        return penetration * self.elastic(penetration) / (self._exponent + 1.0) if penetration > 0.0 else 0.0

    def slope(self, penetration: float) -> float:
        """Return the stiffness, N/m."""
        return self._exponent * self.elastic(penetration) / penetration if penetration > 0.0 else 0.0

    def depth(self, energy: float) -> float:
        """Return the penetration that stores this energy (J), m."""
        power = self._exponent + 1.0
        return float((power * energy / self._stiffness) ** (1.0 / power))

    def mean(self, path: StepPath) -> float:
        """Return the force that does the law's work over a step, N; `path` is the path of the penetration."""
        first, last = path.start, path.end
        way = last - first
        if abs(way) > SHORT_WAY * max(abs(first), abs(last)):
            elastic = (self.potential(last) - self.potential(first)) / way
        else:
            elastic = self.elastic(0.5 * (first + last))
        if self._damping == 0.0:
            return elastic
        rest = 0.0
        for u, weight in NODES:
            penetration, rate = path.at(u)
            rest += weight * (self.force(penetration, rate) - self.elastic(penetration))
        return max(0.0, elastic + rest)


class PairForce:
    """The force of one contact between two bodies over the step under way.

    The value (N) presses both apart; resting bodies, of the law restitution, stay together.
    """

    def __init__(self, spec: PairSpec) -> None:
        self.law = None if spec.law == "restitution" else PairLaw(spec)
        self.begin(0.0)

    def begin(self, mass: float) -> None:
        """Start a run; `mass` is the reduced mass of both points, kg."""
        self._mass = mass
        self.value = self._largest = self._pace = self._rest_gap = 0.0
        self.resting = False
        self._arrival_limit = math.inf
        self._before: tuple[float, float] | None = None

    def start(self, gap: float, closing: float, size: float) -> None:
        """Guess the force of a step of `size` s that starts at this gap (m) and closing speed (m/s)."""
        self._gap, self._closing, self._before = gap, closing, None
        if self.law is not None:
            self.value = self.law.force(-gap + 0.5 * closing * size, closing)

    def arrive(self, closing: float) -> None:
        """Start a contact at this closing speed, m/s: its duration limits its steps."""
        assert self.law is not None
        depth = self.law.depth(0.5 * self._mass * closing * closing) if closing > 0.0 else 0.0
        self._arrival_limit = math.pi * depth / closing if depth > 0.0 else math.inf

    def time_scale(self, gap: float) -> float:
        """Return the duration of a contact this deep, s."""
        assert self.law is not None
        slope = self.law.slope(-gap)
        own = math.pi * math.sqrt(self._mass / slope) if slope > 0.0 else math.inf
        return min(own, self._arrival_limit)

    def corrects(self, gap: float, closing: float, size: float) -> bool:
        """Take the force that the end of a step requires, N; returns whether it is a new force."""
        assert self.law is not None
        answer = self.law.mean(StepPath(-self._gap, self._closing, -gap, closing, size))
        self._largest = max(self._largest, abs(answer))
        force = self.value
        if abs(answer - force) <= FORCE_TOLERANCE * self._largest:
            return False
        self.value = _secant(force, answer, self._before)
        self._before = force, answer
        return self.value != force

    def at(self, now: Motion) -> float:
        """Return the force of the law at the present positions, N."""
        assert self.law is not None
        return self.law.force(-now.gap, now.closing)

    def excess(self, gap: float, closing: float, size: float) -> float:
        """Return the closing speed that a force at rest leaves at the end of a step, m/s."""
        self._pace = max(self._pace, size)
        return closing - CLOSING * (gap - self._rest_gap) / self._pace

    def rest(self, gap: float) -> None:
        """Keep the bodies together from now on, at this gap, m."""
        self.resting, self.value, self._rest_gap = True, 0.0, gap
        self._largest = self._pace = 0.0

    def let_go(self) -> None:
        """End the force between the bodies."""
        self.resting, self.value = False, 0.0


def _secant(force: float, answer: float, before: tuple[float, float] | None) -> float:
    """Return the fixed point of the straight line through two answers; with one answer, that answer."""
    if before is None or force == before[0]:
        return answer
    slope = (answer - before[1]) / (force - before[0])
    return force + (answer - force) / (1.0 - slope) if abs(slope) < 0.9 else answer
