"""The start and the end of a point's recording, and the messages of runs with a special end."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import Record

TWO_PI = 2.0 * math.pi
_CONTACT = re.compile(r"\bcontact\[([0-9]+)\](\.position)?")
"""A contact in messages of an FMU, which counts stops and contacts together, maybe with its position."""
Numbers = TypeVar("Numbers", float, NDArray[np.float64])


def recorded_window(scene: Scene, parameters: Mapping[str, float]) -> tuple[float, float]:
    """Return start and end of the recording, s; in a forced scene both are at forcing phase 0.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    parameters : mapping of str to float
        Parameters of its body, from `float_parameters`.
    """
    if scene.period is None:
        record = scene.record
        return record.transient_time, record.transient_time + record.recorded_time
    phase, angular_frequency = parameters["forcing.phase"], parameters["forcing.angular_frequency"]
    return forced_window(scene.record, phase, angular_frequency)


def forced_window(record: Record, phase: Numbers, angular_frequency: Numbers) -> tuple[Numbers, Numbers]:
    """Return start and end of the recording of a forced scene, s, for one point, or for many as arrays.

    `phase` is the phase of the force at time 0, rad; its angular frequency is in rad/s.
    """
    period, lead = TWO_PI / angular_frequency, phase % TWO_PI
    lag = lead / angular_frequency
    first = record.transient_periods + (lead > 0.0)
    return first * period - lag, (first + record.recorded_periods) * period - lag


def limit_message(limit: int, time: float) -> str:
    """Return the message of a run that reached its impact limit, `time` s after its start."""
    return f"impact_limit: {limit} impacts, touch-downs and rests at time {time:.17g}"


def late_message(deadline: float | None, time: float) -> str:
    """Return the message of a run that took longer than its deadline, `time` s after its start."""
    return f"deadline: {deadline} s passed at time {time:.17g}"


def no_load_message(stop: str) -> str:
    """Return the message of a run that ends at rest on a stop, given by its key, without a load on the stop."""
    return f"rests on {stop} without load"


def in_keys_of(scene: Scene, text: str) -> str:
    """Return a message of the body's FMU with the keys of the scene in place of the numbers of contacts.

    Examples
    --------
    >>> tables = {"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0}}
    >>> scene = Scene.from_dict(tables | {"stop": [{"position": 1.0, "restitution": 1.0}]})
    >>> in_keys_of(scene, "contact[1].position: expected a finite number, got nan")
    'stop[1].position: expected a finite number, got nan'
    """

    def key(match: re.Match[str]) -> str:
        place, variable = int(match[1]) - 1, match[2] or ""
        if not 0 <= place < len(keys):
            return match[0]
        return keys[place] + (".clearance" if variable and keys[place].startswith("contact") else variable)

    keys = scene.stop_keys
    return _CONTACT.sub(key, text)


def error_in_keys_of(scene: Scene, error: ComponentError) -> ComponentError:
    """Return an error of the body's FMU with the keys of the scene in its message."""
    said = in_keys_of(scene, error.message)
    return type(error)(said, instance=error.instance, function=error.function, time=error.time, log=error.log)
