"""The record of a run without results, with the groups of its scene, all empty."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.analysis.dataset import (
    IMPACT_COLUMNS,
    STICK_COLUMNS,
    Outcome,
    RunRecord,
)
from vibroimpact.analysis.dataset.schema import PERIOD_COLUMNS, POINT_COLUMNS, RULES
from vibroimpact.orchestrator.run.parameters import most_elements
from vibroimpact.orchestrator.scene import Scene

MOST_CONTACTS = int(np.iinfo(RULES["impact_contact"].dtype).max)
"""Largest number of contacts of a scene of components that its table of impacts can number."""


def columns_of_periods(scene: Scene) -> int:
    """Return the number of columns of a table of periods: see `RunRecord`."""
    return len(PERIOD_COLUMNS) + len(POINT_COLUMNS) * len(scene.record.observed[1:])


def records_impacts(scene: Scene) -> bool:
    """Return whether runs of a scene have a table of impacts; scenes of components need contacts for it."""
    return scene.record.impacts and (scene.is_one_body or 0 < len(scene.contacts) <= MOST_CONTACTS)


def empty_record(scene: Scene, outcome: Outcome, message: str, seconds: float) -> RunRecord:
    """Return a record without results.

    Parameters
    ----------
    scene : Scene
        Scene with the groups of the record.
    outcome, message
        Outcome of the run, and its reason.
    seconds : float
        Wall time of the run, s.
    """
    record = scene.record
    elements = most_elements(scene)
    periods = scene.period is not None and (record.extrema or record.strobe)
    return RunRecord(
        outcome=outcome,
        message=message,
        periods=np.empty((0, columns_of_periods(scene))) if periods else None,
        impacts=np.empty((0, len(IMPACT_COLUMNS))) if records_impacts(scene) else None,
        sticks=np.empty((0, len(STICK_COLUMNS))) if record.impacts and scene.is_one_body else None,
        samples=np.empty((0, 1 + len(scene.plain_samples))) if scene.sampled else None,
        formed_samples=tuple(form.empty() for form in scene.sample_forms.values())
        if scene.sample_forms
        else None,
        seconds=seconds,
        final_state=np.full(2 * elements, math.nan) if elements else None,
        events=np.empty((0, 3)) if record.impacts and not scene.is_one_body else None,
    )
