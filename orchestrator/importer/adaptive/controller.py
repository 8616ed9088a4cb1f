"""The size of communication steps from their estimated errors: a PI controller."""

from __future__ import annotations

import math

#: Part of the size that would just meet the tolerance.
SAFETY = 0.9
#: Exponents of the present and the last error, over the order of a step's error: Gustafsson's PI controller.
PRESENT, LAST = 0.7, 0.4
#: Least and largest ratio of two sizes in a row. A growth of at most 2 shows a fast motion before a step skips it.
MOST_SHRINKING, MOST_GROWTH = 0.2, 2.0
#: Least error over the tolerance that counts: a smaller last error would shorten the next step.
LEAST_ERROR = 1e-2
#: Steps after a discarded one that are no longer than its part that is made again.
WARY_STEPS = 20
#: Next size over a discarded one where the FMU names no time of the step as successful; largest part otherwise.
AFTER_DISCARD, LARGEST_PART = 0.5, 1.0 - 1e-6
#: First size after an event, over the size that errors have last chosen.
AFTER_EVENT = 0.1
#: A step this much longer than the chosen size may end at its limit, instead of a very short step before it.
STRETCH = 1.1


class StepController:
    """Chooses the sizes of steps.

    Parameters
    ----------
    order : int
        Order of the error of one step: it falls with this power of the size.

    Attributes
    ----------
    size : float
        Size of the next step, s.
    """

    def __init__(self, order: int) -> None:
        self.order = order
        self.begin(math.inf)

    def begin(self, first: float) -> None:
        """Start a run with a step of `first` s."""
        self.first = self.size = first
        self._settled = first
        self._last_error = 1.0
        self._may_grow = True
        self._ceiling, self._wary_steps = math.inf, 0

    def end_of(self, time: float, limit: float) -> float:
        """Return the end of a step from `time`, s, which is at most `limit`."""
        stretch = 1.0 if self._wary_steps else STRETCH
        return limit if limit - time <= stretch * self.size else time + self.size

    def accept(self, size: float, error: float, *, cut: bool) -> None:
        """Choose the next size after a step of `size` s with an error over the tolerance.

        A step that is `cut` says nothing against longer ones.
        """
        error = max(error, LEAST_ERROR)
        exponent = 1.0 / self.order
        ratio = SAFETY * error ** (-PRESENT * exponent) * self._last_error ** (LAST * exponent)
        most = MOST_GROWTH if self._may_grow else 1.0
        chosen = size * min(max(ratio, MOST_SHRINKING), most)
        if self._wary_steps:
            self._wary_steps -= 1
            chosen = min(chosen, self._ceiling)
        if cut and error <= 1.0:
            self.size = max(self.size, chosen)
            return
        self.size, self._last_error, self._may_grow = chosen, error, True
        if ratio < MOST_GROWTH:
            self._settled = chosen

    def reject(self, size: float, error: float) -> None:
        """Choose a shorter size after a step of `size` s with an error over the tolerance above 1."""
        ratio = SAFETY * error ** (-1.0 / self.order) if math.isfinite(error) else 0.0
        self.size = self._settled = size * max(ratio, MOST_SHRINKING)
        self._may_grow = False

    def discard(self, size: float, made: float) -> None:
        """Choose a shorter size after a step of `size` s that an FMU has discarded; it names `made` s as successful."""
        is_part = MOST_SHRINKING * size <= made <= LARGEST_PART * size
        self.size = self._settled = self._ceiling = made if is_part else AFTER_DISCARD * size
        self._wary_steps = WARY_STEPS

    def begin_anew(self, *, may_reject: bool) -> None:
        """Choose a small size after an event: the first one where no step can be taken back."""
        least = AFTER_EVENT * self._settled if may_reject else 0.0
        self.size = min(self.size, max(self.first, least))
        self._last_error, self._may_grow = 1.0, True
