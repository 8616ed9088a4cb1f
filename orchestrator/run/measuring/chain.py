"""The voltages of sensor and load cell under a motion, block by block, and the force of an exciter's voltage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.measuring import EXCITER_SIDES, LoadCell, sensor_reading
from vibroimpact.fmus.core.stepping import Magnet
from vibroimpact.orchestrator.run.fused import HeldExciter
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.measuring_models import LOAD_CELL, MEASURED_SENSOR, RING_INSTANTS
from vibroimpact.orchestrator.scene.measuring_models import LoadCell as CellTable

Floats = NDArray[np.float64]
IMPACT_TIME, IMPACT_IMPULSE, IMPACT_CONTACT = 0, 3, 4
"""Columns of the impacts that the chain uses."""
NO_IMPACTS: Floats = np.empty((0, 7))


class MeasuringChain:
    """The sensor and the load cell of a scene, which turn the motion of its body into voltages.

    The scene is at a point of its sweep. The channels come from `CHANNELS`; the caller knows the voltage `drive`.
    `variables` are the variables of the body's FMU that the chain reads, each once. `needs_impacts`: whether the load
    cell is behind a rigid stop, so that the body has to record its impacts.
    """

    def __init__(self, scene: Scene, channels: Sequence[str]) -> None:
        self._scene, self.channels = scene, tuple(channels)
        cell = scene.load_cell if LOAD_CELL in channels else None
        self._readings = {name: MEASURED_SENSOR[name] for name in channels if name in MEASURED_SENSOR}
        self._force = f"contact[{cell.stop}].force" if cell else ""
        self.variables = tuple(dict.fromkeys((*self._readings.values(), *([self._force] if cell else []))))
        self.needs_impacts = cell is not None and LAWS[scene.stops[cell.stop - 1].law].is_rigid
        self._cell = None if cell is None else _opened(cell)

    @property
    def finest(self) -> float:
        """Longest step that follows the ring of the load cell, s; 0: no ring, or a rigid stop (exact at any step)."""
        cell = self._scene.load_cell
        rings = cell is not None and self._cell is not None and not self.needs_impacts
        ring = cell.natural_frequency if cell is not None and rings else 0.0
        return 1.0 / (RING_INSTANTS * ring) if ring else 0.0

    @property
    def lead(self) -> float:
        """Time after which the start state of the load cell has decayed, s; infinite where its ring does not decay."""
        cell = self._scene.load_cell
        if cell is None or self._cell is None:
            return 0.0
        after = cell.contact_duration or 0.0
        if cell.natural_frequency == 0.0:
            return after
        ring, ratio = 2.0 * math.pi * cell.natural_frequency, cell.damping_ratio
        # an overdamped cell has two rates: the slower one counts
        rate = ring * (ratio if ratio <= 1.0 else 1.0 / (ratio + math.sqrt(ratio * ratio - 1.0)))
        return after + (_DECAYED / rate if rate > 0.0 else math.inf)

    def begin(self, time: float, values: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the volts at a start time (s), with the load cell settled; values and volts have the shape (1,)."""
        return self.volts(np.array([time]), values, NO_IMPACTS)

    def volts(self, times: Floats, values: Mapping[str, Floats], impacts: Floats) -> dict[str, Floats]:
        """Return the voltages of the chain at further instants, by channel without `drive`, shape (instant,).

        The times ascend, s. `values` has each of the variables, SI, shape (instant,); `acceleration` is absolute.
        `impacts` are the impacts since the last instant of the call before, shape (impact, 7), `IMPACT_COLUMNS`.
        """
        sensor, found = self._scene.sensor, {}
        for name, variable in self._readings.items():
            assert sensor is not None  # the rules of scenes require [sensor]
            found[name] = sensor_reading(values[variable], sensor.gain, sensor.offset, sensor.range or 0.0)
        if self._cell is not None:
            hits, impulses = self.hits(impacts)
            found[LOAD_CELL] = self._cell.follow(times, values[self._force], hits, impulses)
        return found

    def hits(self, impacts: Floats) -> tuple[Floats, Floats]:
        """Return instants and impulses of the impacts that hit the load cell as half sines."""
        cell = self._scene.load_cell
        if cell is None or not self.needs_impacts:
            return np.empty(0), np.empty(0)
        own = impacts[impacts[:, IMPACT_CONTACT] == cell.stop]
        return thinned(own[:, IMPACT_TIME], own[:, IMPACT_IMPULSE], cell.contact_duration or 0.0)


def _opened(cell: CellTable) -> LoadCell:
    numbers = (cell.sensitivity, cell.natural_frequency, cell.damping_ratio, cell.offset, cell.drift)
    return LoadCell(*numbers, cell.contact_duration or 0.0)


_DECAYED = 37.0
"""Number of time constants after which a ring is below the rounding of doubles: exp(-37) = 1e-16."""


_OVERLAPPING = 1000
"""Number of half sines under way at once, above which neighbours are joined; the cell has room for twice as many."""


def thinned(times: Floats, impulses: Floats, duration: float) -> tuple[Floats, Floats]:
    """Return impacts with at most about `_OVERLAPPING` of them within a duration, joining neighbours in a chatter.

    With more impacts, all impacts within a `_OVERLAPPING`th of the duration become one impact, with their impulse at
    their centre.

    Examples
    --------
    >>> times, impulses = thinned(np.linspace(0.0, 1.0, 5001), np.full(5001, 0.1), 1.0)
    >>> len(times), round(float(impulses.sum()), 9)
    (1001, 500.1)
    """
    if len(times) <= _OVERLAPPING or (times[_OVERLAPPING:] - times[:-_OVERLAPPING] >= duration).all():
        return times, impulses
    slot = np.floor((times - times[0]) * (_OVERLAPPING / duration))
    first = np.flatnonzero(np.diff(slot, prepend=-1.0))
    weights = impulses + np.finfo(np.float64).tiny
    sums = np.add.reduceat(weights, first)
    centres = np.add.reduceat((times - times[0]) * weights, first) / sums
    return np.clip(times[0] + centres, times[first], times[np.append(first[1:], len(times)) - 1]), sums


def held_exciter(scene: Scene) -> HeldExciter | None:
    """Return the exciter that turns voltages into forces in the loop over samples; None without an exciter."""
    exciter = scene.exciter
    if exciter is None:
        return None
    magnet = Magnet(exciter.gain, exciter.offset, exciter.distance, EXCITER_SIDES[exciter.side])
    # a beam has a sensor where the force acts, see `parameters`
    place = "sensor[1].displacement" if scene.body.PLACE == "location" else "displacement"
    return HeldExciter(magnet, place)
