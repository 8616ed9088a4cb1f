"""The force input of a body of any tool, and trial steps that show the effect of a force and leave no trace."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_void_p

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component

#: Trial step: part of the communication step, target change of the velocity relative to it, most rounds.
TRIAL_STEP, TRIAL_CHANGE, TRIALS = 1e-3, 1e-3, 40
#: Relative change of the velocity, below which rounding blurs it.
VISIBLE = 1e-9
#: Relative deviation of the response from the mass alone: a trial step is short enough below NEARLY, and a deviation
#: below ALONE counts as 0.
NEARLY, ALONE = 0.1, 1e-6
#: Hint for a body that takes no steps of other sizes, although its description declares that it does.
OWN_STEPS = (
    "A body that makes steps of its own takes no [[contact]]: its description should say so "
    "(canHandleVariableCommunicationStepSize = false, fixedInternalStepSize)."
)
#: Largest relative difference between a given mass and the mass that a trial step finds.
MASS_TOLERANCE = 0.05


class ForceInput:
    """An input that takes the sum of the forces of one or several contacts.

    `parts` holds the force of each contact along the displacement, N.
    """

    def __init__(self, body: Component, name: str | None) -> None:
        self._group = None if name is None else body.group("Float64", [name])
        self.name = name or "none"
        self.parts: dict[str, float] = {}

    def write(self, more: float = 0.0) -> None:
        """Write the sum of the parts, plus `more` N, to the body; a body without a force input gets none."""
        if self._group is not None:
            self._group.values[0] = sum(self.parts.values()) + more
            self._group.set()


#: Force inputs by component and name; a body without a force input has one of the name None.
ForceInputs = dict[tuple[str, str | None], ForceInput]


def force_input_of(body: Component, name: str | None, inputs: ForceInputs) -> ForceInput:
    """Return the force input of this name, which all its contacts share; None: no input."""
    return inputs.setdefault((body.name, name), ForceInput(body, name))


class TrialSteps:
    """Steps of a body with states from its present state, each with another force on a point.

    `velocity` is the output with the velocity of the point.
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
        """Restore the body's state on exit: trials inside, from `time` (s) on, leave no trace."""
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
        """Return the velocity after a step of `size` s with an additional force, N, in m/s."""
        instance = self.body.instance
        instance.restore(self._state)
        self._input.write(force)
        instance.step_undiscarded(self._time, size)
        return float(self._velocity.get()[0])

    def found_mass(self, time: float, trial: float, longest: float) -> float:
        """Return the effective mass of the point, kg, by steps of `trial` s with and without a small force.

        The steps grow up to `longest`, s, while no force changes the velocity. Without any change the mass is NaN.
        """
        start, force, mass = self.now(), 1.0, math.nan
        with self.untraced(time):
            for _ in range(TRIALS):
                free = self.velocity(trial)
                reached = self.velocity(trial, force)
                changed = reached - free
                target = TRIAL_CHANGE * max(abs(start), abs(reached))
                if abs(changed) <= VISIBLE * abs(reached):
                    force *= 1e6
                    if changed == 0.0:
                        trial = min(2.0 * trial, longest)
                    continue
                mass = force * trial / changed
                if abs(changed) <= 2.0 * target or target == 0.0:
                    break
                force *= target / abs(changed)
        return mass

    def check_mass(self, given: float, time: float, size: float) -> None:
        """Compare a given mass (kg) with the masses found by a communication step of `size` s and by a part of it.

        A given mass stands if no trial changes the velocity. ComponentError: the given mass agrees with neither.
        """
        trials = (TRIAL_STEP * size, size)
        found = [self.found_mass(time, trial, size) for trial in trials]
        answers = [mass for mass in found if math.isfinite(mass)]
        if answers and not any(agrees(given, mass) for mass in answers):
            self._refuse_own_steps(trials, found, time)
            raise self.mass_error(given, answers, time)

    def rate(self, mass: float, time: float, size: float) -> float:
        """Return the rate (rad/s) at which the body's response to a force departs from its mass (kg) alone.

        For a spring, a force changes the velocity over a step h by (rate h)^2/6 less than h/mass, relatively. Trial
        steps begin with `size`, s, and are halved until the change is nearly h/mass. The result is 0 if the change is
        h/mass to rounding, or never near it.
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

        ComponentError: the whole step changes the velocity as much as the part does.
        """
        trials = (TRIAL_STEP * size, size)
        found = [self.found_mass(time, trial, size) for trial in trials]
        self._refuse_own_steps(trials, found, time)
        return found[0]

    def _refuse_own_steps(self, trials: Sequence[float], found: Sequence[float], time: float) -> None:
        """Raise ComponentError for a body that makes one step of its own, whatever size is requested."""
        if not (all(map(math.isfinite, found)) and agrees(found[0], TRIAL_STEP * found[1])):
            return
        raise ComponentError(
            f"{self.name}: expected a velocity that a force changes the more the longer a trial step is, got the same "
            f"change over {trials[0]:.3g} s and {trials[1]:.3g} s at time {time:.12g}. {OWN_STEPS}",
            instance=self.body.name,
            time=time,
        )

    def mass_error(self, given: float, found: Sequence[float], time: float) -> ComponentError:
        """Return the error of a given mass that no trial step finds."""
        least, most = min(found), max(found)
        masses = f"{most:.6g}" if agrees(least, most) else f"{least:.6g} to {most:.6g}"
        return ComponentError(
            f"{self.name}: expected a body of the given mass, {given:.6g} kg, got an effective mass of {masses} kg "
            f"in a trial step at time {time:.12g}. Give [[contact]] the mass that {self._input.name} moves.",
            instance=self.body.name,
            time=time,
        )

    def free(self) -> None:
        """Free the saved state, before the body is freed."""
        if self._state and not self.body.instance.is_fatal:
            self.body.instance.free_state(self._state)


def agrees(given: float, found: float) -> bool:
    """Does a given mass agree with a found mass well enough to choose steps by it?

    >>> agrees(1.0, 1.01), agrees(1000.0, 1.0)
    (True, False)
    """
    return abs(given - found) <= MASS_TOLERANCE * abs(found)
