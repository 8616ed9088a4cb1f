"""The six problems: scenes of this package, and the linear pieces of their motion that other solvers integrate.

Each is a body of N modes under a harmonic force with one stop above it. Its motion between two events is linear,
y' = matrix y + load cos(Omega t + phase) + constant with y = (q, q'). The next event is the rise of another linear form
through zero. So all solvers get the same few arrays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from support.reference_bodies import beam

from vibroimpact.analysis.landmarks import ImpactOscillator
from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import OscillatorBody
from vibroimpact.orchestrator.study.observation import Floats
from vibroimpact.orchestrator.study.references import scales_of

SEED_ORBIT = ImpactOscillator(1.0, 0.2, 1.0, 0.5, 1.0, 0.7)
GRAZES = tuple(10.0**-n for n in range(2, 13))
"""Distance of the peak of a motion from its stop, above and below, over the stop's position."""


class Phase(IntEnum):
    """State of the contact between body and stop, in the order of `Problem.pieces`."""

    FREE = 0
    HELD = 1
    """At rest on a rigid stop."""
    PRESSED = 2
    """In contact with a compliant stop."""
    SLACK = 3
    """Separated from a compressed compliant stop, but still beyond the stop's rest position."""


@dataclass(frozen=True)
class Piece:
    """A linear piece of the motion, up to a rise of event_row y + event_load cos(...) + event_constant through 0."""

    matrix: Floats
    load: Floats
    constant: Floats
    event_row: Floats
    event_load: float
    event_constant: float


@dataclass(frozen=True)
class Problem:
    """One motion, from time 0 to its end.

    Attributes
    ----------
    scene : Scene
        The scene that this package runs.
    natural, damping, shape, force : ndarray, shape (mode,)
        Angular frequencies (rad/s), 2 zeta w (1/s), shape at the stop (kg^-1/2), modal force (N kg^-1/2).
    """

    scene: Scene
    natural: Floats
    damping: Floats
    shape: Floats
    force: Floats

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.natural)

    @property
    def stop(self) -> Any:
        """The stop's table in the scene."""
        return self.scene.stops[0]

    @property
    def is_rigid(self) -> bool:
        """Whether the stop has a coefficient of restitution, and no stiffness."""
        return bool(self.stop.law == "restitution")

    @property
    def angular_frequency(self) -> float:
        """Angular frequency of the force, rad/s."""
        assert self.scene.forcing is not None
        return self.scene.forcing.angular_frequency

    @property
    def forcing_phase(self) -> float:
        """Phase of the force at time 0, rad."""
        assert self.scene.forcing is not None
        return self.scene.forcing.phase

    @property
    def period(self) -> float:
        """Period of the force, s."""
        return 2.0 * math.pi / self.angular_frequency

    @cached_property
    def end(self) -> float:
        """End of the scene's recorded periods, s; the first of them starts at phase 0 of the force."""
        return scales_of(self.scene).window[1]

    @property
    def periods(self) -> float:
        """Number of simulated forcing periods."""
        return self.end / self.period

    @property
    def start(self) -> Floats:
        """State (q, q') at time 0."""
        body = self.scene.body
        if not isinstance(body, OscillatorBody):
            return np.zeros(2 * self.modes)
        return np.array([body.displacement_start, body.velocity_start])

    @property
    def direction(self) -> Floats:
        """Change of the modal velocities for a unit change of the velocity at the stop."""
        found: Floats = self.shape / (self.shape @ self.shape)
        return found

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The linear pieces, in the order of `Phase`."""
        n, phi, a = self.modes, self.shape, self.stop.position
        none = np.zeros(n)
        free = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(self.natural**2), -np.diag(self.damping)]])
        load = np.concatenate([none, self.force])
        gap = np.concatenate([phi, none])
        # the contact force of a held body cancels the acceleration of the contact point (equations.md 3.4)
        holds = np.concatenate([none, self.direction])
        row = phi @ free[n:]
        held = Piece(
            free - np.outer(holds, row),
            load - holds * (phi @ self.force),
            np.zeros(2 * n),
            -row,
            -float(phi @ self.force),
            0.0,
        )
        pieces = [Piece(free, load, np.zeros(2 * n), gap, 0.0, -a), held]
        if not self.is_rigid:
            rate = self.stop.damping / self.stop.stiffness
            # the force over the stiffness is a length, the unit of all event functions
            press = np.concatenate([phi, rate * phi])
            push = self.stop.stiffness * np.concatenate([none, phi])
            pieces += [
                Piece(free - np.outer(push, press), load, push * a, -press, 0.0, a),
                Piece(free, load, np.zeros(2 * n), -gap, 0.0, a),
            ]
        return tuple(pieces)

    def contact(self, y: Floats) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s) of the contact point."""
        return float(self.shape @ y[: self.modes]), float(self.shape @ y[self.modes :])

    def pull(self, t: float, y: Floats) -> float:
        """Return the acceleration into the stop of a body at rest on it, m/s^2."""
        still = y.copy()
        still[self.modes :] -= self.direction * self.contact(y)[1]
        held = self.pieces[Phase.HELD]
        wave = math.cos(self.angular_frequency * t + self.forcing_phase)
        return -float(held.event_row @ still + held.event_load * wave)


@dataclass(frozen=True)
class Case:
    """A line of the study: one problem, or several as rungs of a ladder.

    Attributes
    ----------
    key, title : str
    quantity : str
        Quantity of the error, a value of `vibroimpact accuracy --of`.
    rungs : mapping of str to Problem
        Problems by name.
    """

    key: str
    title: str
    quantity: str
    rungs: Mapping[str, Problem]

    @property
    def periods(self) -> float:
        """Forcing periods that one run of all rungs simulates."""
        return sum(problem.periods for problem in self.rungs.values())


