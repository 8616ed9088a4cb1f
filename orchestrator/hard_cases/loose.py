"""Orbits of bodies that no spring holds: a ball in the cavity of an oscillator, against its closed form."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest, relative
from vibroimpact.orchestrator.orbits.find import find_orbits
from vibroimpact.orchestrator.scene import Scene

THEME = "Loose bodies"
STIFFNESS, DAMPING, RESTITUTION, CLEARANCE, AMPLITUDE = 1.0, 0.1, 0.5, 0.4, 0.3
"""Numbers of the oscillator, whose mass is 1, of both contacts, and of its force, without units."""
MASSES, FREQUENCIES = (0.01, 0.1, 0.5), np.array([1.2, 1.3, 1.4, 1.5, 1.6])
OFF = 1e-3
"""Distance of the phases of a seed from those of the orbit, rad."""


def ball_in_cavity(mass: float, frequency: float, amplitude: float = AMPLITUDE) -> dict[str, Any]:
    """Return the tables of an oscillator under a force, with a free ball in its cavity."""
    frame = {"name": "frame", "mass": 1.0, "stiffness": STIFFNESS, "damping": DAMPING}
    both = {"restitution": RESTITUTION, "clearance": CLEARANCE}
    return {
        "scene": {"units": "nondimensional"},
        "body": [frame, {"name": "ball", "mass": mass, "stiffness": 0.0}],
        "contact": [both | {"between": pair} for pair in (["frame", "ball"], ["ball", "frame"])],
        "forcing": {"at": "frame", "amplitude": amplitude, "angular_frequency": frequency},
        "record": {"recorded_periods": 1},
    }


def symmetric_orbit(mass: float, frequency: float, amplitude: float = AMPLITUDE) -> tuple[float, float]:
    """Return phase (rad) and speed of the impact at the first contact on the fastest symmetric orbit.

    The ball crosses the cavity in half a period T with the speed J / (2 m), where J is the impulse. The frame moves by
    its steady response, and by J times its response h to impulses of alternate signs T / 2 apart. The position and the
    relative velocity at an impact give cosine and sine of the phase, both linear in J: a quadratic equation.
    """
    half, ratio, r = math.pi / frequency, 0.5 * DAMPING, RESTITUTION
    rate = complex(-ratio, math.sqrt(STIFFNESS - ratio**2))
    summed = 1.0 / (1.0 + cmath.exp(rate * half)) / rate.imag
    place, after = summed.imag, (rate * summed).imag  # h(0), and h'(0+) = h'(0-) + 1
    response = amplitude / complex(STIFFNESS - frequency**2, DAMPING * frequency)
    # |response| cos = CLEARANCE + J along, |response| sin = J across
    along = place - 0.25 * half / mass
    across = -(after + r * (after - 1.0) + 0.5 * (1.0 - r) / mass) / ((1.0 + r) * frequency)
    square, linear = along**2 + across**2, CLEARANCE * along
    root = math.sqrt(linear**2 - square * (CLEARANCE**2 - abs(response) ** 2))
    impulse = (root - linear) / square
    angle = math.atan2(impulse * across, CLEARANCE + impulse * along) - cmath.phase(response)
    return angle % (2.0 * math.pi), impulse * (1.0 + 1.0 / mass) / (1.0 + r)


def _balls() -> Found:
    """Orbits of balls of several masses at several frequencies of the force, found from seeds nearby."""
    errors = np.zeros(FREQUENCIES.size)
    for place, frequency in enumerate(FREQUENCIES.tolist()):
        for mass in MASSES:
            phase, speed = symmetric_orbit(mass, frequency)
            seed = [(phase + OFF, 1), (phase + math.pi - OFF, 2)]
            (orbit,) = find_orbits(Scene.from_dict(ball_in_cavity(mass, frequency)), seed=seed)
            phases = np.sort(np.array([phase, phase + math.pi]) % (2.0 * math.pi))
            is_such = orbit.phases.size == 2 and orbit.is_physical
            off = np.abs(orbit.phases - phases).max() if is_such else math.inf
            errors[place] = max(errors[place], float(off), largest(relative(orbit.velocities, speed)))
    words = "error of phases (rad) and speeds (relative)"
    return Found(largest(errors), Curve(FREQUENCIES, errors, "frequency of the force (-)", words))


CASES = (
    HardCase(
        "ball-in-cavity",
        THEME,
        "a ball of 0.01 to 0.5 of the mass of a forced oscillator, free in its cavity",
        "the orbit of two impacts a period is found from seeds nearby",
        "closed form",
        "error of phases (rad) and speeds (relative)",
        4.5e-13,
        _balls,
    ),
)
