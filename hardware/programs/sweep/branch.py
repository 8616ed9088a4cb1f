"""The check that a continued sweep is still on its branch."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vibroimpact.fmus.errors import RigError
from vibroimpact.hardware.programs.sweep.analysis import MeasuredStep
from vibroimpact.hardware.programs.sweep.settings import SweepSettings

_SAME = 0.05
"""Difference of two ranges, relative to the larger one, below which two motions are equal, with scatter added."""


def refuse_other_branch(
    before: MeasuredStep, now: MeasuredStep, settings: SweepSettings, folder: Path
) -> None:
    """Raise RigError if the last finished step, measured again, shows another motion.

    The motions differ if their ranges differ by more than 5 % plus their scatter from period to period.
    """
    spread = max(_spread(before), _spread(now))
    difference = abs(before.range - now.range)
    # NaN, from a step without a whole period, compares false
    if difference > _SAME * max(before.range, now.range) + spread:
        direction, frequency = settings.steps[before.place]
        was, now_is = (f"{1e3 * step.range:.4g} mm" for step in (before, now))
        raise RigError(
            f"{folder}: expected the motion of {was} at {frequency:g} Hz {direction.name} on which this sweep was "
            f"left, got one of {now_is}. What was measured is kept. Give more sweep.resume_periods, or begin anew in "
            "another folder."
        )


def _spread(step: MeasuredStep) -> float:
    ranges = step.highest - step.lowest
    return float(np.nanmax(ranges) - np.nanmin(ranges)) if np.isfinite(ranges).any() else 0.0
