"""Impacts of the contacts of components: rows in the columns of `analysis.dataset.IMPACT_COLUMNS`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import IMPACT_COLUMNS


class Impact(NamedTuple):
    """One impact: its start (s), its order among all, and its known quantities (see `RunRecord.impacts`)."""

    time: float
    order: int
    closing: float
    impulse: float = math.nan
    restitution: float = math.nan
    duration: float = math.nan
    force: float = math.nan

    def row(self, number: int) -> tuple[float, ...]:
        """Return its row for the contact of this number; a scene of components has no phase."""
        known = self.restitution, self.duration, self.force
        return self.time, math.nan, self.closing, self.impulse, float(number), *known


class ContactImpacts:
    """The impacts of one contact in a run.

    A yielding contact is one impact, from its touch-down to the end of the step in which its bodies part. Its impulse
    is exact. Its largest force is the largest of its steps, which are short.
    """

    #: Numbers the impacts of all contacts; the number orders impacts of equal times.
    _orders: Iterator[int] = itertools.count()

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start a new recording: earlier impacts, also an open contact, do not belong to it."""
        self._ended: list[Impact] = []
        self._open: Impact | None = None
        self._impulse = self._largest = 0.0

    def strike(self, time: float, closing: float, impulse: float, restitution: float) -> None:
        """Note a rigid impact at `time`, s: closing speed (m/s), impulse (N s), coefficient of restitution."""
        self._ended.append(Impact(time, next(self._orders), closing, impulse, restitution, 0.0))

    def touch(self, time: float, closing: float) -> None:
        """Note the touch-down of bodies that yield: its time (s) and closing speed (m/s)."""
        self._open = Impact(time, next(self._orders), max(closing, 0.0))
        self._impulse = self._largest = 0.0

    def press(self, impulse: float, force: float) -> None:
        """Note a step in contact: its impulse (N s) and its force (N)."""
        self._impulse += impulse
        self._largest = max(self._largest, force)

    def part(self, time: float, opening: float) -> None:
        """Note the time (s) and the speed (m/s) at which the bodies part."""
        contact, self._open = self._open, None
        if contact is not None:
            restitution = max(opening, 0.0) / contact.closing if contact.closing > 0.0 else math.nan
            known = self._impulse, restitution, time - contact.time, self._largest
            self._ended.append(Impact(*contact[:3], *known))

    @property
    def all(self) -> list[Impact]:
        """All impacts of the run; an impact that has not ended has neither impulse nor duration."""
        return self._ended + ([self._open] if self._open is not None else [])


def impact_rows(contacts: Iterable[ContactImpacts]) -> NDArray[np.float64]:
    """Return the impacts of contacts, numbered from 1, in the order in which they began."""
    numbered = (
        (impact, number) for number, contact in enumerate(contacts, start=1) for impact in contact.all
    )
    rows = [impact.row(number) for impact, number in sorted(numbered)]
    return np.array(rows, dtype=np.float64).reshape(-1, len(IMPACT_COLUMNS))
