"""Runs the points of a scene: one point in, one `RunRecord` out.

`fused` execution: the contact law runs inside the body FMU, and one step covers all periods that are not recorded.
`coupled`: each stop is a separate FMU, and the importer transfers every contact between the FMUs.
"""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import IMPACT_COLUMNS, Outcome, RunRecord
from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.orchestrator.fmi.instance import WrapOf
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.run.empty_record import columns_of_periods
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, loop_of
from vibroimpact.orchestrator.run.parameters import (
    float_parameters,
    integer_parameters,
    most_elements,
    padded_state,
    state_variables,
    without_padding,
)
from vibroimpact.orchestrator.run.points import PointColumns, State
from vibroimpact.orchestrator.run.record import (
    ROW_FURTHER,
    ROW_PERIOD,
    DeadlineReached,
    ImpactLimitReached,
    RecordedBody,
    RunEnded,
    UnboundedMotion,
)
from vibroimpact.orchestrator.run.runner import Rows, Runner
from vibroimpact.orchestrator.run.time_series import TimeSeriesPlan, few_samples_message
from vibroimpact.orchestrator.run.window import (
    TWO_PI,
    error_in_keys_of,
    in_keys_of,
    late_message,
    limit_message,
    no_load_message,
    recorded_window,
)
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import signals_of
from vibroimpact.orchestrator.scene.laws import LAWS

if TYPE_CHECKING:
    from vibroimpact.orchestrator.run.measuring.run import MeasuredRun

ENGINE = 9
"""Version of the C engine that follows the package's bodies; other versions give other results in a campaign."""

ENGINE_OF_ONE_MASS = 6
"""Version of the engine with the last change of a bit of one mass between rigid stops, outside lanes."""

SAMPLES_OF_A_BLOCK = 16_384
"""Largest number of samples of one call, after which Python stores them and hears signals."""

_DURATION = IMPACT_COLUMNS.index("impact_duration")


def engine_of(scene: Scene, execution: str) -> int:
    """Return the version of the engine with the last change of a bit of such runs: campaigns since then go on."""
    is_one_mass = not scene.body.IS_STRUCTURE and all(LAWS[stop.law].is_rigid for stop in scene.stops)
    return ENGINE_OF_ONE_MASS if is_one_mass and execution != "lanes" else ENGINE


