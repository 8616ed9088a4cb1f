"""Names and units in the headings of columns."""

from __future__ import annotations

import re

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError

_WITH_UNIT = re.compile(r"(?P<name>[^\[\](){}<>]*?)\s*[\[({<]\s*(?P<unit>[^\[\](){}<>]*?)\s*[\])}>]\s*")
_AFTER_SLASH = re.compile(r"(?P<name>[^/]*[^/\s])\s+/\s+(?P<unit>\S.*)")
_TIME_NAMES = frozenset(
    {"t", "time", "times", "zeit", "temps", "tempo", "tiempo", "x_value", "seconds", "sec"}
    | {"secs", "timestamp", "timestamps", "elapsed", "elapsed_time", "time_s", "time_sec", "t_s"}
    | {"time_axis", "timevector", "time_vector", "tid", "cas"}
)

LONGEST_LABEL = 120
"""Characters of a heading that are read: it is a name and a unit, and goes into names and messages."""


def split_label(text: str) -> tuple[str, str]:
    """Return name and unit of a heading.

    >>> split_label("acceleration (m/s^2)"), split_label("force / N"), split_label("board")
    (('acceleration', 'm/s^2'), ('force', 'N'), ('board', ''))
    """
    label = " ".join(text.strip().strip('"')[:LONGEST_LABEL].split())
    for pattern in (_WITH_UNIT, _AFTER_SLASH):
        match = pattern.fullmatch(label)
        if match is not None:
            return match["name"].strip(), match["unit"].strip()
    return label, ""


def is_time_name(label: str) -> bool:
    """Whether a heading means time.

    >>> is_time_name("Time"), is_time_name("t"), is_time_name("X_Value"), is_time_name("timer")
    (True, True, True, False)
    """
    return re.sub(r"[\s-]+", "_", label.strip().lower()) in _TIME_NAMES


def is_known_unit(label: str) -> bool:
    """Whether a unit label means anything."""
    try:
        measured_unit(label)
    except DatasetError:
        return False
    return True


def seconds_in(unit: str) -> float | None:
    """Return how many seconds a unit of time has; None where it is no unit of time.

    >>> seconds_in("ms"), seconds_in("m")
    (0.001, None)
    """
    if not unit or not is_known_unit(unit):
        return None
    meant = measured_unit(unit)
    return meant.factor if meant.si == "s" else None
