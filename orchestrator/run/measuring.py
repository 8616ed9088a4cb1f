"""The measuring chain of a scene: from voltages that drive to voltages that sensors and load cell give, block by block.

What comes out is analog: noise and conversion, which each input of a rig has for itself, are in `conversion`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.measuring import EXCITER_SIDES, LoadCell, sensor_reading
from vibroimpact.fmus.core.stepping import Magnet
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.fused import BodyDriver, HeldExciter
from vibroimpact.orchestrator.run.parameters import float_parameters, state_variables
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.run.record import ROW_IMPACT, in_time_order
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.measuring_models import (
    DRIVE,
    LOAD_CELL,
    MEASURED_SENSOR,
    RING_INSTANTS,
)
from vibroimpact.orchestrator.scene.measuring_models import LoadCell as CellTable
from vibroimpact.orchestrator.scene.models import RestitutionStop

Floats = NDArray[np.float64]
IMPACT_TIME, IMPACT_IMPULSE, IMPACT_CONTACT = 0, 3, 4
"""Columns of impacts."""
NO_IMPACTS: Floats = np.empty((0, 7))


class MeasuringChain:
    """What a scene's sensor and load cell make of the motion of its body.

    Parameters
    ----------
    scene : Scene
        At a point of its sweep.
    channels : sequence of str
        Of `CHANNELS`; `drive` is a voltage that the caller knows.

    Attributes
    ----------
    variables : tuple of str
        Variables of the body's FMU that it takes, each once.
    needs_impacts : bool
        Whether the load cell is behind a rigid stop, so that the body has to record its impacts.
    """

    def __init__(self, scene: Scene, channels: Sequence[str]) -> None:
        self._scene, self.channels = scene, tuple(channels)
        cell = scene.load_cell if LOAD_CELL in channels else None
        self._readings = {name: MEASURED_SENSOR[name] for name in channels if name in MEASURED_SENSOR}
        self._force = f"contact[{cell.stop}].force" if cell else ""
        self.variables = tuple(dict.fromkeys((*self._readings.values(), *([self._force] if cell else []))))
        self.needs_impacts = cell is not None and isinstance(scene.stops[cell.stop - 1], RestitutionStop)
        self._cell = None if cell is None else _opened(cell)

    def instants_in(self, interval: float) -> int:
        """Return into how many steps a sample interval (s) is cut, so that the ring of the load cell is followed."""
        cell = self._scene.load_cell
        ring = cell.natural_frequency if cell is not None and self._cell is not None else 0.0
        return max(1, math.ceil(RING_INSTANTS * ring * interval * (1.0 - 1e-9)))

    @property
    def lead(self) -> float:
        """Time after which the load cell has forgotten how it began, s; infinite where its ring does not decay."""
        cell = self._scene.load_cell
        if cell is None or self._cell is None:
            return 0.0
        after = cell.contact_duration or 0.0
        if cell.natural_frequency == 0.0:
            return after
        ring, ratio = 2.0 * math.pi * cell.natural_frequency, cell.damping_ratio
        # of an overdamped cell the slower of two rates
        rate = ring * (ratio if ratio <= 1.0 else 1.0 / (ratio + math.sqrt(ratio * ratio - 1.0)))
        return after + (_FORGOTTEN / rate if rate > 0.0 else math.inf)

    def begin(self, time: float, values: Mapping[str, float]) -> None:
        """Begin at a time (s), the load cell settled under the force then; `values` are of the variables."""
        if self._cell is not None:
            self._cell.follow([time], [values[self._force]])

    def volts(self, times: Floats, values: Mapping[str, Floats], impacts: Floats) -> dict[str, Floats]:
        """Return what the chain gives at instants, going on from those before; `drive` is not among it.

        Parameters
        ----------
        times : ndarray, shape (instant,)
            s, ascending.
        values : mapping of str to ndarray, shape (instant,)
            Of each of the variables, SI; `acceleration` absolute.
        impacts : ndarray, shape (impact, 7)
            Those since the last of the instants before, columns `IMPACT_COLUMNS`.
        """
        sensor, found = self._scene.sensor, {}
        for name, variable in self._readings.items():
            assert sensor is not None  # the scene's rules see to it
            found[name] = sensor_reading(values[variable], sensor.gain, sensor.offset, sensor.range or 0.0)
        if self._cell is not None:
            hits, impulses = self._hits(impacts)
            found[LOAD_CELL] = self._cell.follow(times, values[self._force], hits, impulses)
        return found

    def _hits(self, impacts: Floats) -> tuple[Floats, Floats]:
        """Return instants and impulses of what hits the load cell as half sines."""
        cell = self._scene.load_cell
        if cell is None or not self.needs_impacts:
            return np.empty(0), np.empty(0)
        own = impacts[impacts[:, IMPACT_CONTACT] == cell.stop]
        return thinned(own[:, IMPACT_TIME], own[:, IMPACT_IMPULSE], cell.contact_duration or 0.0)


def _opened(cell: CellTable) -> LoadCell:
    numbers = (cell.sensitivity, cell.natural_frequency, cell.damping_ratio, cell.offset, cell.drift)
    return LoadCell(*numbers, cell.contact_duration or 0.0)


_FORGOTTEN = 37.0
"""Time constants after which a ring is below the rounding of doubles: exp(-37) = 1e-16."""


_OVERLAPPING = 1000
"""Half sines that may be under way at once before neighbours are joined; the cell has room for twice as many."""


def thinned(times: Floats, impulses: Floats, duration: float) -> tuple[Floats, Floats]:
    """Return impacts of which no more than `_OVERLAPPING` are within a duration, as the end of a chatter has them.

    Where there are more, those within a `_OVERLAPPING`th of the duration become one, with their impulse at their
    centre.

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
    """Return what makes forces of voltages within the loop over samples; None without an exciter."""
    exciter = scene.exciter
    if exciter is None:
        return None
    magnet = Magnet(exciter.gain, exciter.offset, exciter.distance, EXCITER_SIDES[exciter.side])
    # a beam has a sensor of its own where the force acts, see `parameters.beam_floats`
    place = "sensor[1].displacement" if scene.body.kind == "beam" else "displacement"
    return HeldExciter(magnet, place)


