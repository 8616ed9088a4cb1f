"""The change of outputs whose step is not repeated: against the straight line through their last values."""

from __future__ import annotations

import numpy as np

from vibroimpact.orchestrator.importer.adaptive.outputs import Floats, Outputs

#: Error over the tolerance above which values have jumped: a line through them says nothing about the next step.
JUMP = 100.0
#: Length of a step over the next one, below which rounding hides the slope of the line.
INFORMATIVE_PART = 1e-3


class Extrapolation:
    """Compares outputs at the end of a step with the line through their last two values.

    An input is held over a step while its output changes. The effect on the motion is a second power of the step, as
    is the deviation from the line. The error is `deviation / scale + (change / scale)^2 / 2`.

    Parameters
    ----------
    outputs : Outputs
        The outputs.
    tolerance : float
        Relative error of a step.
    is_coupling : bool
        The outputs are connected. Else they show a path, and the second term is left out.
    """

    def __init__(self, outputs: Outputs, tolerance: float, *, is_coupling: bool) -> None:
        self.outputs, self.tolerance, self.is_coupling = outputs, tolerance, is_coupling
        self._points: list[tuple[float, Floats]] = []

    def begin(self, time: float, window: float) -> None:
        """Start a run at `time`, s; the first `window` s of a motion give no scale."""
        self.outputs.begin(window, self.tolerance)
        self.begin_anew(time)

    def begin_anew(self, time: float) -> None:
        """Take the values at `time`, s, as the first ones: an event has changed them."""
        values = self.outputs.read()
        self.outputs.learn(time, values)
        self._points = [(time, values)]

    def errors(self, end: float, size: float, *, first: bool) -> Floats:
        """Return the errors of a step over the tolerance, and take the values at its end.

        Parameters
        ----------
        end, size : float
            End and length of the step, s.
        first : bool
            The step has the first size: values that begin to move are not judged.
        """
        outputs, values, points = self.outputs, self.outputs.read(), self._points
        error = np.zeros(len(outputs))
        if points:
            last, before = points[-1]
            if self.is_coupling:
                change = outputs.over_scale(outputs.difference(values, before), before, values, end, size)
                error = 0.5 * change * change
            earlier, start = points[0]
            if last - earlier > INFORMATIVE_PART * size:
                line = before + (before - start) * ((end - last) / (last - earlier))
                error = error + outputs.over_scale(
                    outputs.difference(values, line), before, values, end, size
                )
            error /= self.tolerance
            if first:
                error = outputs.without_first(error, values, end)
        jumps = bool(np.any(error > JUMP))
        self._points = [*([] if jumps else points[-1:]), (end, values)]
        outputs.learn(end, values)
        return error
