"""Scenes for tests of campaigns whose dataset is a store."""

from __future__ import annotations

from collections.abc import Sequence

BODY = """
[scene]
title = "a store"
units = "nondimensional"
[body]
mass = 0.001
stiffness = 1.0
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 3
recorded_periods = 2
[sweep]
"""


def axis(key: str, values: Sequence[float], path: str = "independent") -> str:
    """Return the line of a swept key."""
    return f'"{key}" = {{ values = {list(values)}, path = "{path}" }}'
