"""Structures with moving stops for tests: a ball on a table, its equal in the table's frame, random structures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from support.component_fmu import (
    HERTZ,
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    LOWER,
    RESTITUTION,
    UPPER,
    ComponentFmu,
    stop,
)
from support.modal_fmu import structure_fmu

TABLE_ROOM = 8192


def set_table(fmu: ComponentFmu, times: ArrayLike, values: ArrayLike) -> None:
    """Set the tables of a Structure; the rest of the room is 0."""
    for name, part in (("time", times), ("value", values)):
        whole = np.zeros(TABLE_ROOM)
        whole[: np.size(part)] = part
        fmu.fmu.setFloat64([fmu.reference(f"table.{name}")], whole.tolist())


def moving(k: int = 1, **motion: float) -> dict[str, float]:
    """Return the parameters of the motion of stop k."""
    return {f"stop[{k}].{name}": value for name, value in motion.items()}


def ball(height: float, speed: float) -> dict[str, Any]:
    """Return the mode of a ball of mass 1 that nothing holds, with this start."""
    one = ("contact_shape", "observed_shape", "force", "displacement_start", "velocity_start")
    numbers = ([[1.0]], [1.0], [1.0], [height], [speed])
    return {
        "mode.angular_frequency": [0.0],
        "mode.base": [-1.0],
        **{f"mode.{name}": value for name, value in zip(one, numbers, strict=True)},
    }


def ball_on_table(
    amplitude: float, height: float, speed: float, *, w: float = 1.0, phase: float = 0.0, **law: Any
) -> ComponentFmu:
    """Return a ball under gravity 1 above a table at amplitude cos(w t + phase)."""
    table = moving(amplitude=amplitude, angular_frequency=w, phase=phase)
    clock = {"forcing.angular_frequency": w, "force": -1.0}
    return structure_fmu(ball(height, speed), {**clock, **table, **stop(0.0, side=LOWER, **law)})


def ball_in_frame(
    amplitude: float, height: float, speed: float, *, w: float = 1.0, phase: float = 0.0, **law: Any
) -> ComponentFmu:
    """Return the same ball in the frame of the table: the base accelerates, and the stop stands still."""
    start = ball(height - amplitude * math.cos(phase), speed + amplitude * w * math.sin(phase))
    base = {
        "forcing.angular_frequency": w,
        "forcing.phase": phase,
        "forcing.base_acceleration": -amplitude * w * w,
        "force": -1.0,
    }
    return structure_fmu(start, {**base, **stop(0.0, side=LOWER, **law)})


@dataclass
class Drawn:
    """A random structure with moving stops."""

    arrays: dict[str, Any]
    parameters: dict[str, float]
    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    contacts: int = 0

    def start(self) -> ComponentFmu:
        """Return the initialized FMU."""
        fmu = structure_fmu(self.arrays, self.parameters, initialize=False)
        if self.times:
            set_table(fmu, self.times, self.values)
        fmu.initialize()
        return fmu


def drawn_structure(seed: int) -> Drawn:
    """Return a structure of 1 to 4 modes and 1 to 3 stops that move in any way; the stops start out of reach."""
    draw = np.random.default_rng(seed)
    modes, contacts = int(draw.integers(1, 5)), int(draw.integers(1, 4))
    natural = np.sort(draw.uniform(0.3, 6.0, modes))
    arrays: dict[str, Any] = {
        "mode.angular_frequency": natural,
        "mode.damping_ratio": draw.uniform(0.0, 0.2, modes),
        "mode.contact_shape": draw.normal(size=(contacts, modes)),
    }
    for name in ("observed_shape", "forcing", "force", "velocity_start"):
        arrays[f"mode.{name}"] = 0.7 * draw.normal(size=modes)
    w = float(draw.uniform(0.5, 3.0))
    found = Drawn(arrays, {"forcing.angular_frequency": w, "forcing.amplitude": draw.uniform(0.0, 1.0)})
    found.contacts = contacts
    for k in range(1, contacts + 1):
        found.parameters |= _drawn_stop(draw, found, k, w)
    return found


def _drawn_stop(draw: np.random.Generator, found: Drawn, k: int, w: float) -> dict[str, float]:
    law = int(draw.choice([RESTITUTION, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY]))
    motion: dict[str, float] = {}
    reach = 0.0
    if draw.random() < 0.6:
        reach = float(draw.uniform(0.0, 0.5))
        frequency = float(draw.choice([w, draw.uniform(0.1, 5.0)]))
        motion |= {"amplitude": reach, "angular_frequency": frequency, "phase": draw.uniform(-5.0, 5.0)}
    if draw.random() < 0.4:
        motion["velocity"] = 0.02 * draw.normal()
    if draw.random() < 0.4:
        count = int(draw.integers(2, 12))
        motion |= {"table_start": len(found.times) + 1, "table_count": count}
        found.times += np.sort(draw.uniform(-5.0, 40.0, count)).tolist()
        found.values += np.clip(0.2 * draw.normal(size=count), -0.4, 0.4).tolist()
        reach += 1.0
    law_numbers = {} if law == RESTITUTION else {"stiffness": 10.0 ** draw.uniform(0.0, 4.0)}
    if law in (KELVIN_VOIGT, HUNT_CROSSLEY):
        law_numbers["damping"] = draw.uniform(0.0, 1.0)
    upper = draw.random() < 0.5
    position = (1.0 if upper else -1.0) * (reach + draw.uniform(0.05, 0.5))
    restitution = float(draw.choice([0.0, 0.3, 0.6, 0.9]))
    own = stop(position, restitution, side=UPPER if upper else LOWER, law=law, k=k, **law_numbers)
    return {**own, **moving(k, **motion)}
