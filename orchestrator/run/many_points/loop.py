"""Many points of a scene by one call: the loop over the points runs in C (`fmus.core.run_points`), without Python.

The FMU gets the same calls for each point as in `point`, so the rows are the same. A point with an error or a warning
of its body runs again alone, for its message. Scenes whose points need Python in between, for a time series, an
importer or several observed points, have no such loop: `loop_of` returns None.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core import runs as core
from vibroimpact.fmus.core.arrays import address
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.parameters import float_parameters, state_variables
from vibroimpact.orchestrator.run.record import OBSERVED, ROW_CAPACITY, TOUCH_DOWN, RecordedBody
from vibroimpact.orchestrator.run.window import forced_window
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import Stop

SHORTEST_DEADLINE = 0.5
"""Least deadline of a point in the loop, s; the loop checks the time only every few hundredths of a second."""

NOT_IN_THE_LOOP = ("modes", "macro_step", "seed")
"""Names of keys whose values need new components, or are whole numbers: points share the integers of the body."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PointValues:
    """Points as arrays, shape (point,): the values of each swept key, and whether the point begins a branch."""

    values: Mapping[str, Floats]
    first: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True, slots=True)
class PreparedPoints:
    """Points in the form for C: parameters and recording window of each; within a branch points begin at phase 0.

    Attributes
    ----------
    first : ndarray of bool, shape (point,)
        Whether the point begins a branch.
    table : ndarray, shape (point, parameter)
        Parameters in the order of the driver.
    begin, end : ndarray, shape (point,)
        Start and end of the recording, s.
    columns : dict of str to ndarray, shape (point,)
        The parameters by name.
    forced : bool
        Whether a periodic force acts.
    periods : bool
        Whether periods are recorded.
    scene : Scene
        A scene of the points' kind: its body has the parameters of theirs, see `is_coupled` of bodies.
    """

    first: NDArray[np.bool_]
    table: Floats
    begin: Floats
    end: Floats
    columns: Mapping[str, Floats]
    forced: bool
    periods: bool
    scene: Scene


def loop_of(scene: Scene, driver: RecordedBody, *, by_lanes: bool) -> PointLoop | None:
    """Return the loop in C over points of a scene; None where the points need Python in between."""
    deadline, chained = scene.execution.deadline, any(axis.continuation for axis in scene.sweep)
    if (
        not isinstance(driver, BodyDriver)
        or (scene.record.time_series is not None and not by_lanes)
        or scene.is_measured
        or len(scene.record.observed) > 1
        or any(axis.key.rpartition(".")[2] in NOT_IN_THE_LOOP for axis in scene.sweep)
        or (deadline is not None and deadline < SHORTEST_DEADLINE)
        or (chained and scene.body.IS_STRUCTURE and not by_lanes)
    ):
        return None
    return PointLoop(scene, driver, by_lanes=by_lanes)


