"""When the recording of a point begins and ends, and what a run says that did not come to a plain end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import Record

TWO_PI = 2.0 * math.pi
Numbers = TypeVar("Numbers", float, NDArray[np.float64])


def recorded_window(scene: Scene, parameters: Mapping[str, float]) -> tuple[float, float]:
    """Return start and end of the recording, s; those of a forced scene are at forcing phase 0.

    Parameters
    ----------
    scene : Scene
        Of the short form.
    parameters : mapping of str to float
        Of its body, as `float_parameters` gives them.
    """
    if scene.period is None:
        record = scene.record
        return record.transient_time, record.transient_time + record.recorded_time
    phase, angular_frequency = parameters["forcing.phase"], parameters["forcing.angular_frequency"]
    return forced_window(scene.record, phase, angular_frequency)


def forced_window(record: Record, phase: Numbers, angular_frequency: Numbers) -> tuple[Numbers, Numbers]:
    """Return start and end of the recording of a forced scene, s; of one point, or of many as arrays.

    The phase is that of the force at time 0, rad; its angular frequency is in rad/s.
    """
    period, lead = TWO_PI / angular_frequency, phase % TWO_PI
    lag = lead / angular_frequency
    first = record.transient_periods + (lead > 0.0)
    return first * period - lag, (first + record.recorded_periods) * period - lag


def limit_message(limit: int, time: float) -> str:
    """Return what a run that came to its impact limit says, `time` s after its start."""
    return f"impact_limit: {limit} impacts, touch-downs and rests at time {time:.17g}"


def late_message(deadline: float | None, time: float) -> str:
    """Return what a run that took longer than its deadline says, `time` s after its start."""
    return f"deadline: {deadline} s passed at time {time:.17g}"


def no_load_message(contact: int) -> str:
    """Return what a run says that ends at rest on a stop (from 1) on which nothing presses the body."""
    return f"rests on stop[{contact}] without load"
