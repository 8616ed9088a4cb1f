"""The score of a replay: what it simulated beside what was measured, each compared pair by itself."""

from __future__ import annotations

from typing import Literal

from vibroimpact.analysis.recording import Floats
from vibroimpact.analysis.replay.baseline import naive_variance
from vibroimpact.analysis.replay.comparison import Comparison, compare
from vibroimpact.analysis.replay.event import find_event
from vibroimpact.fmus.errors import EstimationError
from vibroimpact.orchestrator.drive_signal import quiet_level
from vibroimpact.orchestrator.replay import Motion, Reading, Replayer

#: Longest lag tried between channels of separate triggers, as a share of the shorter record.
MOST_LAG_SHARE = 0.5


def compare_motion(replayer: Replayer, motion: Motion) -> list[Comparison]:
    """Compare what was simulated with every channel that the scene names.

    Raises
    ------
    EstimationError
        A channel has too little that is good, or was not simulated.
    """
    try:
        return [
            _compared(replayer, reading, motion, place) for place, reading in enumerate(replayer.readings)
        ]
    except EstimationError as problem:
        raise EstimationError(f"{replayer.recording.title}: {problem}") from problem


def _compared(replayer: Replayer, reading: Reading, motion: Motion, place: int) -> Comparison:
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
        # without measured instants every simulated impact would count as one too many
        simulated_events=None if impacts is None else motion.impacts[:, 0],
        simulated_name=reading.compared.simulated,
    )


def _clock(replayer: Replayer, reading: Reading) -> tuple[Literal["auto"] | float, Literal["auto"] | int]:
    """Return lag and polarity: as the scene says, none on one clock, else to be found."""
    replay = replayer.replay
    if is_on_the_clock(replayer, reading):
        return replay.lag or 0.0, replay.polarity or 1
    return ("auto" if replay.lag is None else replay.lag), (
        "auto" if replay.polarity is None else replay.polarity
    )


def is_on_the_clock(replayer: Replayer, reading: Reading) -> bool:
    """Whether a channel was recorded on the clock that the simulation runs on: one axis, one trigger."""
    if replayer.drive is None:
        return True
    driven = replayer.recording.channel(replayer.replay.channel).axis
    axis = reading.channel.axis
    return axis is driven or (axis.trigger != "" and axis.trigger == driven.trigger)


def _most_lag(replayer: Replayer, reading: Reading) -> float:
    given = replayer.replay.most_lag
    if replayer.drive is None:
        return given or 0.0
    driven, measured = (_span(times) for times in (replayer.drive.time, reading.channel.time))
    if given is None:
        return MOST_LAG_SHARE * min(driven[1] - driven[0], measured[1] - measured[0])
    # beyond this the records do not overlap: nothing could be found there
    return min(given, max(abs(driven[1] - measured[0]), abs(measured[1] - driven[0])))


def _span(times: Floats) -> tuple[float, float]:
    return float(times[0]), float(times[-1])


def _offset(replayer: Replayer, reading: Reading) -> Literal["before", "none"] | float:
    """A scene that gives its sensor an offset simulates it; else the level of rest is taken off.

    That is the mean before the event or, where the record does not begin quietly, the level of an acceleration where
    it is quietest: an acceleration has no mean in the long run; a displacement may well have one. What was simulated
    has no offset.
    """
    sensor = replayer.scene.sensor
    simulated = sensor is not None and reading.is_sensor and "offset" in sensor.model_fields_set
    channel = reading.channel
    if simulated or replayer.drive is None or channel.attrs.get("role") == "simulated":
        return "none"
    if find_event(channel).quiet is not None or reading.variable != "acceleration":
        return "before"
    return quiet_level(channel.si()[channel.good])


def score_without_dynamics(replayer: Replayer, reading: Reading, comparison: Comparison) -> float:
    """Return the score, percent, of the best prediction without dynamics: nothing moves, or all as the base does.

    The drive times the gain that suits the record best, on the same clock and the same samples.
    """
    drive = replayer.drive
    if drive is None or replayer.replay.drive != "base_acceleration" or reading.variable != "acceleration":
        return 0.0
    most_lag, lag = _most_lag(replayer, reading), _clock(replayer, reading)[0]
    return naive_variance(drive.time, drive.values, comparison.measured, most_lag=most_lag, lag=lag)
