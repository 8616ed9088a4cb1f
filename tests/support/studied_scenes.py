"""Scenes for tests of studies of accuracy, and their comparison without measured costs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from support.still_clock import NEVER_LATE, stop_the_clock
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy import AccuracyOfScene, Comparison
from vibroimpact.orchestrator.study.ways import all_ways

P11: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"law": "restitution", "position": 1.0, "restitution": 0.7}],
    "record": {"transient_periods": 35, "recorded_periods": 5},
}
COARSE: dict[str, Any] = {"STEPS_A_PERIOD": (23, 61), "REVISED_CONTACT_STEPS": (10.0, 40.0)}
"""Coarse settings of ways with equal or repeated steps: finer settings take most of the time of a study."""


def studied_once(scene: Scene, settings: dict[str, Any] = COARSE, **options: Any) -> Comparison:
    """Return the comparison of all ways of a scene, at some settings, without measured costs."""
    with pytest.MonkeyPatch.context() as patch:
        stop_the_clock(patch)
        for name, values in settings.items():
            patch.setattr(all_ways, name, values)
        return whole(AccuracyOfScene(scene, budget=NEVER_LATE, **options)).comparison


def ladder(study: Comparison, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the settings of a way, and the errors of all that a scene has, without failures."""
    its = [one for one in study.measured if one.way.name == name and not one.errors.failure]
    return np.array([one.way.setting for one in its]), np.array([one.error("all") for one in its])


STRIP: dict[str, Any] = {
    "body": {
        **{"kind": "beam", "modes": 3, "damping_ratio": 0.02, "length": 0.25},
        **{"flexural_rigidity": 0.9333, "mass_per_length": 0.108},
    },
    "forcing": {"kind": "uniform", "amplitude": 1.0, "angular_frequency": 165.0},
    "record": {"transient_periods": 2, "recorded_periods": 2},
}
SOFT: dict[str, Any] = {"law": "kelvin_voigt", "position": 1e-4, "stiffness": 1e4, "damping": 1.0}
