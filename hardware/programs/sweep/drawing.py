"""The figure of a sweep's planned output, before anything is driven."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.figures import Figure, draw_planned_drive
from vibroimpact.hardware.programs.sweep.plan import Plan
from vibroimpact.hardware.programs.sweep.settings import SweepSettings

_PERIODS = 4
"""Forcing periods drawn on both sides of a change."""


def draw_plan(plan: Plan, settings: SweepSettings) -> Figure:
    """Return the figure of a sweep's frequency over time, its beginning, a change of frequency and its end."""
    steps = [segment for segment in plan.segments if segment.place >= 0]
    begins = np.array([segment.first for segment in steps] + [steps[-1].stop]) / plan.rate
    frequencies = np.array([settings.steps[segment.place][1] for segment in steps])
    around = round(_PERIODS * plan.rate / settings.frequencies[0])
    rise, fall = plan.segments[0], plan.segments[-1]
    spans = [("beginning", rise.first, rise.stop + around)]
    if len(steps) > 1:
        change = steps[1].first
        spans.append(("change of frequency", change - around, change + around))
    spans.append(("end", fall.first - around, fall.stop))
    stretches = [
        (title, np.arange(first, stop) / plan.rate, plan.volts(first, stop - first))
        for title, first, stop in spans
    ]
    return draw_planned_drive(begins, frequencies, stretches)