class PointLoop:
    """Runs points of a scene on the instance of a runner, see `loop_of`; `by_lanes`: only points left out by lanes."""

    def __init__(self, scene: Scene, driver: BodyDriver, *, by_lanes: bool = False) -> None:
        self.scene, self.driver, self.by_lanes = scene, driver, by_lanes
        ports = [f"contact[{k}]" for k in range(1, len(scene.stops) + 1)]
        self._flags = tuple(f"{port}.{name}" for name in ("stuck", "open") for port in ports)
        touch_downs = [f"{port}.{name}" for port in ports for name in TOUCH_DOWN]
        others = [f"{port}.{name}" for name in ("stick_start", "force") for port in ports]
        finals = (*OBSERVED, *state_variables(scene), *others, *touch_downs)
        self.finals = (*finals, scene.body.SLOWEST) if scene.body.IS_STRUCTURE else finals
        self.finals_size = sum(map(driver.size, self.finals))  # the last may be an array
        self._kept: list[NDArray[Any]] = []  # keeps arrays alive while C reads them
        instance = driver.instance
        functions = [instance.address_of(name) for name in core.RunsFmu.FUNCTIONS]
        self.fmu = core.RunsFmu(instance.pointer, *functions, instance.log.environment)
        self._plans = {forced: self._planned(ports, forced=forced) for forced in (False, True)}

    # ---- input of C ----

    def _address(self, values: Any, dtype: Any) -> int:
        self._kept.append(np.ascontiguousarray(values, dtype=dtype))
        return address(self._kept[-1])

    def _variables(self, names: Sequence[str]) -> core.RunsVariables:
        references = [self.driver.references[name] for name in names]
        return core.RunsVariables(self._address(references, np.uint32), len(names))

    def _integers(self, kind: str, dtype: Any) -> tuple[core.RunsVariables, int]:
        """Return the integer parameters of a type, and the address of their values, in the order of the driver."""
        groups = [group for group in self.driver.integers if group.name == kind]
        references = [reference for group in groups for reference in group.references]
        values = np.concatenate([group.values for group in groups]) if groups else ()
        variables = core.RunsVariables(self._address(references, np.uint32), len(references))
        return variables, self._address(values, dtype)

    def _planned(self, ports: Sequence[str], *, forced: bool) -> core.RunsPlan:
        record, references, names = self.scene.record, self.driver.references, self.driver.float_names
        integers, integer_values = self._integers("Int64", np.int64)
        booleans, boolean_values = self._integers("Boolean", np.bool_)
        stops = self.scene.stops
        variables, places, size = self.driver.float_layout
        return core.RunsPlan(
            parameters=core.RunsVariables(self._address(variables, np.uint32), len(variables)),
            columns=len(places),
            places=self._address(places, np.int32),
            elements=self._address(np.zeros(size), np.float64),
            size=size,
            integers=integers,
            booleans=booleans,
            integer_values=integer_values,
            boolean_values=boolean_values,
            switches=self._variables(["record.impacts", "record.extrema", "record.periods"]),
            switch_values=self._address([record.impacts, record.extrema, self._periods(forced)], np.bool_),
            finals=self._variables(self.finals),
            finals_size=self.finals_size,
            flags=self._variables(self._flags),
            record_count=references["record.count"],
            record_taken=references["record.taken"],
            record_rows=references["record.rows"],
            row_capacity=ROW_CAPACITY,
            chained=self.chained,
            displacement=_place("displacement_start", names),
            velocity=_place("velocity_start", names),
            phase=_place("forcing.phase", names) if forced else -1,
            stops=len(stops),
            stop_position=self._address([names.index(f"{port}.position") for port in ports], np.int32),
            stop_direction=self._address([_direction(stop) for stop in stops], np.float64),
        )

    def takes(self, points: PreparedPoints) -> bool:
        """Tell whether the loop in C takes points: they have the parameters of the driver."""
        return points.scene.body.is_coupled == self.scene.body.is_coupled

    def plan(self, *, forced: bool) -> core.RunsPlan:
        """Return the plan that all points share."""
        return self._plans[forced]

    @property
    def chained(self) -> bool:
        """Whether a point starts from the final state of the point before."""
        return any(axis.continuation for axis in self.scene.sweep)

    def _periods(self, forced: bool) -> bool:
        return forced and (self.scene.record.extrema or self.scene.record.strobe)

    # ---- the points ----

    def prepared(self, points: PointValues) -> PreparedPoints | None:
        """Return points with their parameters; None where a point has invalid ones, or points are of mixed kinds."""
        try:
            scene = self._scene_of(points)
            names = self._names_of(scene)
            table = self._parameters(points, scene, names)
        except (ArithmeticError, ValueError):
            return None  # each point runs alone, for its own message
        columns = {name: table[:, place].copy() for place, name in enumerate(names)}
        angular_frequency = columns.get("forcing.angular_frequency", np.zeros(len(points)))
        forced = bool(angular_frequency.all())
        if not forced and angular_frequency.any():
            return None
        if not forced:
            record = self.scene.record
            begin = np.full(len(points), record.transient_time)
            end = np.full(len(points), record.transient_time + record.recorded_time)
            return PreparedPoints(points.first, table, begin, end, columns, forced, False, scene)
        if self.chained:
            _begin_at_phase_0(columns, ~points.first)
        with np.errstate(over="ignore", invalid="ignore"):  # the body refuses an infinite period
            begin, end = forced_window(self.scene.record, columns["forcing.phase"], angular_frequency)
        periods = self._periods(forced)
        return PreparedPoints(points.first, table, begin, end, columns, forced, periods, scene)

    def _scene_of(self, points: PointValues) -> Scene:
        """Return a scene of the kind of the first point; bodies without arrays have one kind."""
        if not self.driver.sets_arrays:
            return self.scene
        return self.scene.at({key: each[0].item() for key, each in points.values.items()})

    def _names_of(self, scene: Scene) -> Sequence[str]:
        """Return the parameters of points of this kind: those of the driver, in its order, for the scene's own kind."""
        if scene.body.is_coupled == self.scene.body.is_coupled:
            return self.driver.float_names
        return tuple(float_parameters(scene, None))

    def _parameters(self, points: PointValues, like: Scene, names: Sequence[str]) -> Floats:
        """Return these parameters of each point, shape (point, parameter)."""
        table = np.empty((len(points), len(names)))
        for chosen, values in self._alike(points):
            scene = self.scene.at(values)
            if scene.body.is_coupled != like.body.is_coupled:
                raise ValueError("the body has other parameters")
            found = float_parameters(scene, None)
            for column, name in enumerate(names):
                table[chosen, column] = found[name]
        return table

    def _alike(self, points: PointValues) -> Iterator[tuple[NDArray[np.intp] | slice, Mapping[str, Any]]]:
        """Yield groups of points whose parameters are found together, each with its values.

        The points of a beam are grouped by body: see `TAKES_ARRAYS` of bodies.
        """
        own = [key for key in points.values if self.scene.body.is_shaping(key)]
        if not own or self.scene.body.TAKES_ARRAYS:
            yield slice(None), points.values
            return
        bodies, which = np.unique([points.values[key] for key in own], axis=1, return_inverse=True)
        for number, body in enumerate(bodies.T):
            chosen = np.flatnonzero(which.reshape(-1) == number)
            others = {key: values[chosen] for key, values in points.values.items() if key not in own}
            yield chosen, others | dict(zip(own, body.tolist(), strict=True))


def _begin_at_phase_0(columns: dict[str, Floats], later: NDArray[np.bool_]) -> None:
    """Let some points begin where the phase of the clock is 0; further sines have their phases of that instant."""
    frequency = columns["forcing.angular_frequency"][later]
    turned = columns["forcing.phase"][later] / frequency
    for name in [name for name in columns if name.startswith("sine[") and name.endswith("].phase")]:
        own = columns[f"{name.removesuffix('phase')}angular_frequency"][later]
        columns[name][later] -= turned * own
    columns["forcing.phase"][later] = 0.0


def _place(name: str, names: Sequence[str]) -> int:
    return names.index(name) if name in names else -1


def _direction(stop: Stop) -> float:
    """Return the side of a rigid stop, 1 for upper and -1 for lower; 0 for a compliant stop."""
    if not LAWS[stop.law].is_rigid:
        return 0.0
    return 1.0 if stop.side == "upper" else -1.0
