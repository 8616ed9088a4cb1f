"""The instant at which two bodies meet: cubics through gap and closing speed, compared with the bodies' own motion."""

from __future__ import annotations

from collections.abc import Callable

from vibroimpact.orchestrator.importer.pairs.ends import Motion, Scale
from vibroimpact.orchestrator.importer.revision import Bracket, refine
from vibroimpact.orchestrator.importer.stop_contacts.step_path import StepPath

#: Most halvings of a step in search of a contact.
MOST_HALVINGS = 40
#: Gap over the change of the gap in a step at the speeds of its ends; above it the step is not searched.
FAR = 4.0
#: Allowed error of a cubic, over its error in the middle of the step.
MARGIN = 2.0
#: Rounding of a gap, relative to the gap below which bodies touch.
ROUNDING = 0.01


class MeetingSearch:
    """The search of one step for the first instant at which two bodies meet: their gap is below `room`, m.

    `motion_at` steps the bodies to a number of seconds into the step, and returns the pair there. The scale is the
    largest displacement and speed.
    """

    def __init__(self, motion_at: Callable[[float], Motion], scale: Scale, room: float) -> None:
        self._motion_at, self._scale, self._room = motion_at, scale, room

    def level(self, start: Motion) -> float:
        """Return the gap at which bodies meet, m: 0, or a little less where they touch already and do not close."""
        return 0.0 if start.gap > self._room else min(start.gap, 0.0) - self._room

    def keeps_clear(self, first: Motion, last: Motion) -> bool:
        """Is the gap too large to be closed at such speeds, or do both bodies lie idle on each other?"""
        is_idle = max(abs(first.closing), abs(last.closing)) <= self._scale.slow
        if is_idle and max(abs(first.gap), abs(last.gap)) <= self._room:
            return True
        size = last.seconds - first.seconds
        moved = size * max(abs(first.closing), abs(last.closing)) + abs(last.gap - first.gap)
        return min(first.gap, last.gap) > FAR * moved + self._room

    def first(self, start: Motion, last: Motion, precision: float) -> float | None:
        """Return the seconds to the first meeting, to a precision (s); None where the bodies do not meet."""
        bracket = self._bracket(start, last, MOST_HALVINGS)
        if bracket is None:
            return None
        near, far = bracket
        level = self.level(near)
        return precision + refine(
            Bracket(near.seconds, near.gap - level, far.seconds),
            lambda seconds: self._motion_at(seconds).gap - level,
            precision,
        )

    def _bracket(self, first: Motion, last: Motion, halvings: int) -> tuple[Motion, Motion] | None:
        """Return the ends of a part of the step in which the bodies first meet; None if they do not meet."""
        if self.keeps_clear(first, last):
            return None
        level = self.level(first)
        path = StepPath(first.gap, -first.closing, last.gap, -last.closing, last.seconds - first.seconds)
        middle = self._motion_at(first.seconds + 0.5 * path.size)
        error = MARGIN * abs(middle.gap - path.at(0.5)[0]) + ROUNDING * self._room
        if last.gap > level:
            if path.lowest - error > level or halvings == 0:
                return None
        elif halvings == 0 or (middle.closing > 0.0 and first.closing >= 0.0 and not path.turns):
            return first, last
        if middle.gap <= level:
            return self._bracket(first, middle, halvings - 1)
        found = self._bracket(first, middle, halvings - 1)
        return self._bracket(middle, last, halvings - 1) if found is None else found
