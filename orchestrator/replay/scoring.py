"""The score of a replay: simulated against measured signals, for each compared pair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from vibroimpact.analysis.recording.channels import Floats
from vibroimpact.analysis.replay.comparison import Comparison, compare, naive_variance
from vibroimpact.analysis.replay.event import find_event
from vibroimpact.analysis.replay.held import Held
from vibroimpact.fmus.errors import EstimationError
from vibroimpact.orchestrator.replay.drive import quiet_level
from vibroimpact.orchestrator.replay.replayer import ChannelReading, Motion, Replayer

#: Longest lag tried between channels of separate triggers, as a share of the shorter record.
MOST_LAG_SHARE = 0.5
#: Energy of a record's motion relative to the largest record's, below which there is no score: its drive did not act.
LEAST_MOTION = 1e-4


def compare_motion(replayer: Replayer, motion: Motion) -> list[Comparison]:
    """Compare the simulated motion with every channel that the scene names.

    Raises
    ------
    EstimationError
        A channel has too few good samples, or was not simulated.
    """
    try:
        return [
            _compared(replayer, reading, motion, place) for place, reading in enumerate(replayer.readings)
        ]
    except EstimationError as problem:
        raise problem.named(replayer.recording.title) from problem


def _compared(replayer: Replayer, reading: ChannelReading, motion: Motion, place: int) -> Comparison:
    replay = replayer.replay
    channel = reading.channel
    if replayer.drive is None:
        channel = channel.between(float(replayer.time[0]), float(replayer.time[-1]))
    lag, polarity = _clock(replayer, reading)
    trains = replayer.recording.events
    impacts = trains["impacts"].times if "impacts" in trains else None
    return compare(
        motion.time,
        motion.readings[place],
        channel,
        most_lag=_most_lag(replayer, reading),
        lag=lag,
        polarity=polarity,
        event_window=None if replay.event_window is None else (0.0, replay.event_window),
        offset=_offset(replayer, reading),
        windows=list(replay.windows),
        peak_window=replay.peaks,
        measured_events=impacts,
        # without measured instants every simulated impact would count as surplus
        simulated_events=None if impacts is None else motion.impacts[:, 0],
        simulated_name=reading.compared.simulated,
    )


def _clock(
    replayer: Replayer, reading: ChannelReading
) -> tuple[Literal["auto"] | float, Literal["auto"] | int]:
    """Return lag and polarity: as in the scene, zero lag on one clock, else to be found."""
    replay = replayer.replay
    if is_on_the_clock(replayer, reading):
        return replay.lag or 0.0, replay.polarity or 1
    return ("auto" if replay.lag is None else replay.lag), (
        "auto" if replay.polarity is None else replay.polarity
    )


def is_on_the_clock(replayer: Replayer, reading: ChannelReading) -> bool:
    """Whether a channel was recorded on the clock of the simulation: one axis, one trigger."""
    if replayer.drive is None:
        return True
    driven = replayer.recording.channel(replayer.replay.channel).axis
    axis = reading.channel.axis
    return axis is driven or (axis.trigger != "" and axis.trigger == driven.trigger)


def _most_lag(replayer: Replayer, reading: ChannelReading) -> float:
    given = replayer.replay.most_lag
    if replayer.drive is None:
        return given or 0.0
    driven, measured = (_span(times) for times in (replayer.drive.time, reading.channel.time))
    if given is None:
        return MOST_LAG_SHARE * min(driven[1] - driven[0], measured[1] - measured[0])
    # beyond this the records do not overlap
    return min(given, max(abs(driven[1] - measured[0]), abs(measured[1] - driven[0])))


def _span(times: Floats) -> tuple[float, float]:
    return float(times[0]), float(times[-1])


def _offset(replayer: Replayer, reading: ChannelReading) -> Literal["before", "none"] | float:
    """Return the offset to remove from a channel: the simulated one of a sensor, or the rest level.

    A sensor offset in the scene is simulated, so none is removed; a simulated channel has none. The rest level is the
    mean before the event. If the record does not begin quietly, an acceleration has the level of its quietest part, as
    its long-run mean is zero. A displacement may have a mean.
    """
    sensor = replayer.scene.sensor
    simulated = sensor is not None and reading.is_sensor and "offset" in sensor.model_fields_set
    channel = reading.channel
    if simulated or replayer.drive is None or channel.attrs.get("role") == "simulated":
        return "none"
    if find_event(channel).quiet is not None or reading.variable != "acceleration":
        return "before"
    return quiet_level(channel.si()[channel.good])


def score_without_dynamics(replayer: Replayer, reading: ChannelReading, comparison: Comparison) -> float:
    """Return the score, percent, of the best prediction without dynamics: no motion, or the motion of the base.

    The prediction is the drive times its best gain, on the same clock and the same samples.
    """
    drive = replayer.drive
    if drive is None or replayer.replay.drive != "base_acceleration" or reading.variable != "acceleration":
        return 0.0
    most_lag, lag = _most_lag(replayer, reading), _clock(replayer, reading)[0]
    return naive_variance(drive.time, drive.values, comparison.measured, most_lag=most_lag, lag=lag)


@dataclass(frozen=True, slots=True)
class Scores:
    """Scores of recordings, percent, by the name of their file.

    Attributes
    ----------
    fitted, others : mapping of str to float
        Variance accounted for, of fitted recordings and of the others; NaN if the record has no motion.
    without_dynamics : mapping of str to float
        Score of the best prediction without dynamics, for all recordings.
    held : mapping of str to Held
        The span of each recording over which the replay holds.
    remarks : tuple of str
    """

    fitted: Mapping[str, float]
    others: Mapping[str, float]
    without_dynamics: Mapping[str, float]
    held: Mapping[str, Held]
    remarks: tuple[str, ...]


def scores_of(
    replayers: Sequence[Replayer], comparisons: Sequence[Sequence[Comparison]], fitted: int
) -> Scores:
    """Return the score of each channel of each recording; a recording with several channels has several rows.

    A record without motion has no score: its energy is below `LEAST_MOTION` of the largest of the same channel.

    Parameters
    ----------
    replayers, comparisons : sequences, one for each recording
    fitted : int
        Number of fitted recordings, which come first.
    """
    motions = [[_motion(comparison) for comparison in compared] for compared in comparisons]
    own: dict[str, float] = {}
    others: dict[str, float] = {}
    naive: dict[str, float] = {}
    held: dict[str, Held] = {}
    remarks: list[str] = []
    for number, (replayer, compared) in enumerate(zip(replayers, comparisons, strict=True)):
        for place, (reading, comparison) in enumerate(zip(replayer.readings, compared, strict=True)):
            name = Path(replayer.recording.title).name
            name = name if len(compared) == 1 else f"{name}: {reading.channel.name}"
            name = name if name not in naive else f"{name} ({number + 1})"
            share = motions[number][place] / max(max(rows[place] for rows in motions), 1e-300)
            moved = share > LEAST_MOTION
            if not moved:
                remarks.append(
                    f"{name}: its motion has {share:.1e} of the energy of the other's: there is nothing to be scored"
                )
            (own if number < fitted else others)[name] = comparison.variance if moved else float("nan")
            held[name] = comparison.held
            naive[name] = score_without_dynamics(replayer, reading, comparison)
    return Scores(own, others, naive, held, tuple(remarks))


def _motion(comparison: Comparison) -> float:
    return float(np.var(comparison.values[comparison.scored]))
