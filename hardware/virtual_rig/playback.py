"""A recording as the plant of a virtual rig: its channels are played back on the inputs."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.recording import Channel, Recording, open_signals
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.virtual_rig.plant import TICK, Floats, Ticks
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.hardware.virtual_rig.wiring import Wire
from vibroimpact.orchestrator.scene.problems import nearest

_GAP = 1.5
"""Minimum distance of two samples that counts as a gap, intervals of an even axis."""


class Track:
    """A channel of a recording as a function of time: linear between samples, held over gaps and at the ends.

    Playback begins at the channel's time `begin`, s; the factor is V for a unit of the channel, or 1.

    >>> from vibroimpact.analysis.recording import TimeAxis
    >>> axis = TimeAxis(np.array([0.0, 1.0, 2.0, 5.0]), 1.0)
    >>> flags = np.zeros(4, dtype=np.uint8)
    >>> track = Track(Channel("a", np.array([0.0, 2.0, 4.0, 9.0]), "V", axis, flags), 0.0, 1.0)
    >>> track.at(np.array([0.25, 1.5, 4.0, 6.0])).tolist()
    [0.5, 3.0, 4.0, 9.0]
    """

    def __init__(self, channel: Channel, begin: float, factor: float) -> None:
        there = np.flatnonzero(np.isfinite(channel.values))
        self._times = channel.time[there] - begin
        self._values = factor * channel.values[there]
        steps, interval = np.diff(self._times), channel.axis.interval
        gap = np.diff(there) > 1
        if interval is not None:
            gap |= steps > _GAP * interval
        rises = np.diff(self._values) / steps
        self._slopes = np.append(np.where(gap, 0.0, rises), 0.0)

    @property
    def empty(self) -> bool:
        """Whether it has no sample that is a number."""
        return not len(self._times)

    def at(self, times: Floats) -> Floats:
        """Return its values at times of the playback (s)."""
        place = np.clip(np.searchsorted(self._times, times, side="right") - 1, 0, len(self._times) - 1)
        found: Floats = self._values[place] + self._slopes[place] * np.maximum(
            times - self._times[place], 0.0
        )
        return found


class Playback:
    """A recording on the inputs of a device; it begins at the first edge of each input task, and holds its end.

    The time reached is `now`, in ticks. A file that is no recording raises DatasetError. An input wired to a missing
    channel, or to one whose unit needs an amplification, raises UsageError.
    """

    def __init__(self, settings: RigSettings) -> None:
        assert settings.rig.recording is not None
        path = settings.beside(settings.rig.recording)
        recording = open_signals(path, settings.rig.run)
        starts = [float(channel.time[0]) for channel in recording.channels.values() if len(channel.time)]
        begin = min(starts, default=0.0)
        self._tracks: dict[str, Track] = {}
        for number, wire in settings.wiring.inputs.items():
            if wire.output is None:
                where = f"{settings.source}: wiring.ai{number}"
                self._tracks[wire.signal] = _track(recording, wire, begin, where, path.name)
        self.now, self._origin = 0, 0
        self.seed, self.fineness = 0, 0.0

    def restart(self, tick: int) -> None:
        """Begin the recording at a tick."""
        self._origin = tick

    def noise_of(self, signal: str) -> float:
        """Return 0: a recording contains the noise of its measurement."""
        return 0.0

    def advance(self, instants: Ticks, volts: Floats) -> dict[str, Floats]:
        """Advance to instants; return the channels there, which no voltage changes."""
        self.now = int(instants[-1])
        times: Floats = np.asarray((instants - self._origin) * TICK, dtype=np.float64)
        return {signal: track.at(times) for signal, track in self._tracks.items()}

    @property
    def state(self) -> dict[str, float]:
        """The present values of the channels."""
        now: Floats = np.asarray([(self.now - self._origin) * TICK], dtype=np.float64)
        return {signal: float(track.at(now)[0]) for signal, track in self._tracks.items()}

    def truth(self, volts: float) -> dict[str, float]:
        """Return the present values of the channels, in V or in their units."""
        return self.state

    def close(self) -> None:
        """Do nothing: no file stays open."""


def _track(recording: Recording, wire: Wire, begin: float, where: str, file: str) -> Track:
    channel = recording.channels.get(wire.signal)
    if channel is None:
        hint = nearest(wire.signal, recording.channels)
        raise UsageError(f"{where}: expected a channel of {file}, got {wire.signal[:60]!r}. {hint}".rstrip())
    unit = measured_unit(channel.unit)
    if unit.si != "V" and wire.amplification is None:
        label = unit_label(unit.cf)
        raise UsageError(
            f"{where}: expected an amplification, V per {label}, got none. "
            f'Write {{ signal = "{channel.name}", amplification = 1.0 }}.'
        )
    track = Track(channel, begin, unit.factor if unit.si == "V" else 1.0)
    if track.empty:
        raise UsageError(f"{where}: expected a channel with samples, got {channel.name} without any.")
    return track
