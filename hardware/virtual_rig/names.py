"""Names of channels and terminals, as NI-DAQmx reads them."""

from __future__ import annotations

import re

from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.refusal import Refusal

MOST_NAMES = 1000
"""Maximum channels of one list."""
PFI_LINES = 16

_RANGE = re.compile(r"(?P<stem>.*?)(?P<first>\d{1,6}):(?:(?P<again>.*\D)?(?P<last>\d{1,6}))", re.S)


def expanded(text: str) -> list[str]:
    """Return the names in a list such as `tip, Dev1/ai2:4`; raise Refusal for no list, or above `MOST_NAMES` names.

    >>> expanded("tip, Dev1/ai2:4")
    ['tip', 'Dev1/ai2', 'Dev1/ai3', 'Dev1/ai4']
    """
    names: list[str] = []
    for part in (each.strip() for each in text.split(",")):
        if ":" in part:
            names += _of_range(part)
        elif part:
            names.append(part)
        if len(names) > MOST_NAMES:
            raise Refusal(DAQmxErrors.RANGE_SYNTAX_NUMBER_TOO_BIG, f"more than {MOST_NAMES} names")
    return names


def _of_range(part: str) -> list[str]:
    found = _RANGE.fullmatch(part)
    if found is None or (found["again"] or found["stem"]).lower() != found["stem"].lower():
        raise Refusal(DAQmxErrors.INVALID_RANGE_OF_OBJECTS_SYNTAX_IN_STRING, repr(part[:60]))
    first, last = int(found["first"]), int(found["last"])
    if abs(last - first) >= MOST_NAMES:
        raise Refusal(DAQmxErrors.RANGE_SYNTAX_NUMBER_TOO_BIG, f"more than {MOST_NAMES} names")
    step = 1 if last >= first else -1
    return [f"{found['stem']}{number}" for number in range(first, last + step, step)]


def given_names(text: str, count: int) -> list[str]:
    """Return the names that a program gives to channels; a single name is numbered for several channels.

    >>> given_names("tip", 3)
    ['tip0', 'tip1', 'tip2']
    """
    names = expanded(text)
    if len(names) == 1 and count > 1:
        return [f"{names[0]}{number}" for number in range(count)]
    if len(names) != count:
        raise Refusal(DAQmxErrors.INVALID_CHAN_NAME, f"{len(names)} names for {count} channels")
    return names


def terminal(device: str, text: str) -> str:
    """Return the full name of a terminal; empty for the task's own clock.

    >>> terminal("Dev1", "PFI0")
    '/Dev1/PFI0'
    """
    name = text.strip().strip("/")
    if name.lower() in ("", "onboardclock"):
        return ""
    return f"/{name}" if name.lower().startswith(f"{device}/".lower()) else f"/{device}/{name}"


def is_signal(device: str, name: str, *signals: str) -> bool:
    """Return whether a terminal is one of the given signals of the device, such as `ao/SampleClock`."""
    return name.lower() in {f"/{device}/{signal}".lower() for signal in signals}


def is_terminal(device: str, name: str, *signals: str) -> bool:
    """Return whether a terminal is one of the given signals, or a PFI line of the device."""
    return is_signal(device, name, *signals, *(f"PFI{number}" for number in range(PFI_LINES)))
