"""The impulse of a body in model exchange: its continuous states jump, and an event mode follows.

An impulse J on a point moves the states by J B, with B = d(derivatives of the states)/d(force on the point). B comes
from the FMU's directional derivative, or from differences of two sizes. They must agree: an impulse is a force without
limit, so the derivatives must be linear in it. Trials give the effective mass, J over the change of the velocity.

A body without a force input has a velocity that is a continuous state, or equals one. An impact sets that state.
docs/equations.md 6.18 has the rules.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.instance import WARNING
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import BodyPoint
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInput, TrialSteps, agrees

#: Factor between the forces of the two differences, and the largest force, N. The smaller force changes derivatives by
#: about their own size, the larger one is that of a blow.
HARDER, LARGEST = 2.0**40, 1e300
#: Relative difference of two results for B, above which the derivatives are not linear in the force.
BEND = 1e-6
#: First force of a difference, N, its factor while no derivative changes, and most trials.
FIRST_FORCE, MORE, TRIALS = 1.0, 1e6, 60
#: Most corrections of a jump, and the misfit of the velocity, relative to it, that ends them.
CORRECTIONS, MISFIT = 4, 2e-16
#: Largest misfit of the velocity, relative to it, that is accepted.
ROUNDED = 1e-13
#: Mass of a body without a force input, kg, where none is given: no result but the impulse depends on it.
UNKNOWN_MASS = 1.0


class StateJump(ABC):
    """The impulses of one point of a body in model exchange, in the form of a `Pulse`; none is ever owed.

    `given` is the given effective mass, kg, or None. `knows_mass`: impulses have a value in N s.
    """

    owed = 0.0
    knows_mass = True

    def __init__(self, body: Component, point: BodyPoint) -> None:
        assert isinstance(body.instance, ExchangeInstance)
        self._body, self._instance = body, body.instance
        self._name = f"{body.name}.{point.velocity}"
        self._velocity = body.group("Float64", [point.velocity])
        self.given: float | None = point.mass
        self.ready = False

    @abstractmethod
    def begin(self, time: float) -> None:
        """Start a run at `time`, s; ComponentError for a body that takes no impulses."""

    @property
    @abstractmethod
    def mass(self) -> float:
        """Impulse over the change of the velocity, kg."""

    @abstractmethod
    def strike(self, impulse: float) -> None:
        """Give the point an impulse along its displacement, N s."""

    def measure(self, time: float) -> None:
        """Expect another mass from now on, at `time`, s."""
        self._time = time

    @property
    def wants_to_end(self) -> bool:
        """Has an event mode after an impulse asked for the end of the run?"""
        return self._instance.jump_ends

    def _now(self) -> float:
        return float(self._velocity.get()[0])

    def _velocity_at(self, states: NDArray[np.float64]) -> float:
        self._instance.show(states)
        return self._now()

    def _error(self, expected: str, got: str) -> ComponentError:
        return ComponentError(
            f"{self._name}: expected {expected}, got {got}, at time {self._time:.12g}. A body in model exchange takes "
            "a rigid impact by a force input in which the derivatives of its states are linear, or by a velocity that "
            "is a continuous state.",
            instance=self._body.name,
            time=self._time,
        )


class StateImpulse(StateJump):
    """The impulses of a point on which a force input acts."""

    def __init__(self, body: Component, point: BodyPoint, force: ForceInput) -> None:
        super().__init__(body, point)
        self._input = force
        self._trials = TrialSteps(body, point.velocity, force)
        self._force = body.variables[force.name].valueReference

    def begin(self, time: float) -> None:
        """Start a run at `time`, s: measure the mass, and compare it with the given mass."""
        self._time, self._is_stale = time, True
        if ("Float64", self._force) in self._instance.facts.discrete:
            raise self._error("a continuous force input", f"{self._input.name}, which is discrete")
        self._trusts = self._instance.facts.gives_derivatives
        if self.given is not None and not agrees(self.given, self.mass):
            raise self._trials.mass_error(self.given, [self.mass], time)
        self.ready = True

    def measure(self, time: float) -> None:
        """Measure the mass anew where it is needed next, at `time`, s."""
        super().measure(time)
        self._is_stale = True

    @property
    def mass(self) -> float:
        """Impulse over the change of the velocity, kg, at the instant of the last `measure`."""
        if self._is_stale:
            self._slope = self._measured_slope()
            self._mass = self._measured_mass()
            self._is_stale = False
        return self._mass

    def strike(self, impulse: float) -> None:
        """Give the point an impulse along its displacement, N s: the velocity changes by impulse / mass."""
        start, before, jump = self._instance.states, self._now(), impulse
        reached = before + impulse / self.mass
        for _ in range(CORRECTIONS):
            missed = reached - self._velocity_at(start + jump * self._slope)
            if abs(missed) <= MISFIT * (abs(before) + abs(reached)):
                break
            jump += missed * self.mass
        if not abs(missed) <= ROUNDED * (abs(before) + abs(reached)):
            raise self._error(
                f"a velocity of {reached:.6g} m/s after an impulse", f"one off by {missed:.3g} m/s"
            )
        self._instance.jump(start + jump * self._slope)

    # ---- measuring ----

    def _measured_slope(self) -> NDArray[np.float64]:
        """Return B, by the directional derivative where it agrees with the difference."""
        try:
            slope, harder = self._differences()
        finally:
            if not self._instance.is_fatal:
                self._input.write()
        bend = np.abs(slope - harder)
        if not np.all(bend <= BEND * np.maximum(np.abs(slope), np.abs(harder))):
            most = int(np.argmax(bend))
            raise self._error(
                f"derivatives that are linear in {self._input.name}",
                f"slopes {slope[most]:.6g} and {harder[most]:.6g} of one of them at {HARDER:.3g} times the force",
            )
        references = self._instance.facts.derivatives
        if self._trusts and len(references) == len(slope):
            status, exact = self._instance.directional_derivative(references, self._force)
            if status <= WARNING and np.all(np.abs(exact - slope) <= BEND * np.abs(slope)):
                return exact
            self._trusts = False
        return slope

    def _differences(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return B by two differences, of forces that change the derivatives about by themselves, and far more."""
        free = np.abs(self._instance.derivatives())
        force = FIRST_FORCE
        for _ in range(TRIALS):
            slope = np.abs(self._difference(force))
            moved = slope > 0.0
            if moved.any():
                force = float(np.max(free[moved] / slope[moved])) or force
                return self._difference(force), self._difference(min(HARDER * force, LARGEST))
            force *= MORE
        raise self._error(f"derivatives that follow {self._input.name}", "some that do not change")

    def _difference(self, force: float) -> NDArray[np.float64]:
        self._input.write(force)
        more = self._instance.derivatives()
        self._input.write(-force)
        with np.errstate(over="ignore", invalid="ignore"):  # judged by the caller
            change: NDArray[np.float64] = 0.5 * (more - self._instance.derivatives())
            return change / force

    def _measured_mass(self) -> float:
        """Return the mass by two jumps of the states, after which the states are as before."""
        start, before, moved = self._instance.states, self._now(), self._slope != 0.0
        impulse = float(np.min(np.maximum(np.abs(start[moved]), 1.0) / np.abs(self._slope[moved])))
        try:
            changed = self._velocity_at(start + impulse * self._slope) - before
            if before and changed:
                impulse *= abs(before / changed)
            one, two = (self._velocity_at(start + n * impulse * self._slope) - before for n in (1.0, 2.0))
        finally:
            if not self._instance.is_fatal:
                self._instance.show(start)
        if not (one and math.isfinite(one) and abs(two - 2.0 * one) <= BEND * abs(two)):
            raise self._error(
                "a velocity that is linear in an impulse",
                f"changes by {one:.6g} and {two:.6g} m/s for twice as much",
            )
        if one < 0.0:
            raise self._error("a velocity that grows with its force", "one that falls: look at the signs")
        return impulse / one


