"""A scene with a measuring chain as the plant of a rig: voltages in, voltages out, block by block.

Output voltages are analog; `conversion` has the noise and the conversion of each input of a rig.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.measuring import LoadCell, exciter_force
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.measuring.chain import NO_IMPACTS, Floats, MeasuringChain, held_exciter
from vibroimpact.orchestrator.run.measuring.steps import Counts, cut, pieces_of
from vibroimpact.orchestrator.run.parameters import float_parameters, state_variables
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.run.record import ROW_IMPACT, in_time_order
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.measuring_models import DRIVE, LOAD_CELL, MEASURED_SENSOR

INSTANTS_AT_ONCE = 2**16
"""Maximum number of instants of a block held in memory at once."""


class MeasuredSession:
    """A scene with a measuring chain that is driven by voltages: the plant of a rig.

    Parameters
    ----------
    scene : Scene
        An oscillator or a beam, without a sweep; only the place of the force is taken from its `[forcing]`.
    channels : sequence of str
        Channels of each block; the scene has a table for each of them.

    Attributes
    ----------
    truth : dict of str to float
        Displacement (m) and velocity (m/s) of the observed point and contact force of all stops (N), at the time
        reached. With the load cell among the channels also the force on it (N), including half sines of impacts.
    impacts_of_block : ndarray, shape (impact, 7)
        Impacts of the last block, columns `IMPACT_COLUMNS`; a contact with a compliant stop is in the block of its
        end.

    Raises
    ------
    UsageError
        The scene has no `[body]`, a chain, a recording or a moving base, or it has no table for a channel.

    Notes
    -----
    Steps are cut into `RING_INSTANTS` pieces in a period of the load cell's ring, with a linear force on the cell
    between them. A long step is cut only at its end, until the cell's start state has decayed, into 5000 pieces at
    most. Steps of a cell behind a rigid stop are not cut. Half sines are exact at any step, and a resting body presses
    linearly over a step. The cut of samples into blocks makes no difference, unless more than 1000 impacts are within
    a contact_duration.

    The body sums the last bounces of a chatter, slower than 1e-4 of its first impact. The voltage of the load cell does
    not show them.

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
        exciter = held_exciter(self._scene)
        assert exciter is not None  # scenes without an exciter are refused
        self._exciter = exciter
        self._place = 0.0
        stops = [f"contact[{k}].force" for k in range(1, len(scene.stops) + 1)]
        observed = ("displacement", "velocity", exciter.displacement, *stops)
        self._variables = tuple(dict.fromkeys((*observed, *self._chain.variables)))
        driver = driver_of(self._scene, "fused")
        assert isinstance(driver, BodyDriver)
        self._driver = driver
        driver.watch(contacts=len(scene.stops), sampled=self._variables, state=state_variables(scene))
        self._on_cell: LoadCell | None = None
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
        row = self._driver.sampled().tolist()
        self._chain.begin(
            0.0, {name: np.array([now]) for name, now in zip(self._variables, row, strict=True)}
        )
        cell = self._scene.load_cell
        self._on_cell = LoadCell(1.0, contact_duration=cell.contact_duration or 0.0) if cell else None
        now = {name: np.array([value]) for name, value in zip(self._variables, row, strict=True)}
        self._update_truth(np.zeros(1), now, NO_IMPACTS)
        self.impacts_of_block = NO_IMPACTS

    def advance(self, times: Floats, volts: Floats) -> dict[str, Floats]:
        """Advance through all instants with a voltage held between them; return the channels at the end of each step.

        Parameters
        ----------
        times : ndarray, shape (sample + 1,)
            Instants in s from the session's time 0, ascending; the first is the present time.
        volts : ndarray, shape (sample,)
            Voltages, V, each held from one instant to the next.

        Returns
        -------
        dict of str to ndarray, shape (sample,)
            Voltages by channel, V, before noise and conversion; `drive` is the voltage held until the instant.

        Raises
        ------
        UsageError
            The instants do not ascend from the present time, or the voltages have another number or are not finite.
        ImpactLimitReached
            The run has met `execution.impact_limit`.
        ComponentError
            The body fails, or touches its exciter.
        """
        _refuse_wrong_block(times, volts, self.time)
        if not len(volts):
            return {name: np.empty(0) for name in self._channels}
        ends, held, renewed, last = cut(times, volts, self._chain.finest, self._chain.lead)
        found: dict[str, list[Floats]] = {name: [] for name in self._channels if name != DRIVE}
        impacts = []
        for first in range(0, len(ends), INSTANTS_AT_ONCE):
            part = slice(first, first + INSTANTS_AT_ONCE)
            block, hits = self._hold(ends[part], held[part], renewed[part])
            impacts.append(hits)
            for name, values in block.items():
                found[name].append(values)
        self.impacts_of_block = np.concatenate(impacts)
        channels = {name: np.concatenate(parts)[last] for name, parts in found.items()}
        return {name: volts.copy() if name == DRIVE else channels[name] for name in self._channels}

    def _hold(
        self, ends: Floats, held: Floats, renewed: NDArray[np.uint8]
    ) -> tuple[dict[str, Floats], Floats]:
        rows = self._driver.hold(
            ends, held, self._variables, renewed=renewed, exciter=self._exciter, recording=True
        )
        impacts = in_time_order(self._driver.rows.of_kind(ROW_IMPACT))
        self._driver.rows.blocks = []
        values = {name: np.ascontiguousarray(rows[:, place]) for place, name in enumerate(self._variables)}
        self._update_truth(ends, values, impacts)
        return self._chain.volts(ends, values, impacts), impacts

    def instants_in(self, times: Floats) -> Counts:
        """Return the number of pieces of each step between instants, shape (sample,)."""
        return pieces_of(np.diff(times), self._chain.finest, self._chain.lead)

    @property
    def fineness(self) -> float:
        """Least number of steps in a second for a ringing load cell; 0 without a ring."""
        return 1.0 / self._chain.finest if self._chain.finest else 0.0

    def exciter_force(self, volts: float) -> float:
        """Return the force of the exciter at a voltage and the present place of the body, N."""
        exciter = self._scene.exciter
        assert exciter is not None
        force = exciter_force(
            [volts], [self._place], exciter.gain, exciter.offset, exciter.distance, exciter.side
        )
        return float(force[0])

    def _update_truth(self, ends: Floats, values: Mapping[str, Floats], impacts: Floats) -> None:
        contacts = [float(column[-1]) for name, column in values.items() if name.startswith("contact[")]
        self.truth = {
            "displacement": float(values["displacement"][-1]),
            "velocity": float(values["velocity"][-1]),
            "contact_force": math.fsum(contacts),
        }
        self._place = float(values[self._exciter.displacement][-1])
        cell = self._scene.load_cell
        if LOAD_CELL in self._channels and cell is not None and self._on_cell is not None:
            force = values[f"contact[{cell.stop}].force"]
            self.truth["load_cell_force"] = float(
                self._on_cell.follow(ends, force, *self._chain.hits(impacts))[-1]
            )

    def close(self) -> None:
        """Free the components."""
        self._driver.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _refuse_no_plant(scene: Scene, channels: Sequence[str]) -> None:
    if not scene.is_lone_body or not scene.body.CAN_BE_MEASURED:
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
