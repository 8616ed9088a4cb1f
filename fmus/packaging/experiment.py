"""Default duration and step of a run of an exported body, chosen so that its motion is visible."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vibroimpact.fmus.packaging.description import Experiment, Number

PERIODS = 20
"""Number of periods of the slowest motion in a default experiment."""

STEPS_PER_PERIOD = 20
"""Number of steps in a period of the fastest motion."""

MOST_STEPS = 10_000
"""Largest number of steps in a default experiment; motion too fast for these steps is computed all the same."""

SLOWEST, FASTEST = 1e-100, 1e100
"""Range of angular frequencies for which a default experiment makes sense, rad/s."""

Starts = Mapping[str, Number]


def default_experiment(
    component: str, starts: Starts, stop_time: float | None = None, natural: Sequence[float] = ()
) -> Experiment:
    """Return the default experiment of a body, from all its start values by variable name.

    `natural` are its natural angular frequencies where they do not follow from these, rad/s.

    Without a stop time (s) it has `PERIODS` periods of the slowest natural frequency or of the forcing, whichever is
    slower. It has `STEPS_PER_PERIOD` steps in the fastest period, and at most `MOST_STEPS` in total; both times are
    rounded to two digits. Where the frequencies are too large or too small, FMI's usual ten seconds apply.
    """
    try:
        with np.errstate(all="ignore"):
            own = NATURAL[component](starts) if component in NATURAL else []
    except (OverflowError, ZeroDivisionError):
        own = []
    angular = [
        w for w in (*natural, *own, abs(float(starts.get("forcing.angular_frequency", 0.0)))) if w > 0.0
    ]
    if not angular or not (min(angular) > SLOWEST and max(angular) < FASTEST):
        return Experiment() if stop_time is None else Experiment(stop_time, stop_time / MOST_STEPS)
    stop = _rounded(PERIODS * 2.0 * math.pi / min(angular)) if stop_time is None else stop_time
    step = _rounded(2.0 * math.pi / max(angular) / STEPS_PER_PERIOD)
    return Experiment(stop_time=stop, step_size=max(step, _rounded(stop / MOST_STEPS)))


def _rounded(value: float) -> float:
    return float(f"{value:.1e}")


def _oscillator(starts: Starts) -> list[float]:
    mass, stiffness = float(starts["mass"]), float(starts["stiffness"])
    return [math.sqrt(stiffness / mass)] if mass > 0.0 and stiffness > 0.0 else []


def _chain(starts: Starts) -> list[float]:
    """Return the natural angular frequencies: equations.md 5, thesis (6.1) to (6.8)."""
    count = int(starts["masses"])
    mass = np.array([float(starts[f"mass[{i}]"]) for i in range(1, count + 1)])
    stiffness = [float(starts[f"stiffness[{i}]"]) for i in range(1, count + 1)]
    spring = np.array([*stiffness, float(starts["far_stiffness"])])
    if not (mass > 0.0).all() or not np.isfinite(spring).all():
        return []
    matrix = np.diag(spring[:-1] + spring[1:]) - np.diag(spring[1:-1], 1) - np.diag(spring[1:-1], -1)
    root = np.sqrt(mass)
    scaled = matrix / np.outer(root, root)
    if not np.isfinite(scaled).all():
        return []
    squares = np.linalg.eigvalsh(scaled)
    # squares below this are rounding errors of rigid motions
    return [math.sqrt(square) for square in squares if square > squares[-1] * 1e-12]


def _beam(starts: Starts) -> list[float]:
    """Return the natural angular frequencies: equations.md 6, thesis table 7.1."""
    from vibroimpact.fmus.core.modes import BOUNDARIES, beam_modes  # loads the core library

    value = {key: float(number) for key, number in starts.items()}
    section = value["width"] * value["thickness"]
    rigidity = (
        value["flexural_rigidity"] or value["youngs_modulus"] * section * value["thickness"] ** 2 / 12.0
    )
    mass_per_length = value["mass_per_length"] or value["density"] * section
    boundary = next(name for name, number in BOUNDARIES.items() if number == int(starts["boundary"]))
    if not (rigidity > 0.0 and mass_per_length > 0.0 and value["length"] > 0.0):
        return []
    scale = math.sqrt(rigidity / mass_per_length) / value["length"] ** 2
    return [scale * float(xi) ** 2 for xi in beam_modes(boundary, int(starts["modes"])).eigenvalues]


NATURAL: dict[str, Callable[[Starts], list[float]]] = {
    "Oscillator": _oscillator,
    "Chain": _chain,
    "Beam": _beam,
}