def oscillator(
    damping_ratio: float,
    force: float,
    frequency: float,
    stop: Mapping[str, Any],
    periods: int,
    start: tuple[float, float] = (0.0, 0.0),
    phase: float = 0.0,
) -> Problem:
    """Return the problem of a unit mass on a unit spring."""
    scene = Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {
                "mass": 1.0,
                "stiffness": 1.0,
                "damping": 2.0 * damping_ratio,
                "displacement_start": start[0],
                "velocity_start": start[1],
            },
            "forcing": {"amplitude": force, "angular_frequency": frequency, "phase": phase},
            "stop": [dict(stop)],
            "record": {"transient_periods": 0, "recorded_periods": periods},
        },
        "peers.toml",
    )
    one = np.ones(1)
    return Problem(scene, one, np.array([2.0 * damping_ratio]), one, np.array([force]))


def cantilever(modes: int, periods: int) -> Problem:
    """Return a clamped-free beam in units of its first mode and its mass, driven and stopped at its tip."""
    found = beam_modes("clamped_free", 1)
    rigidity, ratio, frequency = float(found.eigenvalues[0]) ** -4, 0.02, 0.9
    body = beam(modes, flexural_rigidity=rigidity, damping_ratio=ratio)
    tip = body.shape(1.0)
    response = tip**2 / (body.natural**2 - frequency**2 + 2j * ratio * body.natural * frequency)
    scene = Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {
                "kind": "beam",
                "length": 1.0,
                "flexural_rigidity": rigidity,
                "mass_per_length": 1.0,
                "boundary": "clamped-free",
                "modes": modes,
                "damping_ratio": ratio,
            },
            "forcing": {"amplitude": 1.0, "angular_frequency": frequency, "location": 1.0},
            "stop": [{"location": 1.0, "position": 0.98 * float(abs(response.sum())), "restitution": 0.7}],
            "record": {"transient_periods": 0, "recorded_periods": periods},
        },
        "peers.toml",
    )
    return Problem(scene, body.natural, 2.0 * ratio * body.natural, tip, tip)


def orbit(periods: int) -> Problem:
    """Return the P(1,1) motion, starting in the middle of a flight."""
    ((velocity, theta),) = SEED_ORBIT.single_impact_motions(1.0)
    start = flown(SEED_ORBIT, (1.0, -SEED_ORBIT.restitution * velocity), theta, math.pi)
    stop = {"position": 1.0, "restitution": SEED_ORBIT.restitution}
    return oscillator(0.1, 0.5, 1.0, stop, periods, start, (theta + math.pi) % (2.0 * math.pi))


def flown(
    body: ImpactOscillator, state: tuple[float, float], phase: float, duration: float, frequency: float = 1.0
) -> tuple[float, float]:
    """Return displacement and velocity after a flight of a body of unit natural frequency: equations.md 1.2 to 1.4."""
    zeta = body.damping_ratio
    steady = body.force / complex(1.0 - frequency**2, 2.0 * zeta * frequency)
    rate = complex(-zeta, math.sqrt(1.0 - zeta**2))

    def forced(at: float) -> tuple[float, float]:
        turned = steady * complex(math.cos(phase + at * frequency), math.sin(phase + at * frequency))
        return turned.real, (1j * frequency * turned).real

    x, v = state[0] - forced(0.0)[0], state[1] - forced(0.0)[1]
    # the free motion is the real part of size * exp(rate u)
    size = complex(x, (rate.real * x - v) / rate.imag)
    free = size * complex(math.cos(rate.imag * duration), math.sin(rate.imag * duration))
    free *= math.exp(rate.real * duration)
    end = forced(duration)
    return free.real + end[0], (rate * free).real + end[1]


def graze(excess: float) -> Problem:
    """Return a steady motion whose peak is above its stop (or below it) by a share of the stop's position.

    It starts from its trough, and lasts one period with its peak in the middle. The damping ratio is .1, the angular
    frequency .7, and the stop is at 1.
    """
    zeta, frequency = 0.1, 0.7
    size = math.hypot(1.0 - frequency**2, 2.0 * zeta * frequency)
    lag = math.atan2(2.0 * zeta * frequency, 1.0 - frequency**2)
    stop = {"position": 1.0, "restitution": 0.7}
    start = (-(1.0 + excess), 0.0)
    return oscillator(
        zeta, (1.0 + excess) * size, frequency, stop, 1, start, (math.pi + lag) % (2.0 * math.pi)
    )


def cases() -> list[Case]:
    """Return the six cases, in the order of the issue."""
    above = {f"peak above the stop by {e:.0e}": graze(e) for e in GRAZES}
    below = {f"peak below the stop by {e:.0e}": graze(-e) for e in GRAZES}
    chaos = {"position": 0.0, "restitution": 0.8}
    start = (-0.2, 0.1)
    stiff = {"law": "kelvin_voigt", "position": 0.3, "stiffness": 1e6, "damping": 230.0}
    return [
        Case("orbit", "P(1,1) orbit", "all", {"": orbit(50)}),
        Case(
            "chaos",
            "chaos, first ten impacts",
            "all",
            {"": oscillator(0.05, 1.0, 2.8, chaos, 10, start)},
        ),
        Case("grazes", "ladder of grazes", "impact_time", above | below),
        Case(
            "chatter",
            "chatter into rest",
            "all",
            {"": oscillator(0.05, 1.0, 0.2, {"position": 0.0, "restitution": 0.7}, 4, (-0.1, 0.0))},
        ),
        Case("beam", "beam of 8 modes", "all", {"": cantilever(8, 10)}),
        Case("kelvin_voigt", "stiff Kelvin-Voigt stop", "all", {"": oscillator(0.1, 0.5, 1.0, stiff, 20)}),
    ]
