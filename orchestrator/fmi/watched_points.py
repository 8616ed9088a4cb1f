"""Watched points of an FMU for model exchange: surfaces that a contact point may meet, and levels of variables."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.model_exchange import Exchange, ExchangeWatch, WatchedLaw

Direction = Literal["falling", "rising", "either"]
DIRECTIONS: dict[Direction, int] = {"falling": -1, "rising": 1, "either": 0}


class ContactWatch:
    """A contact point, whose steps end where it meets a surface that stands still."""

    def __init__(self, owner: WatchedPoints, place: int) -> None:
        self._owner, self._place = owner, place

    @property
    def _watch(self) -> ExchangeWatch:
        return self._owner.watches[self._place]

    def put(self, position: float, side: float) -> None:
        """Put the surface at a position, m, above the point (side 1) or below it (side -1)."""
        self._watch.factor, self._watch.offset = -side, side * position

    def press_by(self, law: WatchedLaw, force: int) -> None:
        """Let a stop that yields press the point by its law, through the force input with this value reference."""
        watch = self._watch
        watch.law, watch.force, watch.impulse = law, self._owner.force_place(force), 0.0
        watch.is_pressed = 0

    @property
    def is_pressed(self) -> bool:
        """Does the stop press the point?"""
        return bool(self._watch.is_pressed)

    @is_pressed.setter
    def is_pressed(self, value: bool) -> None:
        self._watch.is_pressed = value
        self._owner.begin_anew()

    @property
    def impulse(self) -> float:
        """Impulse of the stop so far, N s."""
        return float(self._watch.impulse)

    @property
    def largest(self) -> float:
        """Largest force of the stop in the last step, N."""
        return float(self._watch.largest)

    def arm(self, room: float) -> None:
        """Find meetings in the next step; below the distance `room`, m, the point touches the surface already."""
        if not self._watch.is_armed:
            self._owner.begin_anew()
        self._watch.is_armed, self._watch.room = 1, room

    def disarm(self) -> None:
        """Find no meetings: the point rests on the surface, or the run has no such contact."""
        self._watch.is_armed = self._watch.is_pressed = 0
        self._watch.law = WatchedLaw()


class WatchedPoints:
    """The watched points of one instance, in memory that C code reads.

    Attributes
    ----------
    watches : ctypes array of ExchangeWatch
    has_contacts : bool
        The body has a part in a contact.
    """

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self.watches = (ExchangeWatch * 0)()
        self.has_contacts = False
        self._references: list[int] = []
        self._forces: list[int] = []
        self._contacts: list[ContactWatch] = []
        self._instants = self._samples = np.zeros(0)

    def contact(self, displacement: int, velocity: int) -> ContactWatch:
        """Watch the contact point with these value references; without a surface so far."""
        place = self._add(
            ExchangeWatch(value=self._place(displacement), rate=self._place(velocity), direction=-1)
        )
        self._contacts.append(ContactWatch(self, place))
        return self._contacts[-1]

    def level(self, variable: int, direction: Direction, level: float) -> None:
        """End steps, with an event, where a variable crosses a level."""
        numbers = {"value": self._place(variable), "rate": -1, "direction": DIRECTIONS[direction]}
        self._add(ExchangeWatch(factor=1.0, offset=-level, is_armed=1, **numbers))

    def _place(self, reference: int) -> int:
        if reference not in self._references:
            self._references.append(reference)
        return self._references.index(reference)

    def force_place(self, reference: int) -> int:
        """Return the place of a force input, by its value reference."""
        if reference not in self._forces:
            self._forces.append(reference)
            self._bind()
        return self._forces.index(reference)

    def _add(self, watch: ExchangeWatch) -> int:
        self.watches = (ExchangeWatch * (len(self.watches) + 1))(*self.watches, watch)
        self._bind()
        return len(self.watches) - 1

    def begin(self) -> None:
        """Start a run: contacts have their part in it once they are armed."""
        for contact in self._contacts:
            contact.disarm()
        self._forces, self._exchange.gives_forces = [], 0
        self._bind()
        self.keep_samples(np.zeros(0))

    def begin_anew(self) -> None:
        """Let the integration begin anew: other functions have roots from now on."""
        self._exchange.begins_anew = 1

    def _bind(self) -> None:
        exchange, directions = self._exchange, [0] * int(self._exchange.indicator_count)
        for watch in self.watches:
            directions.append(watch.direction)
        references = np.array(self._references, dtype=np.uint32)
        values, roots = np.zeros(len(references)), np.zeros(len(directions) or 1, dtype=np.intc)
        numbers = np.array(directions or [0], dtype=np.intc)
        # C code holds their addresses
        forces = np.array(self._forces, dtype=np.uint32)
        given = np.zeros(len(forces))
        self._kept: list[NDArray[Any]] = [references, values, roots, numbers, forces, given]
        exchange.watches = ctypes.addressof(self.watches)
        names = ("watched", "values", "roots", "directions", "forces", "given")
        for name, array in zip(names, self._kept, strict=True):
            setattr(exchange, name, array.ctypes.data)
        exchange.watch_count, exchange.watched_count = len(self.watches), len(references)
        exchange.force_count = len(forces)

    @contextmanager
    def as_within_step(self) -> Iterator[None]:
        """Let stops that yield press inside as they did within the last step, whose end may have changed them."""
        pressed = [watch.is_pressed for watch in self.watches]
        for watch in self.watches:
            watch.is_pressed = watch.was_pressed
        try:
            yield
        finally:
            for watch, value in zip(self.watches, pressed, strict=True):
                watch.is_pressed = value

    # ---- samples ----

    def keep_samples(self, instants: NDArray[np.float64]) -> None:
        """Keep the states at these ascending instants, s, in the next steps, from the solver's own motion."""
        exchange = self._exchange
        self._instants = np.ascontiguousarray(instants)
        self._samples = np.zeros((len(instants), max(1, int(exchange.state_count))))
        exchange.instants, exchange.samples = self._instants.ctypes.data, self._samples.ctypes.data
        exchange.instant_count, exchange.sample_count = len(instants), 0

    def samples(self) -> NDArray[np.float64]:
        """Return the states that the last step has kept, shape (instants so far, states)."""
        return self._samples[: int(self._exchange.sample_count)]