class PointRunner(Runner):
    """Runs points of one scene in this process; all points share the component instances.

    Parameters
    ----------
    scene : Scene
        The scene; swept keys take their values from each point.
    execution : str
        `fused`, `coupled`, or `auto`, which takes `lanes` for sweeps that lanes can run, else `fused`.
    wrap : callable or None
        Returns, for a component's name, the wrapper of its FMU's functions.

    Attributes
    ----------
    execution : str
        `fused`, `coupled`, or `lanes` for many points at once (`many_points`); a single point of `lanes` runs fused.
    engine : int
        Version of the engine that follows the body.
    instruction_set : str
        Machine architecture of the components.
    fmu_hashes : dict of str to str
        SHA-256 of each component's FMU, by instance.
    driver : RecordedBody
        The driver of the body.
    """

    def __init__(self, scene: Scene, *, execution: str = "auto", wrap: WrapOf | None = None) -> None:
        chosen = "lanes" if goes_by_lanes(scene) else "fused"
        self.execution = chosen if execution == "auto" else execution
        self.engine = engine_of(scene, self.execution)
        self.instruction_set = platform.machine()
        self.scene, self._wrap = scene, wrap
        self._plan = TimeSeriesPlan(scene)
        self._open(scene)
        self.fmu_hashes = self.driver.hashes

    def _open(self, scene: Scene) -> None:
        self.driver = driver_of(scene, self.execution, wrap=self._wrap)
        self.driver.watch(
            contacts=len(scene.stops),
            sampled=self._plan.variables,
            state=state_variables(scene),
            energies=self._plan.energies,
            slowest=scene.body.SLOWEST if scene.body.IS_STRUCTURE else "",
        )
        self._built_for = built_for(scene)

    def _reopen_if_other(self, scene: Scene) -> None:
        """Make the components anew unless they were made for the scene's number of modes and macro step."""
        if self._built_for != built_for(scene):
            self.driver.close()
            self._open(scene)

    def run(
        self,
        values: Mapping[str, float],
        start: tuple[float, ...] | None = None,
        *,
        at_time_0: bool = False,
    ) -> RunRecord:
        """Run one point.

        Parameters
        ----------
        values : mapping of str to float
            Values of the swept keys.
        start : tuple of float or None
            State carried over at forcing phase 0, see `parameters.float_parameters`; None: the scene's own
            start state.
        at_time_0 : bool
            Whether the start is a state at time 0, where the forces have their own phases.

        Raises
        ------
        ComponentError
            The body refuses its parameters or fails.
        """
        began = time.perf_counter()
        scene = self.scene.at(values) if values else self.scene
        self._reopen_if_other(scene)
        plan = self._plan.at(scene) if values else self._plan
        state = without_padding(start, len(state_variables(scene)) // 2)
        run = _Run(scene, self.driver, plan, state, at_time_0=at_time_0)
        try:
            outcome, message = run.run()
        except ComponentError as error:
            raise error_in_keys_of(scene, error) from None
        message = message or in_keys_of(scene, "; ".join(self.driver.warnings))
        record = run.record(outcome, message, time.perf_counter() - began)
        return replace(record, final_state=padded_state(record.final_state, most_elements(self.scene)))

    @cached_property
    def loop(self) -> PointLoop | None:
        """The loop in C over points of the scene; None where the points need Python in between."""
        return loop_of(self.scene, self.driver, by_lanes=self.execution == "lanes")

    def rows(self, points: PointColumns, start: State | None = None, deadline: float = math.inf) -> Rows:
        """Run the points of a sweep, by one call where possible, see `Runner.rows`.

        The results of the loop equal those of `run`; the results of lanes equal them to rounding.
        """
        if not self.scene.sweep or self.loop is None:
            return super().rows(points, start, deadline)
        # the import takes time
        from vibroimpact.orchestrator.run.many_points.rows import rows_of

        ran = rows_of(self.loop, points, start, deadline, self.record_of)
        return super().rows(points, start, deadline) if ran is None else ran

    def close(self) -> None:
        """Free the components."""
        self.driver.close()


def built_for(scene: Scene) -> tuple[object, ...]:
    """Return the numbers for which a scene's components are made, and which parameters cannot change later."""
    seeds = tuple(signal.seed_number for signal in signals_of(scene.forces))
    body = scene.body
    return body.size, body.kept_modes, body.is_coupled, scene.execution.macro_step, seeds


def driver_of(
    scene: Scene,
    execution: str,
    others: Sequence[ComponentSpec] = (),
    connections: Sequence[ConnectionSpec] = (),
    *,
    wrap: WrapOf | None = None,
) -> RecordedBody:
    """Return the driver of a scene's body: fused, or coupled to its stops and to other components."""
    floats, integers = float_parameters(scene, None), integer_parameters(scene)
    fmu = scene.body.FMU
    if execution in ("fused", "lanes"):
        return BodyDriver(floats, integers, fmu, wrap=wrap)
    if execution == "coupled":
        # imported only for coupled execution
        from vibroimpact.orchestrator.run.coupled import CoupledDriver

        step = scene.execution.fixed_step
        return CoupledDriver(
            floats,
            integers,
            len(scene.stops),
            macro_step=math.inf if step is None else step,
            exchange=scene.execution.exchange,
            body=fmu,
            others=others,
            connections=connections,
            wrap=wrap,
        )
    raise SceneError([f'{scene.source}: execution.how: expected "fused" or "coupled", got "{execution}".'])


class _Run:
    """One run: the times of its recording, and its record."""

    def __init__(
        self,
        scene: Scene,
        driver: RecordedBody,
        plan: TimeSeriesPlan,
        start: tuple[float, ...] | None,
        *,
        at_time_0: bool,
    ) -> None:
        self.scene = scene
        self.driver = driver
        self.plan = plan
        self.parameters = float_parameters(scene, None if at_time_0 else start)
        if at_time_0 and start is not None:
            self.parameters |= dict(zip(scene.body.start_names, start, strict=True))
        self.samples: list[NDArray[np.float64]] = []  # blocks of rows: time, then the variables
        self.begin_time, self.end_time = recorded_window(scene, self.parameters)
        self.measured: MeasuredRun | None = None

    def run(self) -> tuple[Outcome, str]:
        """Run to the end; return the outcome and its message."""
        execution, driver = self.scene.execution, self.driver
        driver.begin(self.parameters, execution.deadline)
        try:
            if self.scene.is_measured:
                self._go_measured()
            else:
                driver.advance(self.begin_time)
                self._begin_recording()
                self._advance_sampling()
            driver.advance(self.end_time)
        except ImpactLimitReached:
            return Outcome.impact_limit, limit_message(execution.impact_limit, driver.time)
        except UnboundedMotion as ended:
            return Outcome.unbounded, ended.reason
        except DeadlineReached:
            return Outcome.timeout, late_message(execution.deadline, driver.time)
        return self._ended()

    def _ended(self) -> tuple[Outcome, str]:
        """Return the outcome and the message of a run that came to its end."""
        resting = self.driver.sticks_open()
        pressed = [(contact, start) for contact, start in resting if self._load(contact) > 0.0]
        idle = [contact for contact, _ in resting if contact not in dict(pressed)]
        stuck = bool(pressed) and self._rests_for_ever(pressed)
        remarks = [no_load_message(self.scene.stop_keys[idle[0] - 1])] if idle and not stuck else []
        if self.plan.feels_contacts:
            durations = self.driver.impacts()[:, _DURATION]
            rate, has_peaks = self.scene.sampling_rate, self.scene.record.impacts
            remarks.append(few_samples_message(durations, rate, has_peaks=has_peaks))
        return Outcome.stuck if stuck else Outcome.ok, "; ".join(filter(None, remarks))

    def _load(self, contact: int) -> float:
        """Return the present force that presses the body on a stop, N."""
        return float(self.driver.values_of([f"contact[{contact}].force"])[0])

    def _go_measured(self) -> None:
        # only a scene with a measuring chain needs this import
        from vibroimpact.orchestrator.run.measuring.run import MeasuredRun

        assert isinstance(self.driver, BodyDriver)  # the rules of scenes allow no other driver
        window = self.begin_time, self.end_time
        self.measured = MeasuredRun(self.scene, self.driver, self.plan, self.parameters, window)
        self.measured.go(self._begin_recording)

    def _begin_recording(self) -> None:
        record = self.scene.record
        measured = self.measured is not None and self.measured.needs_impacts
        impacts = record.impacts or measured or self.plan.feels_contacts
        self.driver.record(impacts=impacts, extrema=record.extrema, periods=self._has_periods())

    def _has_periods(self) -> bool:
        record = self.scene.record
        return self.scene.period is not None and (record.extrema or record.strobe)

    # ---- time series ----

    def _advance_sampling(self) -> None:
        rate = self.scene.sampling_rate
        if not rate:
            return
        count = math.floor((self.end_time - self.begin_time) * rate * (1.0 + 1e-12)) + 1
        for first in range(0, count, SAMPLES_OF_A_BLOCK):
            numbers = np.arange(first, min(first + SAMPLES_OF_A_BLOCK, count))
            times = np.minimum(self.begin_time + numbers / rate, self.end_time)
            try:
                self._take_samples(times, self.driver.advance_sampling(times))
            except RunEnded as reached:
                self._take_samples(times[: len(reached.samples)], reached.samples)
                raise

    def _take_samples(self, times: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        if len(times):
            forces, parameters = self.scene.forces, self.parameters
            rows = self.plan.rows(values, self.plan.variables, forces, parameters, times)
            self.samples.append(np.column_stack([times, rows]))

    # ---- record ----

    def _rests_for_ever(self, resting: Sequence[tuple[int, float]]) -> bool:
        """Return whether the body rests for good on pressed stops, each given with the start of its rest.

        An oscillator rests for good if no phase of the force can lift it. A structure, whose other modes go on, is
        observed: its contact force has not reached zero over the whole recording. Without a forcing period, one period
        of the slowest mode is enough, since every mode of the held body has its strongest pull within it.
        """
        if not self.scene.body.IS_STRUCTURE:
            return self._is_pressed(resting[0][0])
        slowest = self.driver.slowest() if self.scene.period is None else 0.0
        if self.scene.body.size == 1:
            slowest = abs(slowest)  # a spring that pushes
        long_enough = TWO_PI / slowest if slowest > 0.0 else self.end_time - self.begin_time
        return self.driver.time - min(start for _, start in resting) >= long_enough

    def _is_pressed(self, contact: int) -> bool:
        stop = self.scene.stops[contact - 1]
        sign = 1.0 if stop.side == "upper" else -1.0
        press = sign * (self.parameters.get("force", 0.0) - self.parameters["stiffness"] * stop.position)
        if self.scene.falling_force:
            return self.scene.period is None  # the force at other phases is not known in advance
        return self.scene.period is None or press > abs(self.parameters.get("forcing.amplitude", 0.0))

    def record(self, outcome: Outcome, message: str, seconds: float) -> RunRecord:
        """Return the record of the run."""
        self.driver.take_rows()
        has_impacts = self.scene.record.impacts
        displacement, velocity = self.driver.observed()
        if not math.isfinite(displacement):
            where = f"displacement: expected a finite number, got {displacement}"
            raise ComponentError(f"body: {where} at time {self.driver.time:.17g}.", instance="body")
        return RunRecord(
            outcome=outcome,
            message=message,
            periods=self._period_rows(),
            impacts=self.driver.impacts() if has_impacts else None,
            sticks=self.driver.sticks() if has_impacts else None,
            samples=self._sample_rows(),
            final_displacement=displacement,
            final_velocity=velocity,
            final_phase=self._final_phase(outcome),
            seconds=seconds,
            final_state=self.driver.whole_state(),
        )

    def _final_phase(self, outcome: Outcome) -> float:
        if self.scene.period is None:
            return math.nan
        if outcome in (Outcome.ok, Outcome.stuck):
            return 0.0  # runs end exactly at forcing phase 0
        angle = self.parameters["forcing.angular_frequency"] * self.driver.time
        return (angle + self.parameters["forcing.phase"]) % TWO_PI

    def _period_rows(self) -> NDArray[np.float64] | None:
        if not self._has_periods():
            return None
        rows = self.driver.rows
        periods = rows.of_kind(ROW_PERIOD)[:, 1:6]
        further = rows.of_kind(ROW_FURTHER)[:, 2:6]
        width = columns_of_periods(self.scene) - periods.shape[1]
        return np.hstack([periods, further.reshape(len(periods), width)]) if width else periods

    def _sample_rows(self) -> NDArray[np.float64] | None:
        series = self.scene.record.time_series
        if series is None:
            return None
        if self.measured is not None:
            return self.measured.samples()
        return np.concatenate([np.empty((0, 1 + len(series.variables))), *self.samples])
