"""Names of channels in a recording: short, lower case, unique."""

from __future__ import annotations

from collections.abc import Collection

from vibroimpact.analysis.dataset.naming import file_name_of

_RESERVED_ENDS = ("_quality", "_event")
_LONGEST = 80


def channel_name(label: str, taken: Collection[str]) -> str:
    """Return the name of a channel in its file: from its label, and not taken yet.

    >>> channel_name("Acceleration 0", ()), channel_name("time", ()), channel_name("base", ("base",))
    ('acceleration_0', 'channel_time', 'base_2')
    >>> channel_name("3rd", ()), channel_name("", ())
    ('channel_3rd', 'channel')
    """
    name = file_name_of(label[:_LONGEST]).lower()
    if not name or not name[0].isalpha() or name.startswith("time"):
        name = f"channel_{name}".strip("_")
    if name.endswith(_RESERVED_ENDS):  # the recording's own names for flags and dimensions
        name += "_column"
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free
