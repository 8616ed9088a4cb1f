"""A scene on its way to being valid: what the rules between its tables look at."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vibroimpact.orchestrator.scene.keys import number_of, parse_key
from vibroimpact.orchestrator.scene.models import Body, Forcing, Record, SceneHeader, Sensor, Stop
from vibroimpact.orchestrator.scene.replay_models import Replay
from vibroimpact.orchestrator.scene.sweep import SweepAxis

FREQUENCY_KEYS = frozenset({"angular_frequency", "frequency"})


@dataclass(frozen=True, slots=True)
class Draft:
    """A scene on its way: the document, and those of its tables that are valid by themselves (else None)."""

    document: Mapping[str, Any]
    header: SceneHeader | None
    body: Body | None
    forcing: Forcing | None
    stops: tuple[Stop | None, ...]
    record: Record | None
    axes: tuple[SweepAxis, ...]
    sensor: Sensor | None = None
    replay: Replay | None = None

    def written(self, table: str) -> Mapping[str, Any]:
        """Return a table as written, or an empty one."""
        raw = self.document.get(table)
        return raw if isinstance(raw, dict) else {}

    def worst(self, *tables: str) -> str:
        """Return a note for a number that may be the worst of a sweep over keys of these tables."""
        swept = any(axis.key.startswith(tables) for axis in self.axes)
        return " (the worst of the swept values)" if swept else ""

    def span(self, text: str) -> tuple[float, float] | None:
        """Return the lowest and highest value of a key over all points; None where its table is not valid."""
        for axis in self.axes:
            if axis.key == text:
                return min(axis.values), max(axis.values)
        key = parse_key(text)
        assert key is not None
        owner = self.stops[key.place] if key.place is not None else getattr(self, key.table)
        number = number_of(owner, key)
        return None if number is None else (number, number)

    def angular_frequency_span(self) -> tuple[float, float] | None:
        """Return the lowest and highest angular frequency: 0 unforced, None where it is not valid."""
        if "forcing" not in self.document:
            return 0.0, 0.0
        if self.forcing is None or not FREQUENCY_KEYS & self.written("forcing").keys():
            return None
        if self.forcing.frequency is None:
            return self.span("forcing.angular_frequency")
        span = self.span("forcing.frequency")
        return span and (2.0 * math.pi * span[0], 2.0 * math.pi * span[1])
