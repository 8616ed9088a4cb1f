"""Replay: recorded channels drive a scene's body, and its motion is compared with measured channels.

Two ways, one physics. `fused`: the body alone, its input set at every sample. `coupled`: a Replay FMU with the body
and its stops. `auto` takes the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.naming import file_name_of, known_unit, sample_rule
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.recording import Channel, Recording, open_signals
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import ComponentError, DatasetError, SceneError, UsageError
from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal, build_replay
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.replay.covariance import drawn_noise, quiet_noise
from vibroimpact.orchestrator.replay.drive import VOLTS, DriveSignal, drive_of, step_instants
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.run.record import DeadlineReached, ImpactLimitReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.fields import field_of, numeric_keys, rule_of
from vibroimpact.orchestrator.scene.models import AMPLITUDE
from vibroimpact.orchestrator.scene.replay_models import Compared, Replay
from vibroimpact.orchestrator.scene.rules.replay import plain_variable

Floats = NDArray[np.float64]

#: Names of the component that replays, and of its one channel.
REPLAY, DRIVE = "replay", "drive"


@dataclass(frozen=True, slots=True)
class ChannelReading:
    """Converts a simulated variable to the reading of a channel, in the SI unit of the channel."""

    compared: Compared
    variable: str
    """Name of the variable in a time series."""
    channel: Channel
    """The measured channel."""
    is_sensor: bool
    """Whether `[sensor]` applies to the reading: gain * value + offset."""
    same_kind: bool
    """Whether variable and channel measure the same quantity, so that the gain is a pure number."""

    def of(self, values: Floats, scene: Scene) -> Floats:
        """Return the readings for SI values of the variable, shape (sample,)."""
        if not self.is_sensor or scene.sensor is None:
            return values
        unit = measured_unit(self.channel.unit).factor
        gain = scene.sensor.gain * (1.0 if self.same_kind else unit)
        return gain * values + scene.sensor.offset * unit


@dataclass(frozen=True, slots=True)
class Motion:
    """The simulated motion of a replay.

    Attributes
    ----------
    time : ndarray, shape (sample,)
        s, on the clock of the drive; without a drive, on the clock of the first compared channel.
    readings : tuple of ndarray, shape (sample,)
        One for each compared pair, in the SI unit of its channel.
    impacts : ndarray, shape (impact, 8)
        Columns `analysis.schema.IMPACT_COLUMNS`; times on the same clock.
    sticks : ndarray, shape (stick, 3)
        Columns `analysis.schema.STICK_COLUMNS`, on the same clock.
    warnings : tuple of str
        Warnings of the body at its start.
    """

    time: Floats
    readings: tuple[Floats, ...]
    impacts: Floats
    sticks: Floats
    warnings: tuple[str, ...]


class Replayer:
    """A scene and a recording, opened: simulates the replay any number of times.

    Parameters
    ----------
    scene : Scene
        A scene with `[replay]`.
    recording : Recording
        As from `open_signals`.
    execution : str
        `auto`, `fused` or `coupled`.

    Raises
    ------
    DatasetError
        A channel is not in the recording, or measures another quantity.
    SceneError
        The scene has no `[replay]`.
    """

    def __init__(self, scene: Scene, recording: Recording, *, execution: str = "auto") -> None:
        self.scene = scene
        self.recording = recording
        self.replay = replay_table(scene)
        self.readings = tuple(_reading(compared, scene, recording) for compared in self.replay.compare)
        self.drive = self._drive()
        self.time, self._values = self._instants()
        self.execution = "fused" if execution == "auto" else execution
        self._folder: ScratchFolder | None = None
        self._session = self._open()

    def _drive(self) -> DriveSignal | None:
        replay = self.replay
        if replay.drive is None:
            return None
        channel = self.recording.channel(replay.channel)
        unit = "" if self.scene.exciter is None else VOLTS
        return drive_of(channel, replay.drive, replay.drive_offset, unit, designed=self._is_designed(channel))

    def _is_designed(self, channel: Channel) -> bool:
        """Return whether the drive is a computed force: no measured channel is compared with its motion."""
        computed = self.replay.drive == "force" and self.scene.exciter is None and not self.replay.compare
        return computed and "terminal" not in channel.attrs  # a channel of a rig has a terminal

    def _instants(self) -> tuple[Floats, Floats | None]:
        """Return the instants of the simulation, and the drive there."""
        replay, drive = self.replay, self.drive
        if drive is None:
            times = self.readings[0].channel.time
            return _cut(times, replay.start, replay.stop), None
        finest = min(
            (1.0 / reading.channel.axis.rate for reading in self.readings),
            default=float(np.diff(drive.time).min()),
        )
        ends = [float(drive.time[-1]), *(float(reading.channel.time[-1]) for reading in self.readings)]
        times = step_instants(drive.time, finest, max(ends) if replay.stop is None else replay.stop)
        times = _cut(times, replay.start, replay.stop)
        return times, np.interp(times, drive.time, drive.values, left=0.0, right=0.0)

    def _open(self) -> Session:
        names = [reading.variable for reading in self.readings] or ["displacement"]
        if self.execution == "coupled" and self.scene.exciter is not None:
            raise UsageError(
                f"{self.scene.source}: exciter: expected a fused replay beside it, got a coupled one. Leave it fused."
            )
        if self.execution == "coupled" and isinstance(self.scene.body, StructureBody):
            raise UsageError(
                f"{self.scene.source}: expected a fused replay of several bodies or given modes, got a coupled one. "
                "Leave it fused."
            )
        if self.execution != "coupled" or self.drive is None:
            return Session(self.scene, names, execution=self.execution)
        self._folder = ScratchFolder("replay")
        others, connections = self._component(Path(self._folder.name, "replay.fmu"))
        return Session(self.scene, names, execution="coupled", others=others, connections=connections)

    def _component(self, path: Path) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
        """Write the Replay FMU of the drive, on the simulation's own clock."""
        assert self.drive is not None
        assert self._values is not None
        kind = str(self.replay.drive)
        unit = "m/s2" if kind == "base_acceleration" else "N"
        build_replay({DRIVE: ReplaySignal(self.time - self.time[0], self._values, unit)}, path)
        joined = [
            ConnectionSpec((REPLAY, DRIVE), ("body", kind)),
            ConnectionSpec((REPLAY, f"{DRIVE}_rate"), ("body", f"{kind}_rate")),
        ]
        return [ComponentSpec(REPLAY, path, {})], joined

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each component's FMU."""
        return self._session.hashes

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the recording and on the drive."""
        return (*self.recording.remarks_counted, *(self.drive.remarks if self.drive is not None else ()))

    @cached_property
    def drive_noise(self) -> Floats | None:
        """Noise of the drive before its event, in its SI unit; None if it never rests or a component plays it."""
        if self.replay.drive is None or self._folder is not None:
            return None
        return quiet_noise(self.recording.channel(self.replay.channel))

    def simulate(
        self, values: Mapping[str, float] | None = None, noise: np.random.Generator | None = None
    ) -> Motion:
        """Simulate the replay with other values of some keys of the scene.

        Parameters
        ----------
        values : mapping of str to float, optional
        noise : Generator, optional
            Draws noise as before the event, which is added to the drive.

        Raises
        ------
        ComponentError
            The body refuses its parameters, or fails.
        """
        scene = self.scene.at(values) if values else self.scene
        session = self._session
        session.begin(values)
        try:
            rows = self._follow(session, scene, noise)
        except (ImpactLimitReached, DeadlineReached) as ended:
            limit = "impact_limit" if isinstance(ended, ImpactLimitReached) else "deadline"
            raise ComponentError(
                f"{scene.source}: execution.{limit}: reached after {session.time:.6g} s of the replay. "
                "Raise it, or look for a body that rattles on its stop.",
                instance="body",
                time=session.time,
            ) from None
        impacts, sticks = session.impacts().copy(), session.sticks().copy()
        impacts[:, 0] += self.time[0]
        sticks[:, :2] += self.time[0]
        readings = tuple(reading.of(rows[:, column], scene) for column, reading in enumerate(self.readings))
        return Motion(self.time, readings, impacts, sticks, session.warnings)

    def _follow(self, session: Session, scene: Scene, noise: np.random.Generator | None) -> Floats:
        relative = self.time - self.time[0]
        if self._folder is not None or self._values is None:
            return session.follow(relative)  # a Replay component drives the body, or there is no drive
        values, drive = self._values, self.drive
        if noise is not None and drive is not None and self.drive_noise is not None:
            drawn = drawn_noise(self.drive_noise, len(drive.time), noise)
            values = values + np.interp(self.time, drive.time, drawn, left=0.0, right=0.0)
        if scene.exciter is not None:
            values = scene.exciter.gain * values + scene.exciter.offset
        return session.follow(relative, self.replay.drive, values)

    def final_state(self) -> tuple[float, float, Floats | None]:
        """Return displacement (m), velocity (m/s) and, for chains and beams, the whole state at the end."""
        return *self._session.observed(), self._session.whole_state()

    def close(self) -> None:
        """Free the components."""
        self._session.close()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def replay_table(scene: Scene) -> Replay:
    """Return the `[replay]` table of a scene; SceneError without one."""
    if scene.replay is None:
        raise SceneError(
            [f"{scene.source}: replay: expected a [replay] table, got none. Add drive, from and compare."]
        )
    return scene.replay


def is_linear(scene: Scene) -> bool:
    """Whether multiples of a motion are motions too: no stops, and no parameter that depends on amplitude."""
    model = type(scene.body)
    following = [key for key in numeric_keys(model) if rule_of(field_of(model, key)).effect == AMPLITUDE]
    return not scene.stops and not any(np.any(getattr(scene.body, key)) for key in following)


def recording_of(scene: Scene, number: int) -> Path:
    """Return the file of a recording (1-based) of a scene; paths are relative to the scene's folder."""
    names = replay_table(scene).recordings
    if not names:
        raise UsageError(
            f"{scene.source}: replay.recordings: expected a recording, got none. "
            "Name it in the scene or on the command line."
        )
    return Path(scene.source).parent / names[number - 1]


