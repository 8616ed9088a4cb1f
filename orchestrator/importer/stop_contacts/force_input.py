"""The force input of a body of any tool, and what a force does to the body: trial steps that leave no trace."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_void_p

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component

#: Trial step: part of the communication step, change of the velocity relative to it, and rounds to get there.
TRIAL_STEP, TRIAL_CHANGE, TRIALS = 1e-3, 1e-3, 40
#: Change of the velocity, relative, that rounding does not blur.
VISIBLE = 1e-9
#: Deviation from the mass alone at which a trial step is short enough, and below which there is none.
NEARLY, ALONE = 0.1, 1e-6
#: What is said of a body that takes no steps of other sizes, though its description declares that it does.
OWN_STEPS = (
    "A body that makes steps of its own takes no [[contact]]: its description should say so "
    "(canHandleVariableCommunicationStepSize = false, fixedInternalStepSize)."
)
#: Largest relative difference between a mass that is given and the one that a trial step finds.
MASS_TOLERANCE = 0.05


class ForceInput:
    """An input that takes the sum of the forces of one or several contacts.

    The parts are the force of each contact, along the displacement, N.
    """

    def __init__(self, body: Component, name: str) -> None:
        self._group = body.group("Float64", [name])
        self.name = name
        self.parts: dict[str, float] = {}

    def write(self, more: float = 0.0) -> None:
        """Give the body the sum, and `more` N."""
        self._group.values[0] = sum(self.parts.values()) + more
        self._group.set()


class TrialSteps:
    """Steps of a body with states from where it is now, each with another force on a point.

    The velocity is the output that says the velocity of the point.
    """

    def __init__(self, body: Component, velocity: str, force: ForceInput) -> None:
        self.body = body
        self.name = f"{body.name}.{velocity}"
        self._velocity = body.group("Float64", [velocity])
        self._input = force
        self._state = c_void_p()
        self._time = math.nan

    @contextmanager
    def untraced(self, time: float) -> Iterator[None]:
        """Leave what is tried inside, from `time` (s) on, without a trace."""
        instance = self.body.instance
        instance.save(self._state)
        self._time = time
        try:
            yield
        finally:
            if not instance.is_fatal:
                instance.restore(self._state)
                self._input.write()
            instance.time = time
            instance.returned_early = instance.needs_event_mode = instance.wants_to_end = False
            instance.is_flagged = False

    def now(self) -> float:
        """Return the velocity before any trial, m/s."""
        return float(self._velocity.get()[0])

    def velocity(self, size: float, force: float = 0.0) -> float:
        """Return the velocity after a step of `size` s with `force` N more, m/s."""
        instance = self.body.instance
        instance.restore(self._state)
        self._input.write(force)
        instance.step_undiscarded(self._time, size)
        return float(self._velocity.get()[0])

    def found_mass(self, time: float, trial: float, longest: float) -> float:
        """Return the effective mass of the point, kg, by steps of `trial` s with and without a small force.

        The steps grow up to `longest`, s, where no force changes the velocity; if none does, it is not a number.
        """
        start, force, mass = self.now(), 1.0, math.nan
        with self.untraced(time):
            for _ in range(TRIALS):
                free = self.velocity(trial)
                reached = self.velocity(trial, force)
                changed = reached - free
                wanted = TRIAL_CHANGE * max(abs(start), abs(reached))
                if abs(changed) <= VISIBLE * abs(reached):
                    force *= 1e6
                    if changed == 0.0:
                        trial = min(2.0 * trial, longest)
                    continue
                mass = force * trial / changed
                if abs(changed) <= 2.0 * wanted or wanted == 0.0:
                    break
                force *= wanted / abs(changed)
        return mass

    def check_mass(self, given: float, time: float, size: float) -> None:
        """Compare a mass that is given (kg) with what a communication step of `size` s says, whole and a part of it.

        A body whose velocity answers no trial is taken at its word. ComponentError: neither agrees.
        """
        trials = (TRIAL_STEP * size, size)
        found = [self.found_mass(time, trial, size) for trial in trials]
        answers = [mass for mass in found if math.isfinite(mass)]
        if answers and not any(agrees(given, mass) for mass in answers):
            self._refuse_own_steps(trials, found, time)
            raise self.mass_error(given, answers, time)

    def rate(self, mass: float, time: float, size: float) -> float:
        """Return a rate (rad/s) at which the body answers a force otherwise than its mass (kg) alone.

        What a force adds to the velocity over a step h is below h/mass by (rate h)^2/6 for a spring. Trial steps begin
        with `size`, s, and are halved until it is nearly h/mass; 0 where it is that to rounding, or never.
        """
        change = abs(self.now()) or 1.0
        with self.untraced(time):
            for _ in range(TRIALS):
                force = mass * change / size
                answer = (self.velocity(size, force) - self.velocity(size)) / change
                if abs(1.0 - answer) <= NEARLY:
                    return math.sqrt(6.0 * abs(1.0 - answer)) / size if abs(1.0 - answer) > ALONE else 0.0
                size *= 0.5
        return 0.0

    def measured_mass(self, time: float, size: float) -> float:
        """Return the effective mass of the point by a part of a communication step of `size` s, kg.

        ComponentError: the whole step changes the velocity as the part does.
        """
        trials = (TRIAL_STEP * size, size)
        found = [self.found_mass(time, trial, size) for trial in trials]
        self._refuse_own_steps(trials, found, time)
        return found[0]

    def _refuse_own_steps(self, trials: Sequence[float], found: Sequence[float], time: float) -> None:
        """Raise the error of a body that makes one step of its own, whatever size it is asked for."""
        if not (all(map(math.isfinite, found)) and agrees(found[0], TRIAL_STEP * found[1])):
            return
        raise ComponentError(
            f"{self.name}: expected a velocity that a force changes the more the longer a trial step is, got the same "
            f"change over {trials[0]:.3g} s and {trials[1]:.3g} s at time {time:.12g}. {OWN_STEPS}",
            instance=self.body.name,
            time=time,
        )

    def mass_error(self, given: float, found: Sequence[float], time: float) -> ComponentError:
        """Return the error of a mass that is none of those that trial steps find."""
        least, most = min(found), max(found)
        masses = f"{most:.6g}" if agrees(least, most) else f"{least:.6g} to {most:.6g}"
        return ComponentError(
            f"{self.name}: expected a body of the given mass, {given:.6g} kg, got an effective mass of {masses} kg "
            f"in a trial step at time {time:.12g}. Give [[contact]] the mass that {self._input.name} moves.",
            instance=self.body.name,
            time=time,
        )

    def free(self) -> None:
        """Give back the saved state, before the body is freed."""
        if self._state and not self.body.instance.is_fatal:
            self.body.instance.free_state(self._state)


def agrees(given: float, found: float) -> bool:
    """Is a given mass the one that was found, as far as steps are chosen by it?

    >>> agrees(1.0, 1.01), agrees(1000.0, 1.0)
    (True, False)
    """
    return abs(given - found) <= MASS_TOLERANCE * abs(found)
