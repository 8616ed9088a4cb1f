"""Names and units in the headings of columns."""

from __future__ import annotations

import re

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError

_WITH_UNIT = re.compile(r"(?P<name>[^\[\](){}<>]*?)\s*[\[({<]\s*(?P<unit>[^\[\](){}<>]*?)\s*[\])}>]\s*")
_AFTER_SLASH = re.compile(r"(?P<name>[^/]*[^/\s])\s+/\s+(?P<unit>\S.*)")
_AFTER_IN = re.compile(r"(?P<name>\S.*\S|\S)\s+in\s+(?P<unit>\S{1,20})")
_NO_UNITS_IN_WORDS = frozenset({"C", "F", "K", "total", "1", "-"})
"""Words after `in` that rather mean degrees, or nothing, than their unit."""
_TIME_NAMES = frozenset(
    {"t", "time", "times", "zeit", "temps", "tempo", "tiempo", "x_value", "seconds", "sec"}
    | {"secs", "timestamp", "timestamps", "elapsed", "elapsed_time", "time_s", "time_sec", "t_s"}
    | {"time_axis", "timevector", "time_vector", "tid", "cas"}
)

_SMALLEST, _LARGEST, _LONGEST_TIME = 1e-15, 1e12, 86_400.0
"""Range of plausible units in SI; for a unit of time, at most a day."""
_GRAVITY = 9.80665
_LENGTH, _SPEED, _ACCELERATION, _FORCE = "m", "m s-1", "m s-2", "N"
_WORDS = {
    word: units
    for words, units in (
        (("accel", "acc(?![a-z])", "beschleun"), frozenset({_ACCELERATION, "rad s-2"})),
        (("veloc", "geschw", "vitesse"), frozenset({_SPEED, "rad s-1"})),
        (("displac", "deflection", "auslenk"), frozenset({_LENGTH, "rad"})),
        (("force(?![a-z])", "kraft"), frozenset({_FORCE, "kg"})),
    )
    for word in words
}
"""Words in headings, with the units that they allow besides electrical ones and pure numbers."""
_MECHANICAL = frozenset(
    {
        _LENGTH,
        _SPEED,
        _ACCELERATION,
        _FORCE,
        "rad",
        "rad s-1",
        "rad s-2",
        "kg",
        "s",
        "Pa",
        "N m",
        "J",
        "W",
        "Hz",
    }
)

_PARTS_OF_SECONDS = {
    **dict.fromkeys(("millis", "millisecond", "milliseconds", "millisekunden", "msec", "msecs"), "ms"),
    **dict.fromkeys(("micros", "microsecond", "microseconds", "mikrosekunden", "usec", "usecs"), "us"),
}
"""Headings of instants that are themselves a unit."""
_TIME_WITH_UNIT = re.compile(r"(?P<name>[a-z_]{1,20})_(?P<unit>ms|msec|millis|us|usec|micros|ns|s|sec)")

_TIME_UNITS = frozenset({"s", "ms", "us", "µs", "μs", "ns"})

LONGEST_LABEL = 120
"""Most characters of a heading that are read: it is a name and a unit, and goes into names and messages."""


def split_label(text: str) -> tuple[str, str]:
    """Return name and unit of a heading.

    >>> split_label("acceleration (m/s^2)"), split_label("force / N"), split_label("board")
    (('acceleration', 'm/s^2'), ('force', 'N'), ('board', ''))
    >>> split_label("Zeit in ms"), split_label("built in 2019")
    (('Zeit', 'ms'), ('built in 2019', ''))
    """
    label = " ".join(text.strip().strip('"')[:LONGEST_LABEL].split())
    for pattern in (_WITH_UNIT, _AFTER_SLASH):
        match = pattern.fullmatch(label)
        if match is not None:
            return match["name"].strip(), match["unit"].strip()
    match = _AFTER_IN.fullmatch(label)
    if match is None or match["unit"] in _NO_UNITS_IN_WORDS or match["unit"].isdigit():
        return label, ""
    return (match["name"], match["unit"]) if is_known_unit(match["unit"]) else (label, "")


def is_time_unit(label: str) -> bool:
    """Whether a heading is only a unit of time, such as `ms`.

    >>> is_time_unit("ms"), is_time_unit("m")
    (True, False)
    """
    return label in _TIME_UNITS


def is_time_name(label: str) -> bool:
    """Whether a heading means time.

    >>> is_time_name("Time"), is_time_name("t"), is_time_name("X_Value"), is_time_name("timer")
    (True, True, True, False)
    """
    return re.sub(r"[\s-]+", "_", label.strip().lower()) in _TIME_NAMES


def unit_in_time_name(label: str) -> str:
    """Return the unit in a heading of instants; empty for any other heading.

    >>> unit_in_time_name("millis"), unit_in_time_name("timestamp_ms"), unit_in_time_name("force_ms")
    ('ms', 'ms', '')
    """
    text = re.sub(r"[\s-]+", "_", label.strip().lower())
    match = _TIME_WITH_UNIT.fullmatch(text)
    if match is None or match["name"] not in _TIME_NAMES:
        return _PARTS_OF_SECONDS.get(text, "")
    unit = match["unit"]
    return "s" if unit == "sec" else _PARTS_OF_SECONDS.get(unit, unit)


def is_known_unit(label: str) -> bool:
    """Whether a unit label means a plausible measured unit.

    >>> is_known_unit("mV"), is_known_unit("acc"), is_known_unit("velocity")
    (True, False, False)
    """
    try:
        meant = measured_unit(label)
    except DatasetError:
        return False
    # an atto-cubic-centimetre, and a year, are headings: acc, a
    return _SMALLEST <= meant.factor <= (_LONGEST_TIME if meant.si == "s" else _LARGEST)


def meant_unit(heading: str, unit: str) -> tuple[str, str]:
    """Return the meaning of a unit under this heading, and a remark on it.

    A unit of mass under an acceleration means thousandths of g. A unit that contradicts its heading counts as none.

    >>> meant_unit("Acceleration", "mg")[0], meant_unit("Force", "mV")[0], meant_unit("Displacement", "V s")[0]
    ('0.00980665 m s-2', 'mV', 'V s')
    >>> meant_unit("Velocity", "mm")
    ('', "the unit 'mm' is none of what the heading says: taken as a pure number")
    """
    word = next((word for word in _WORDS if re.search(rf"(?<![a-z]){word}", heading.lower())), None)
    if word is None or not unit or not is_known_unit(unit):
        return unit, ""
    meant = measured_unit(unit)
    if meant.si not in _MECHANICAL or meant.si in _WORDS[word]:
        return unit, ""
    if meant.si == "kg" and "m s-2" in _WORDS[word]:
        return (
            f"{meant.factor * 1e3 * _GRAVITY:.15g} m s-2",
            f"the unit {unit!r} is taken for a part of g, as the heading says",
        )
    return "", f"the unit {unit!r} is none of what the heading says: taken as a pure number"


def seconds_in(unit: str) -> float | None:
    """Return the seconds in a unit of time; None for any other unit.

    >>> seconds_in("ms"), seconds_in("m")
    (0.001, None)
    """
    if not unit or not is_known_unit(unit):
        return None
    meant = measured_unit(unit)
    return meant.factor if meant.si == "s" else None