@contextmanager
def opened_replays(scene: Scene, paths: Sequence[Path], execution: str = "auto") -> Iterator[list[Replayer]]:
    """Open a replay of a scene for each recording, and close all at the end."""
    replayers: list[Replayer] = []
    try:
        for path in paths:
            replayers.append(opened_replay(scene, path, execution))
        yield replayers
    finally:
        for replayer in replayers:
            replayer.close()


def opened_replay(scene: Scene, path: Path, execution: str) -> Replayer:
    """Open a replay of a scene for a recording; its error messages begin with the name of the file."""
    try:
        return Replayer(scene, open_signals(path), execution=execution)
    except DatasetError as problem:
        if str(problem).startswith(str(path)):
            raise
        raise problem.named(path) from problem


def _cut(times: Floats, start: float | None, stop: float | None) -> Floats:
    first = -np.inf if start is None else start
    last = np.inf if stop is None else stop
    chosen: Floats = times[(times >= first) & (times <= last)]
    if len(chosen) < 2:
        raise DatasetError(
            f"replay.start, replay.stop: expected a span with at least two samples, got {first:g} to {last:g} s. "
            f"The recording lasts from {times[0]:g} to {times[-1]:g} s."
        )
    return chosen


def _reading(compared: Compared, scene: Scene, recording: Recording) -> ChannelReading:
    variable, is_sensor = plain_variable(compared.simulated)
    channel = recording.channel(compared.measured)
    measured = measured_unit(channel.unit)
    stored = file_name_of(variable)
    rule = sample_rule(stored)
    motion = variable.partition("[")[0]  # of an observed point, whose name follows
    simulated = rule.unit if rule is not None else known_unit(stored) or known_unit(motion)
    if scene.units == "nondimensional" or measured.si == simulated:
        return ChannelReading(compared, variable, channel, is_sensor, same_kind=True)
    if not is_sensor:
        raise DatasetError(
            f"{channel.name}: expected a channel in {simulated} to compare with {compared.simulated}, "
            f"got {channel.unit}. Give [sensor] a gain and compare sensor.{variable}."
        )
    return ChannelReading(compared, variable, channel, is_sensor, same_kind=False)