class StateVelocity(StateJump):
    """The impulses of a point without a force input, whose velocity is a state."""

    def begin(self, time: float) -> None:
        """Start a run at `time`, s: find the state that is the velocity."""
        self._time, self.ready = time, True
        self.knows_mass = self.given is not None
        start, before = self._instance.states, self._now()
        try:
            same = [i for i in range(len(start)) if start[i] == before and self._is_velocity(start, i)]
            alone = len(same) == 1 and not any(
                self._velocity_at(_moved(start, i)) != before for i in range(len(start)) if i != same[0]
            )
        finally:
            if not self._instance.is_fatal:
                self._instance.show(start)
        if not alone:
            raise self._error("a force input, or a velocity that is a continuous state", "neither")
        self._place = same[0]

    def _is_velocity(self, start: NDArray[np.float64], place: int) -> bool:
        moved = _moved(start, place)
        return bool(self._velocity_at(moved) == moved[place])

    @property
    def mass(self) -> float:
        """The given effective mass, kg, or 1: impulses without a given mass have no value."""
        return self.given or UNKNOWN_MASS

    def strike(self, impulse: float) -> None:
        """Change the velocity by the impulse, N s, over the mass."""
        states = self._instance.states
        states[self._place] += impulse / self.mass
        self._instance.jump(states)


def _moved(states: NDArray[np.float64], place: int) -> NDArray[np.float64]:
    """Return the states with another value of one of them."""
    moved = states.copy()
    moved[place] += 1.0 + abs(moved[place])
    return moved