class MeasuredSession:
    """A scene with a measuring chain that is driven by voltages: the plant of a rig.

    Parameters
    ----------
    scene : Scene
        An oscillator or a beam, without a sweep; its `[forcing]` says only where the force acts.
    channels : sequence of str
        What each block gives: channels that the scene has tables for.

    Attributes
    ----------
    truth : dict of str to float
        Displacement (m) and velocity (m/s) of the observed point, contact force of all stops (N), at the time reached.
    impacts_of_block : ndarray, shape (impact, 7)
        Impacts that the last block recorded, columns `IMPACT_COLUMNS`; a contact with a stop that yields is in the
        block in which it ends.

    Raises
    ------
    UsageError
        A scene without `[body]`, of a chain, with a recording or a base that moves, or a channel that it has no table
        for.

    Notes
    -----
    A block is cut into steps of which `RING_INSTANTS` are in a period of the load cell's ring: between them the force
    on the cell is taken to be linear. How samples are cut into blocks makes no difference, unless more than 1000
    impacts are within a contact_duration.

    The last bounces of a chatter, which the body sums, are not in the voltage of the load cell: they are slower than
    1e-4 of its first.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene import parse_scene
    >>> tables = "[body]\\nmass = 1\\nstiffness = 0\\n[sensor]\\ngain = 2\\n[exciter]\\ngain = 3\\n"
    >>> scene = parse_scene(tables + "[record]\\nrecorded_time = 1", "free.toml")
    >>> with MeasuredSession(scene, ["sensor.velocity", "drive"]) as session:
    ...     session.begin()
    ...     found = session.advance(np.array([0.0, 1.0, 2.0]), np.array([1.0, -1.0]))
    >>> found["sensor.velocity"].tolist(), found["drive"].tolist()
    ([6.0, 0.0], [1.0, -1.0])
    """

    def __init__(self, scene: Scene, channels: Sequence[str]) -> None:
        _refuse_no_plant(scene, channels)
        values = {} if scene.forcing is None else {"forcing.amplitude": 0.0}
        self._scene, self._channels = scene.at(values), tuple(channels)
        self._chain = MeasuringChain(self._scene, channels)
        stops = [f"contact[{k}].force" for k in range(1, len(scene.stops) + 1)]
        self._variables = tuple(dict.fromkeys(("displacement", "velocity", *stops, *self._chain.variables)))
        driver = driver_of(self._scene, "fused")
        assert isinstance(driver, BodyDriver)
        self._driver = driver
        driver.watch(contacts=len(scene.stops), sampled=self._variables, state=state_variables(scene))
        self._exciter = held_exciter(self._scene)
        self.truth: dict[str, float] = {}
        self.impacts_of_block = NO_IMPACTS

    @property
    def time(self) -> float:
        """The time reached, s."""
        return self._driver.time

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each component's FMU."""
        return self._driver.hashes

    def begin(self) -> None:
        """Begin at time 0, from the scene's start state, at 0 V.

        Raises
        ------
        ComponentError
            The body refuses its parameters.
        """
        self._driver.begin(float_parameters(self._scene, None), self._scene.execution.deadline)
        self._driver.record(impacts=True, extrema=False, periods=False)
        self._chain = MeasuringChain(self._scene, self._channels)
        values = dict(zip(self._variables, self._driver.sampled().tolist(), strict=True))
        self._chain.begin(0.0, values)
        self._tell(values)
        self.impacts_of_block = NO_IMPACTS

    def advance(self, times: Floats, volts: Floats) -> dict[str, Floats]:
        """Go through all instants, a voltage held between them; return the channels at the end of each step.

        Parameters
        ----------
        times : ndarray, shape (sample + 1,)
            s from the session's time 0, ascending; the first is now.
        volts : ndarray, shape (sample,)
            V, each from one of the instants to the next.

        Returns
        -------
        dict of str to ndarray, shape (sample,)
            V by channel, before noise and conversion; `drive` is the voltage that was held until the instant.

        Raises
        ------
        UsageError
            Instants that do not ascend from now, another number of voltages, or one that is no number.
        ImpactLimitReached
            The run has met `execution.impact_limit`.
        ComponentError
            The body fails, or touches its exciter.
        """
        _refuse_wrong_block(times, volts, self.time)
        if not len(volts):
            return {name: np.empty(0) for name in self._channels}
        pieces = self._chain.instants_in(float(np.max(np.diff(times))))
        ends, held, renewed = _cut(times, volts, pieces)
        rows = self._driver.hold(
            ends, held, self._variables, renewed=renewed, exciter=self._exciter, recording=True
        )
        self.impacts_of_block = in_time_order(self._driver.rows.of_kind(ROW_IMPACT))
        self._driver.rows.blocks = []
        values = {name: np.ascontiguousarray(rows[:, place]) for place, name in enumerate(self._variables)}
        found = self._chain.volts(ends, values, self.impacts_of_block)
        self._tell({name: float(column[-1]) for name, column in values.items()})
        at_samples = {name: found[name][pieces - 1 :: pieces] for name in found}
        return {name: volts.copy() if name == DRIVE else at_samples[name] for name in self._channels}

    def _tell(self, values: Mapping[str, float]) -> None:
        force = math.fsum(value for name, value in values.items() if name.startswith("contact["))
        self.truth = {
            "displacement": values["displacement"],
            "velocity": values["velocity"],
            "contact_force": force,
        }

    def close(self) -> None:
        """Free the components."""
        self._driver.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _refuse_no_plant(scene: Scene, channels: Sequence[str]) -> None:
    if scene.general is not None or scene.replay is not None or scene.body.kind not in ("oscillator", "beam"):
        raise UsageError(
            f"{scene.source}: expected an oscillator or a beam with a measuring chain, got another scene."
        )
    if scene.forcing is not None and scene.forcing.kind != "force":
        raise UsageError(f"{scene.source}: forcing.kind: expected a force, got {scene.forcing.kind}.")
    if scene.exciter is None:
        raise UsageError(
            f"{scene.source}: expected [exciter], which makes a force of a voltage, got a scene without it."
        )
    needed = dict.fromkeys(MEASURED_SENSOR, scene.sensor) | {LOAD_CELL: scene.load_cell, DRIVE: scene.exciter}
    for name in channels:
        if name not in needed:
            raise UsageError(f"channels: expected {', '.join(needed)}, got {name!r}.")
        if needed[name] is None:
            table = name.partition(".")[0]
            raise UsageError(
                f"{scene.source}: {name}: expected [{table}] for this channel, got a scene without it."
            )


def _refuse_wrong_block(times: Floats, volts: Floats, now: float) -> None:
    if len(times) != len(volts) + 1 or times[0] != now or not (np.diff(times) > 0.0).all():
        raise UsageError(f"times: expected ascending instants from {now:.17g} s on, one more than volts.")
    if not np.isfinite(volts).all():
        raise UsageError("volts: expected finite voltages, got one that is no number.")


def _cut(times: Floats, volts: Floats, pieces: int) -> tuple[Floats, Floats, NDArray[np.uint8]]:
    """Cut each step into pieces of one length; return their ends, the voltage of each, and which begin a step."""
    if pieces == 1:
        ends = np.ascontiguousarray(times[1:], dtype=np.float64)
        return ends, np.ascontiguousarray(volts, dtype=np.float64), np.ones(len(volts), dtype=np.uint8)
    parts = np.arange(1, pieces + 1) / pieces
    table = times[:-1, np.newaxis] + np.diff(times)[:, np.newaxis] * parts
    table[:, -1] = times[1:]
    renewed = np.zeros((len(volts), pieces), dtype=np.uint8)
    renewed[:, 0] = 1
    return table.ravel(), np.repeat(np.asarray(volts, dtype=np.float64), pieces), renewed.ravel()
