"""An opened scene that can be stepped, with inputs and outputs; replays and plants of a rig use it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.parameters import float_parameters, state_variables
from vibroimpact.orchestrator.run.point import built_for, driver_of
from vibroimpact.orchestrator.run.time_series import TimeSeriesPlan
from vibroimpact.orchestrator.scene import Scene

Floats = NDArray[np.float64]
INPUTS = ("force", "base_acceleration")
"""Inputs of the bodies; the slope of each over a step is `force_rate` or `base_acceleration_rate`."""


class Session:
    """An opened scene of the short form, which advances step by step until it is closed.

    Parameters
    ----------
    scene : Scene
        A scene with a body.
    outputs : sequence of str
        Outputs of each step, with the names of a time series: `displacement`, `contact_force[1]`, ...
    execution : str
        `auto`, `fused` or `coupled`.
    others, connections : sequences
        Further components, connected to the body; such a session is coupled.

    Attributes
    ----------
    outputs : tuple of str
    time : float
        The time reached, s.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene import parse_scene
    >>> text = "[body]\\nmass = 1\\nstiffness = 0\\n[record]\\nrecorded_time = 1"
    >>> with Session(parse_scene(text, "free.toml"), ["velocity"]) as session:
    ...     session.begin()
    ...     session.advance(2.0, {"force": (3.0, 0.0)})
    {'velocity': 6.0}
    """

    def __init__(
        self,
        scene: Scene,
        outputs: Sequence[str] = ("displacement", "velocity"),
        *,
        execution: str = "auto",
        others: Sequence[ComponentSpec] = (),
        connections: Sequence[ConnectionSpec] = (),
    ) -> None:
        self._scene = scene
        self._plan = TimeSeriesPlan(scene, outputs)
        if self._plan.names != self._plan.all_names:
            channels = ", ".join(name for name in outputs if name not in self._plan.names)
            raise UsageError(
                f"outputs: expected variables of the body, got {channels}. A MeasuredSession has them."
            )
        self.outputs = self._plan.names
        chosen = "fused" if execution == "auto" and not others else execution
        self.execution = "coupled" if others else chosen
        self._driver = driver_of(scene, self.execution, others, connections)
        self._driver.watch(
            contacts=len(scene.stops),
            sampled=self._plan.variables,
            state=state_variables(scene),
            energies=self._plan.energies,
        )
        self._input_names = tuple(n for name in INPUTS if self._has(name) for n in (name, f"{name}_rate"))
        self._inputs = self._driver.inputs(self._input_names)

    def _has(self, name: str) -> bool:
        # a chain takes a force on each of its masses
        return name != "force" or "force" not in self._scene.body.AMPLITUDES

    @property
    def time(self) -> float:
        """The time reached, s."""
        return self._driver.time

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each component's FMU."""
        return self._driver.hashes

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages of the body at the start of the run."""
        return self._driver.warnings

    def begin(
        self, values: Mapping[str, float] | None = None, start: tuple[float, ...] | None = None
    ) -> None:
        """Begin at time 0, from the scene's start state or a carried state, with all inputs 0.

        Parameters
        ----------
        values : mapping of str to float, optional
            New values of keys of the scene, such as `body.damping_ratio`.
        start : tuple of float, optional
            Start state, see `parameters.float_parameters`.

        Raises
        ------
        ComponentError
            The body refuses its parameters.
        UsageError
            The components are made for another number of modes, or another macro step.
        """
        scene = self._scene.at(values) if values else self._scene
        if built_for(scene) != built_for(self._scene):
            raise UsageError(
                "body.modes, execution.macro_step: expected what the opened scene has, got another number. "
                "Open a scene that says so."
            )
        self._inputs.values[:] = 0.0
        self._forces, self._plan = scene.forces, self._plan.at(scene)
        self._parameters = float_parameters(scene, start)
        self._driver.begin(self._parameters, scene.execution.deadline)
        self._driver.record(impacts=True, extrema=False, periods=False)

    def advance(
        self, duration: float, inputs: Mapping[str, tuple[float, float]] | None = None
    ) -> dict[str, float]:
        """Advance by `duration` s and return the outputs at the end.

        Parameters
        ----------
        duration : float
            Length of the step, s, > 0.
        inputs : mapping of str to (float, float), optional
            Value at the start of the step and slope over the step, of `force` (N) and `base_acceleration` (m/s^2).
            Other inputs keep their last value, without a slope.
        """
        buffer = self._inputs.values
        buffer[1::2] = 0.0
        for name, (value, slope) in (inputs or {}).items():
            if name not in self._input_names:
                known = ", ".join(self._input_names[::2])
                raise UsageError(f"{name}: expected an input of the body ({known}), got another name.")
            place = self._input_names.index(name)
            buffer[place : place + 2] = value, slope
        self._inputs.set()
        self._driver.advance(self._driver.time + duration)
        return dict(zip(self.outputs, self.sample(), strict=True))

    def sample(self) -> Sequence[float]:
        """Return the present outputs, in the order of `outputs`."""
        return self._plan.row(self._driver.sampled(), self._forces, self._parameters, self.time)

    def follow(self, times: Floats, name: str | None = None, values: Floats | None = None) -> Floats:
        """Advance through all instants with an input that is linear between them; return the outputs at each.

        Parameters
        ----------
        times : ndarray, shape (step + 1,)
            Instants in s from the session's time 0, ascending; the first is the present time.
        name : str or None
            The input that follows `values`; None: no input.
        values : ndarray, shape (step + 1,)
            Values of the input at the instants.

        Returns
        -------
        ndarray, shape (step + 1, outputs)
        """
        slopes = np.zeros(len(times)) if values is None else np.append(np.diff(values) / np.diff(times), 0.0)
        if not isinstance(self._driver, BodyDriver):
            return self._follow_coupled(times, name, values, slopes)
        if name is None or values is None:
            found = [self._driver.sampled().copy(), self._driver.advance_sampling(times[1:])]
        else:
            found = [self._driver.follow(times, name, np.ascontiguousarray(values), slopes)]
            self._set_input(name, values[-1], 0.0)
            found.append(self._driver.sampled())
        plan = self._plan
        return plan.rows(np.vstack(found), plan.variables, self._forces, self._parameters, times)

    def _follow_coupled(
        self, times: Floats, name: str | None, values: Floats | None, slopes: Floats
    ) -> Floats:
        """Follow the instants by one call of the importer for each step."""
        rows = np.empty((len(times), len(self.outputs)))
        for i, time in enumerate(times.tolist()):
            self._driver.advance(time)
            if name is not None and values is not None:
                self._set_input(name, values[i], slopes[i])
            rows[i] = self.sample()
        return rows

    def _set_input(self, name: str, value: float, slope: float) -> None:
        place = self._input_names.index(name)
        self._inputs.values[place : place + 2] = value, slope
        self._inputs.set()

    def hold(self, times: Floats, forces: Floats) -> Floats:
        """Advance through all instants with a force held between them; return the outputs at the end of each step.

        One call runs all samples in C, bit for bit as single calls of `advance`. From the first call on nothing is
        recorded, so that a session may go on for days.

        Parameters
        ----------
        times : ndarray, shape (sample + 1,)
            Instants in s from the session's time 0, ascending; the first is the present time.
        forces : ndarray, shape (sample,)
            Forces, N, each held from one instant to the next.

        Returns
        -------
        ndarray, shape (sample, outputs)

        Raises
        ------
        UsageError
            The instants do not ascend from the present time, or the forces have another number or are not finite. Or
            the session is coupled, has a chain, or has outputs that the FMU lacks (accelerations under forcing).
        ImpactLimitReached
            The run has met `execution.impact_limit`.

        Examples
        --------
        >>> from vibroimpact.orchestrator.scene import parse_scene
        >>> text = "[body]\\nmass = 1\\nstiffness = 0\\n[record]\\nrecorded_time = 1"
        >>> with Session(parse_scene(text, "free.toml"), ["velocity"]) as session:
        ...     session.begin()
        ...     session.hold(np.array([0.0, 1.0, 2.0]), np.array([3.0, -1.0])).tolist()
        [[3.0], [2.0]]
        """
        driver = self._driver
        if not isinstance(driver, BodyDriver) or not self._has("force"):
            raise UsageError("hold: expected a fused oscillator or beam, got another body or a coupled one.")
        if not self._plan.is_plain(self._forces):
            raise UsageError(
                f"hold: expected outputs that the FMU has as they are, got {', '.join(self.outputs)}."
            )
        if len(times) != len(forces) + 1 or times[0] != driver.time or not (np.diff(times) > 0.0).all():
            raise UsageError(
                f"hold: expected ascending instants from {driver.time:.17g} s on, one more than forces."
            )
        if not np.isfinite(forces).all():
            raise UsageError("hold: expected finite forces, got one that is no number.")
        ends = np.ascontiguousarray(times[1:], dtype=np.float64)
        return driver.hold(ends, np.ascontiguousarray(forces, dtype=np.float64), self._plan.variables)

    def impacts(self) -> Floats:
        """Return the impacts so far, shape (impact, 8): columns `analysis.schema.IMPACT_COLUMNS`."""
        return self._driver.impacts()

    def sticks(self) -> Floats:
        """Return the sticks so far, shape (stick, 3): start, end (NaN: not ended), contact."""
        return self._driver.sticks()

    def observed(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s) of the observed point."""
        return self._driver.observed()

    def whole_state(self) -> Floats | None:
        """Return the whole state of a chain or beam, see `parameters.state_variables`."""
        return self._driver.whole_state()

    def close(self) -> None:
        """Free the components."""
        self._driver.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
