"""What a prediction without dynamics reaches: the yardstick of a replay."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay.alignment import Interpolated, align

Floats = NDArray[np.float64]


def naive_variance(
    drive_time: Floats,
    drive: Floats,
    measured: Channel,
    *,
    most_lag: float,
    lag: Literal["auto"] | float = "auto",
    event_window: tuple[float, float] | None = None,
) -> float:
    """Return the variance that the drive itself accounts for, with the gain and offset that suit it best, percent.

    A body that follows its base rigidly would reach 100. No response at all scores 0, and so this is never less.
    Lag and polarity are found as for a replay; gain and offset are the best of the whole record, an advantage that
    a replay does not have.

    Parameters
    ----------
    drive_time, drive : ndarray of float, shape (drive sample,)
        s, ascending; any unit. Before and after, the drive rests.
    measured : Channel
    most_lag, lag, event_window
        As in `align`.
    """
    found = align(drive_time, drive, measured, most_lag=most_lag, lag=lag, event_window=event_window)
    good = measured.good
    brought = Interpolated(drive_time, drive)(measured.time[good] - found.lag)
    brought = brought - np.mean(brought)
    values = measured.si()[good]
    values = values - np.mean(values)
    size = float(np.sum(brought**2) * np.sum(values**2))
    return 100.0 * float(np.sum(brought * values)) ** 2 / size if size > 0.0 else 0.0
