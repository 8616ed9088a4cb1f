"""The orbits that a controller keeps, one after the other, and its gains about each: equations.md 4.12."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.feedback import LAWS, Law, gains, impact_map
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.python_fmus import build_orbit_controller
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.scene import Scene

MOST_ROWS = 100_000
LONGEST_STAY = 500
"""Impacts at one angular frequency, above which the orbit counts as not settling."""
NEAREST = 1e-10
"""Relative width, in angular frequency, to which the end of a branch is located."""


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Settings of orbit control.

    Attributes
    ----------
    law : {"ogy", "deadbeat", "newton"}
    step : float
        Step of the angular frequency, rad/s.
    tolerance : float
        Difference of two consecutive speeds, over the orbit's speed, below which the frequency moves on.
    limit : float
        Largest correction over the forcing amplitude; 0: no correction.
    noise : float
        Standard deviation of the error of measured speeds, relative.
    seed : int
        Seed of the noise.
    periods : int
        q of the orbit P(1,q).
    stay : int
        Least number of flights at each angular frequency.
    """

    law: Law = "ogy"
    step: float = 1e-4
    tolerance: float = 1e-4
    limit: float = 0.1
    noise: float = 0.0
    seed: int = 1
    periods: int = 1
    stay: int = 1

    def refuse(self) -> None:
        """Raise UsageError unless all numbers are in their ranges."""
        if self.law not in LAWS:
            raise UsageError(f"control: law: expected one of {', '.join(LAWS)}, got {self.law!r}.")
        for name in ("step", "tolerance"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise UsageError(
                    f"control: {name}: expected a finite number > 0, got {getattr(self, name):g}."
                )
        for name in ("limit", "noise"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise UsageError(
                    f"control: {name}: expected a number from 0 to 1, got {getattr(self, name):g}."
                )
        if abs(self.seed) >= 2**31:
            raise UsageError(f"control: seed: expected a whole number of 32 bits, got {self.seed}.")
        for name, most in (("periods", 64), ("stay", LONGEST_STAY // 2)):
            if not 1 <= getattr(self, name) <= most:
                got = getattr(self, name)
                raise UsageError(f"control: {name}: expected a whole number from 1 to {most}, got {got}.")


def settings_of(law: str = "ogy", **numbers: Any) -> ControlSettings:
    """Return checked settings for a law given as text; UsageError if they are out of range."""
    settings = ControlSettings(cast("Law", law), **numbers)
    settings.refuse()
    return settings


@dataclass(frozen=True, eq=False)
class ControlPlan:
    """The orbits to keep, one after the other, and the gains about each."""

    scene: Scene
    settings: ControlSettings
    amplitude: float
    """Forcing amplitude, N."""
    orbits: list[PeriodicOrbit]
    """One orbit at each angular frequency."""
    ends_at: float | None
    """Angular frequency at which the branch ends, rad/s; None if it continues beyond the plan."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The controller's data of each orbit."""
        return [_row(orbit, self.amplitude, self.settings.law) for orbit in self.orbits]

    def controller(self, output: Path) -> Path:
        """Write the controller's FMU; without pythonfmu ComponentError is raised."""
        settings = self.settings
        largest = max(float(orbit.velocities[0]) for orbit in self.orbits)
        return build_orbit_controller(
            {
                "law": settings.law,
                "periods": settings.periods,
                "stay": settings.stay,
                "amplitude": self.amplitude,
                "tolerance": settings.tolerance * largest,
                "limit": settings.limit * abs(self.amplitude),
                "rows": self.rows,
            },
            output,
        )


def _row(orbit: PeriodicOrbit, amplitude: float, law: Law) -> dict[str, Any]:
    about = impact_map(orbit, amplitude)
    gain = gains(law, about)
    return {
        "angular_frequency": orbit.body.angular_frequency,
        "phase": float(orbit.phases[0]),
        "velocity": float(orbit.velocities[0]),
        "gain_time": float(gain[0]),
        "gain_velocity": float(gain[1]),
        "jacobian": about.jacobian.tolist(),
        "response": about.response.tolist(),
    }


def control_plan(scene: Scene, start: float, stop: float, settings: ControlSettings) -> ControlPlan:
    """Return the orbits P(1,q) from one angular frequency to another, as far as their branch goes.

    Parameters
    ----------
    scene : Scene
        An oscillator on restitution stops under a harmonic force; its sweep is ignored.
    start, stop : float
        First and last angular frequency, rad/s.
    settings : ControlSettings

    Raises
    ------
    UsageError
        The scene has no orbits that this control keeps.
    OrbitError
        There is no such orbit at the start.
    """
    settings.refuse()
    alone = scene.unswept(varied=["forcing.angular_frequency"])
    if alone.body.IS_STRUCTURE:
        raise UsageError(
            f"{scene.source}: body.kind: expected an oscillator, whose state an impact tells, got another body."
        )
    if alone.exciter is not None:
        raise UsageError(f"{scene.source}: exciter: expected none where an orbit is kept, got one.")
    body = impacting_body(alone)
    amplitude = float_parameters(alone, None)["forcing.amplitude"]
    for name, value in (("from", start), ("to", stop)):
        if not (value > 0.0 and np.isfinite(value)):
            raise UsageError(f"control: {name}: expected an angular frequency > 0, got {value:g}.")
    if amplitude == 0.0:
        raise UsageError(f"{scene.source}: forcing.amplitude: expected a force to control, got 0.")
    count = int(np.ceil(abs(stop - start) / settings.step - 1e-9))
    if count > MOST_ROWS:
        raise UsageError(
            f"control: step: expected {MOST_ROWS} steps at most, got {count}. Take larger steps."
        )
    first = _first(_at(body, start), settings.periods)
    orbits = [first]
    signed = np.sign(stop - start) * settings.step
    for number in range(1, count + 1):
        value = stop if number == count else start + number * signed
        found = _next(orbits[-1], value)
        if found is None:
            return ControlPlan(alone, settings, amplitude, orbits, _end_of_branch(orbits[-1], value))
        orbits.append(found)
    return ControlPlan(alone, settings, amplitude, orbits, None)


def _at(body: ImpactingBody, angular_frequency: float) -> ImpactingBody:
    return dataclasses.replace(body, angular_frequency=angular_frequency)


def _first(body: ImpactingBody, periods: int) -> PeriodicOrbit:
    found = orbits_of(body, 1, periods)
    if not found:
        raise OrbitError(
            f"control: expected an orbit P(1,{periods}) to keep at {body.angular_frequency:g}, got none there. "
            "Ask follow where there are some."
        )
    # of several orbits, the least unstable
    return min(found, key=lambda orbit: float(np.abs(orbit.multipliers[0])))


def _next(orbit: PeriodicOrbit, angular_frequency: float) -> PeriodicOrbit | None:
    """Return the orbit of the same branch at another angular frequency; None if it does not exist."""
    try:
        found = find_orbit(
            _at(orbit.body, angular_frequency), orbit.phases, orbit.contacts.tolist(), orbit.periods
        )
    except OrbitError:
        return None
    return found if found.velocities[0] > 0.0 and found.is_physical else None


def _end_of_branch(orbit: PeriodicOrbit, beyond: float) -> float:
    """Return the end of a branch between an orbit and an angular frequency without one, rad/s."""
    while abs(beyond - orbit.body.angular_frequency) > NEAREST * orbit.body.angular_frequency:
        middle = 0.5 * (beyond + orbit.body.angular_frequency)
        found = _next(orbit, middle)
        if found is None:
            beyond = middle
        else:
            orbit = found
    return orbit.body.angular_frequency
