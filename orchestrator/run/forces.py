"""Several forces as parameters of the FMU Structure, and their values at instants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.forcing_clock import signals_of, sines_of
from vibroimpact.orchestrator.scene.forcing_models import ConstantForcing, Force, Forcing, SignalForcing
from vibroimpact.orchestrator.scene.models import StopTable

Floats = NDArray[np.float64]
_BASE = "base_acceleration"


def further_forces(scene: Scene) -> list[Force]:
    """Return the forces that are not the clock of a scene, in the order of the FMU: sines, then constants."""
    sines, clock = sines_of(scene.forces), scene.clock
    further = sines[1:] if clock is not None and clock.periods == 1 else sines
    return [*further, *(force for force in scene.forces if isinstance(force, ConstantForcing))]


def force_integers(scene: Scene) -> dict[str, int]:
    """Return the kinds and tables of signals, and whether each force is an acceleration of the base, by variable."""
    sines = enumerate(further_forces(scene), start=1)
    found: dict[str, int] = {f"sine[{number}].of_base": force.kind == _BASE for number, force in sines}
    first = 1
    for number, signal in enumerate(signals_of(scene.forces), start=1):
        count = len(signal.rows[0])
        found |= {
            f"signal[{number}].kind": signal.kind_number,
            f"signal[{number}].of_base": signal.kind == _BASE,
            f"signal[{number}].seed": signal.seed_number,
            f"signal[{number}].table_start": first if count else 1,
            f"signal[{number}].table_count": count,
        }
        first += count
    for number, stop in enumerate(scene.stops, start=1):
        if isinstance(stop, StopTable) and stop.motion_times is not None:
            count = len(stop.motion_times)
            found |= {f"stop[{number}].table_start": first, f"stop[{number}].table_count": count}
            first += count
    return found


def force_floats(scene: Scene, *, begins_anew: bool = True) -> dict[str, float]:
    """Return the real parameters of the FMU Structure with several forces, by variable name, SI.

    The clock is the first sine, or has the amplitude 0 where the common period has several periods of the first sine.
    A constant force is a sine of frequency 0.

    Parameters
    ----------
    scene : Scene
        A scene of several forces, or of one that is no sine.
    begins_anew : bool
        Whether the sines have their own phases at time 0; otherwise time 0 is where the phase of the clock is 0.
    """
    body, clock = cast(StructureBody, scene.body), scene.clock
    found: dict[str, float] = {}
    turned = 0.0
    if clock is not None:
        turned = 0.0 if begins_anew else clock.phase / clock.angular_frequency
        found |= {
            "forcing.amplitude": 0.0,
            "forcing.angular_frequency": clock.angular_frequency,
            "forcing.phase": clock.phase if begins_anew else 0.0,
        }
        for first in sines_of(scene.forces)[:1]:
            found |= _row("mode.forcing", "", body.load(first))
            found |= _amplitude_of_clock(first) if clock.periods == 1 else {}
    for number, force in enumerate(further_forces(scene), start=1):
        frequency, phase = (
            (force.angular_frequency, force.phase) if isinstance(force, Forcing) else (0.0, 0.0)
        )
        found |= {
            f"sine[{number}].amplitude": _amplitude(force),
            f"sine[{number}].angular_frequency": frequency,
            f"sine[{number}].phase": phase - turned * frequency,
            **_row("mode.sine", f"{number},", body.load(force)),
        }
    for number, stop in enumerate(scene.stops, start=1):
        if isinstance(stop, StopTable) and stop.moves:
            found[f"stop[{number}].phase"] = stop.motion_phase - turned * stop.motion_angular_frequency
    return found | _signal_floats(scene, body) | _table_floats(scene)


def _signal_floats(scene: Scene, body: StructureBody) -> dict[str, float]:
    """Return the real parameters of signals that are no sines, with their tables one after the other."""
    found: dict[str, float] = {}
    before = 0
    for number, signal in enumerate(signals_of(scene.forces), start=1):
        found[f"signal[{number}].amplitude"] = _amplitude(signal)
        found |= {f"signal[{number}].{name}": value for name, value in signal.numbers().items()}
        found |= _row("mode.signal", f"{number},", body.load(signal))
        for name, column in zip(("time", "value"), signal.rows, strict=True):
            found |= {f"table.{name}[{row}]": value for row, value in enumerate(column, start=before + 1)}
        before += len(signal.rows[0])
    return found


def _table_floats(scene: Scene) -> dict[str, float]:
    """Return the tables of moving stops, behind those of the signals."""
    found: dict[str, float] = {}
    before = sum(len(signal.rows[0]) for signal in signals_of(scene.forces))
    for stop in scene.stops:
        if isinstance(stop, StopTable) and stop.motion_times is not None and stop.motion_values is not None:
            for name, column in (("time", stop.motion_times), ("value", stop.motion_values)):
                found |= {f"table.{name}[{row}]": value for row, value in enumerate(column, start=before + 1)}
            before += len(stop.motion_times)
    return found


def phases_of_new_start(scene: Scene) -> dict[str, float]:
    """Return the phases of the sines, by variable name, where time 0 is where the phase of the clock is 0."""
    if not scene.lists_forces:
        return {"forcing.phase": 0.0}
    floats = force_floats(scene, begins_anew=False)
    return {name: value for name, value in floats.items() if name.endswith(".phase")}


def _amplitude_of_clock(sine: Forcing) -> dict[str, float]:
    """Return the amplitude of the first sine; the FMU adds the motion of a base to its accelerations."""
    name = "forcing.base_acceleration" if sine.kind == _BASE else "forcing.amplitude"
    return {name: _amplitude(sine)}


def _amplitude(force: Force) -> float:
    """Return the amplitude of a force; 1 where an array of amplitudes is in its load."""
    return 1.0 if isinstance(force.amplitude, tuple) else force.amplitude


def _row(name: str, place: str, row: Floats) -> dict[str, float]:
    return {f"{name}[{place}{i}]": value for i, value in enumerate(row.tolist(), start=1)}


class Forces:
    """The values of the forces of a scene at instants of a run, from the parameters of its body.

    Parameters
    ----------
    forces : sequence of forces
        Several forces, or one that is no sine.
    parameters : mapping of str to float
        Parameters of the body, see `force_floats`: a run that goes on has other phases.
    """

    def __init__(self, forces: Sequence[Force], parameters: Mapping[str, float]) -> None:
        self._forces = tuple(forces)
        sines = sines_of(forces)
        names = [f"sine[{number}].phase" for number in range(1, len(sines) + 1)]
        if sines and parameters["forcing.angular_frequency"] == sines[0].angular_frequency:
            names = ["forcing.phase", *names[:-1]]  # the first sine is the clock
        self._phases = [parameters[name] for name in names]

    def values(self, number: int, times: Floats) -> Floats:
        """Return the force of a number, from 1, at instants; the sum over the masses for an array of amplitudes."""
        force = self._forces[number - 1]
        size = math.fsum(force.amplitude) if isinstance(force.amplitude, tuple) else force.amplitude
        if isinstance(force, SignalForcing):
            shape = force.values_at(times)
            assert shape is not None, "the rules of scenes refuse it"
            return size * shape
        if not isinstance(force, Forcing):
            return np.full(len(times), size)
        phase = self._phases[len(sines_of(self._forces[: number - 1]))]
        return size * cosines(force.angular_frequency, phase, times)


def cosines(angular_frequency: float, phase: float, times: Floats) -> Floats:
    """Return the cosines of a sine's phase at instants, one by one: numpy's last bits depend on the machine."""
    return np.array([math.cos(angle) for angle in (angular_frequency * times + phase).tolist()])
