"""One run of the scene of a hard case."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene

IMPACT_TIME, IMPACT_PHASE, IMPACT_VELOCITY = 0, 1, 2
IMPACT_IMPULSE, IMPACT_RESTITUTION, IMPACT_DURATION = 3, 5, 6
"""Columns of the impacts of a record."""
STICK_START, STICK_END = 0, 1
"""Columns of the sticks of a record."""
PLAIN: dict[str, Any] = {"mass": 1.0, "stiffness": 1.0}
"""An oscillator with a natural frequency of 1 rad/s."""


def recorded(**tables: Any) -> RunRecord:
    """Run a nondimensional scene, fused, to its end of any kind."""
    scene = Scene.from_dict({"scene": {"units": "nondimensional"}, **tables}, "hard case")
    runner = open_runner(scene, "fused")
    try:
        return runner.run({})
    finally:
        runner.close()


def run(**tables: Any) -> RunRecord:
    """Run a nondimensional scene, fused, to its end; ComponentError if it ends early."""
    record = recorded(**tables)
    if record.outcome not in (Outcome.ok, Outcome.stuck):
        raise ComponentError(
            f"hard case: expected a run to its end, got {record.outcome.name}: {record.message}"
        )
    return record


def impacts_of_points(how: str, **tables: Any) -> list[NDArray[np.float64]]:
    """Return times and speeds of the impacts of each point of a sweep, shape (impact, 2), run with `execution.how`."""
    from vibroimpact.analysis.dataset import read_flat
    from vibroimpact.orchestrator.running import run_scene

    document = {"scene": {"units": "nondimensional"}, "execution": {"how": how}, **tables}
    with TemporaryDirectory() as folder:
        run_scene(Scene.from_dict(document, "hard case"), Path(folder, "points.nc"))
        rows = read_flat(Path(folder, "points.nc")).load()
    found = np.stack([rows.impact_time.values, rows.impact_velocity.values], axis=1)
    return np.split(found, np.cumsum(rows.impact_count.values)[:-1])


def restitution(position: float, coefficient: float, **keys: Any) -> dict[str, Any]:
    """Return the table of a rigid stop."""
    return {"position": position, "restitution": coefficient, **keys}


def kelvin_voigt(position: float, stiffness: float, damping: float = 0.0, **keys: Any) -> dict[str, Any]:
    """Return the table of a Kelvin-Voigt stop."""
    return {"law": "kelvin_voigt", "position": position, "stiffness": stiffness, "damping": damping, **keys}
