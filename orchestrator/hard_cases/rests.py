"""Chatter, sticking, release: beams that come to rest, loads that turn round, rests that last."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import STICK_END, STICK_START, kelvin_voigt, restitution, run

THEME = "Chatter, sticking, release"
BEAM = {"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0}


def _pressed_beam() -> Found:
    """A beam that a constant force presses to its stop: the force of the stop is that of statics."""
    modes, load, limit = 6, 5.0, 0.05
    shapes = beam_modes("clamped_free", modes)
    flexibility = shapes.shapes([0.5, 1.0]) / shapes.eigenvalues**2
    middle, tip = flexibility
    expected = (load * middle @ tip - limit) / (tip @ tip)
    end, samples = 400.0, 200
    record = run(
        body={**BEAM, "modes": modes, "damping_ratio": 0.1},
        forcing={"amplitude": load, "angular_frequency": 0.0, "location": 0.5},
        stop=[restitution(limit, 0.7)],
        record={"recorded_time": end, "time_series": {"rate": samples / end, "variables": ["contact_force"]}},
    )
    assert record.samples is not None
    time, force = record.samples[1:].T
    off = relative(force, expected)
    return Found(float(off[-1]), Curve(time, off, "time (-)", "relative distance from the static force (-)"))


def _turning_load() -> Found:
    """A mass without a spring, at rest on its stop, under F cos(w t): it leaves where the force turns round."""
    frequencies = 10.0 ** np.arange(-3.0, 4.0)
    errors = []
    for w in frequencies:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0},
            forcing={"amplitude": 1.0, "angular_frequency": float(w)},
            stop=[restitution(0.0, 0.5)],
            record={"recorded_periods": 1},
        )
        assert record.sticks is not None
        errors.append(largest(relative(record.sticks[:1, STICK_END], 0.5 * math.pi / w)))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(frequencies, off, "frequency of the load (-)", "relative error of the release (-)", x_log=True),
    )


def _undamped_rest() -> Found:
    """Four undamped modes whose point rests on a dead stop, in 1000 steps: the others keep their energy."""
    end, samples = 1000.0, 1000
    record = run(
        body={**BEAM, "modes": 4, "displacement_start": [0.0, 0.1, 0.0, 0.0]},
        forcing={"amplitude": 500.0, "angular_frequency": 0.0, "location": 1.0},
        stop=[restitution(0.0, 0.0)],
        record={
            "transient_time": 50.0,
            "recorded_time": end,
            "time_series": {"rate": samples / end, "variables": ["energy.kinetic", "energy.potential"]},
        },
    )
    assert record.samples is not None
    time, kinetic, potential = record.samples.T
    energy = kinetic + potential
    off = np.abs(energy / energy[0] - 1.0)
    return Found(largest(off), Curve(time, off, "time (-)", "relative error of the energy (-)"))


STIFFNESSES = 10.0 ** np.arange(4.0, 13.0, 2.0)


def _stiff_rest() -> Found:
    """A mass pressed to a stiff undamped stop by F (1 + cos w t) - F/2: released at the zero of the stop's force."""
    errors = []
    for stiffness in STIFFNESSES:
        w, load = 0.01, 1.0
        # starts in its place, moving with it: x = F cos(w t) / (k - m w^2), the steady motion
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "displacement_start": load / (stiffness - w**2)},
            forcing={"amplitude": load, "angular_frequency": w},
            stop=[kelvin_voigt(0.0, float(stiffness))],
            record={"recorded_periods": 1},
        )
        assert record.impacts is not None
        # the first contact ends where its force does: at a quarter of the period
        released = record.impacts[0, 0] + record.impacts[0, 6]
        errors.append(float(relative(released, 0.5 * math.pi / w)))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(STIFFNESSES, off, "stiffness of the stop (-)", "relative error of the release (-)", x_log=True),
    )


def _chatter() -> Found:
    """A mass that falls on a stop: the instant at which infinitely many bounces end, for every restitution."""
    coefficients = np.array([0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99])
    errors = []
    for r in coefficients:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "displacement_start": -1.0},
            forcing={"amplitude": 2.0, "angular_frequency": 0.0},
            stop=[restitution(0.0, float(r))],
            record={"recorded_time": 1000.0},
        )
        assert record.sticks is not None
        errors.append(largest(relative(record.sticks[:1, STICK_START], 1.0 + 2.0 * r / (1.0 - r))))
    off = np.array(errors)
    return Found(largest(off), Curve(coefficients, off, "restitution (-)", "relative error of the rest (-)"))


CASES = (
    HardCase(
        "chatter",
        THEME,
        "a mass that falls on a stop, restitution 0.05 to 0.99",
        "the instant at which infinitely many bounces end",
        "geometric sum",
        "relative error of the time",
        3e-14,
        _chatter,
    ),
    HardCase(
        "pressed-beam",
        THEME,
        "a beam of 6 modes pressed to its stop, chatter and all",
        "comes to rest; the force of the stop",
        "static flexibility of its modes",
        "relative error of the force at the end",
        1.7e-13,
        _pressed_beam,
    ),
    HardCase(
        "turning-load",
        THEME,
        "a load that turns round at 1e-3 to 1e3 rad/s",
        "the mass lifts off at that instant",
        "zero of the load",
        "relative error of the time",
        7e-15,
        _turning_load,
    ),
    HardCase(
        "undamped-rest",
        THEME,
        "an undamped beam of 4 modes at rest on a dead stop, in 1000 steps",
        "the motion of the rest of it keeps its energy",
        "conservation",
        "relative error of the energy",
        3e-13,
        _undamped_rest,
    ),
    HardCase(
        "stiff-rest",
        THEME,
        "a rest on an undamped stop of 1e4 to 1e12 N/m under a slow load",
        "released at the zero of the force",
        "steady motion in closed form",
        "relative error of the time",
        1e-14,
        _stiff_rest,
    ),
)
