"""Scales and steps: units from nano to giga, one step of a million periods, samples without effect."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest
from vibroimpact.orchestrator.hard_cases.runs import PLAIN, kelvin_voigt, restitution, run

THEME = "Scales and steps"
SCALES = np.array([1e-9, 1e-6, 1e-3, 40.0, 1e3, 1e6, 1e9])


def _units() -> Found:
    """A chain on a rigid and a Kelvin-Voigt stop, all displacements times a factor: the same motion."""

    def end_of(scale: float) -> np.ndarray[Any, Any]:
        record = run(
            body={
                **{
                    "kind": "chain",
                    "masses": [1.0, 2.0, 1.5],
                    "stiffnesses": [1.0, 2.0, 3.0],
                    "dampings": 0.1,
                },
                "displacement_start": [0.1 * scale, -0.2 * scale, 0.0],
            },
            forcing={"amplitude": [0.0, 0.0, scale], "angular_frequency": 0.9},
            stop=[
                restitution(0.3 * scale, 0.7, mass=3),
                kelvin_voigt(-0.4 * scale, 50.0, 1.0, mass=1, side="lower"),
            ],
            record={"recorded_periods": 6},
        )
        assert record.final_state is not None
        return record.final_state / scale

    one = end_of(1.0)
    off = np.array([np.abs(end_of(float(scale)) - one).max() / np.abs(one).max() for scale in SCALES])
    return Found(
        largest(off),
        Curve(SCALES, off, "scale of displacements (-)", "relative change of the motion (-)", x_log=True),
    )


PERIODS = np.array([10.0**n for n in range(2, 7)])


def _one_step() -> Found:
    """The steady motion of a damped oscillator, in front of a stop that it does not reach, after one step."""
    w, damping = 0.8, 0.1
    size = math.hypot(1.0 - w**2, damping * w)
    lag = math.atan2(damping * w, 1.0 - w**2)
    expected = math.cos(lag) / size
    errors = []
    for count in PERIODS:
        record = run(
            body=PLAIN | {"damping": damping},
            forcing={"amplitude": 1.0, "angular_frequency": w},
            stop=[restitution(10.0, 0.7)],
            record={
                "transient_periods": int(count),
                "recorded_periods": 1,
                "impacts": False,
                "extrema": False,
            },
        )
        errors.append(abs(record.final_displacement - expected) / size**-1)
    off = np.array(errors)
    return Found(
        float(off[-1]),
        Curve(PERIODS, off, "periods in one step (-)", "relative error of the final state (-)", x_log=True),
    )


RATES = np.array([0.0, 1.0, 10.0, 97.0])


def _samples() -> Found:
    """A free undamped beam ends in the same place at any sampling rate."""
    end = 1000.0

    def run_at(rate: float) -> tuple[np.ndarray[Any, Any], float]:
        record: dict[str, Any] = {"recorded_time": end}
        if rate:
            record["time_series"] = {"rate": rate, "variables": ["energy.kinetic", "energy.potential"]}
        found = run(
            body={
                **{
                    "kind": "beam",
                    "length": 1.0,
                    "flexural_rigidity": 1.0,
                    "mass_per_length": 1.0,
                    "modes": 3,
                },
                "displacement_start": [-0.05, 0.004, 0.001],
            },
            record=record,
        )
        assert found.final_state is not None
        if found.samples is None:
            return found.final_state, 0.0
        energy = found.samples[:, 1] + found.samples[:, 2]
        return found.final_state, largest(np.abs(energy / energy[0] - 1.0))

    reference, _ = run_at(0.0)
    ends = [run_at(float(rate)) for rate in RATES[1:]]
    scale = np.abs(reference).max()
    off = np.array([max(np.abs(state - reference).max() / scale, drift) for state, drift in ends])
    return Found(
        largest(off),
        Curve(RATES[1:], off, "samples per second (-)", "energy, change of the final state (-)", x_log=True),
    )


MODES = np.array([1, 2, 4, 8, 16, 32, 64])


def _many_modes() -> Found:
    """Undamped beams of up to 64 modes between elastic stops: bounded, outside the stops, energy kept."""
    errors, room, end, samples = [], 0.02, 10.0, 200
    for modes in MODES:
        record = run(
            body={
                **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0},
                **{"modes": int(modes), "velocity_start": [0.3, *([0.05] * (int(modes) - 1))]},
            },
            stop=[restitution(room, 1.0), restitution(-room, 1.0, side="lower")],
            record={
                **{"recorded_time": end, "impacts": False},
                "time_series": {
                    "rate": samples / end,
                    "variables": ["contact_displacement[1]", "energy.kinetic", "energy.potential"],
                },
            },
        )
        assert record.samples is not None
        _, place, kinetic, potential = record.samples.T
        energy = kinetic + potential
        beyond = float(np.maximum(np.abs(place) - room, 0.0).max()) / room
        errors.append(max(beyond, largest(np.abs(energy / energy[0] - 1.0))))
    off = np.array(errors)
    curve = Curve(
        MODES.astype(float), off, "modes (-)", "beyond the stops, error of the energy (-)", x_log=True
    )
    return Found(largest(off), curve)


CASES = (
    HardCase(
        "units",
        THEME,
        "displacements of 1e-9 to 1e9",
        "the same motion on rigid and yielding stops",
        "the motion at 1",
        "relative change of the final state",
        1.6e-13,
        _units,
    ),
    HardCase(
        "one-step",
        THEME,
        "one step of 100 to 10^6 periods",
        "ends in the steady motion",
        "closed form",
        "relative error of the final state after 10^6 periods",
        5e-15,
        _one_step,
    ),
    HardCase(
        "samples",
        THEME,
        "an undamped free beam, 0 to 97 samples per second for 1000 s",
        "the same final state, the energy is conserved",
        "the run without samples; conservation",
        "relative change of the final state, or of the energy",
        1e-11,
        _samples,
    ),
    HardCase(
        "many-modes",
        THEME,
        "undamped beams of 1 to 64 modes between elastic stops",
        "stays outside of the stops, the energy is conserved",
        "conservation",
        "relative distance beyond the stops, or error of the energy",
        2e-12,
        _many_modes,
    ),
)
