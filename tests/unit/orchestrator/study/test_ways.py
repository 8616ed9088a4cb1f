"""Trials of the ways of a scene: over all of its time or a first part, given up by a clock, and without output."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vibroimpact.orchestrator.run.record import runs_limited
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import LATE
from vibroimpact.orchestrator.study.references import scales_of
from vibroimpact.orchestrator.study.ways.driven import DrivenTrial
from vibroimpact.orchestrator.study.ways.plain_steps import PlainForcesTrial, PlainStepsTrial
from vibroimpact.orchestrator.study.ways.revision import RevisedTrial
from vibroimpact.orchestrator.study.ways.sampled import SampledTrial
from vibroimpact.orchestrator.study.ways.span import first_part, halved
from vibroimpact.orchestrator.study.ways.trials import CoupledTrial, ModelExchangeTrial
from vibroimpact.orchestrator.study.ways.way import Trial, opened_part

RIGID: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"law": "restitution", "position": 1.0, "restitution": 0.7}],
    "record": {"recorded_periods": 8, "impacts": True, "extrema": True},
}
YIELDING: dict[str, Any] = RIGID | {
    "stop": [{"law": "kelvin_voigt", "position": 1.0, "stiffness": 100.0, "damping": 1.0}]
}
TRIALS: dict[str, tuple[dict[str, Any], Callable[[Scene, float], Trial]]] = {
    "fused": (RIGID, lambda scene, part: DrivenTrial(scene, part)),
    "as the scene says": (RIGID, lambda scene, part: opened_part(scene, part)),
    "coupled": (RIGID, lambda scene, part: CoupledTrial(scene, "2.0", part=part)),
    "plain steps": (RIGID, lambda scene, part: PlainStepsTrial(scene, 0.01, part=part)),
    "held forces": (YIELDING, lambda scene, part: PlainForcesTrial(scene, "jacobi", 0.01, part=part)),
    "step revision": (RIGID, lambda scene, part: RevisedTrial(scene, 0.5, part=part)),
    "model exchange": (RIGID, lambda scene, part: ModelExchangeTrial(scene, 1e-8, part=part)),
    "samples": (RIGID, lambda scene, part: SampledTrial(scene, 50.0, part=part)),
}
"""Each kind of trial, with a scene for it."""


@pytest.mark.parametrize("kind", TRIALS)
def test_the_first_part_of_a_motion_is_that_of_all_of_it(kind: str) -> None:
    tables, opened = TRIALS[kind]
    scene, found = Scene.from_dict(tables), []
    for part in (1.0, 0.5):
        trial = opened(scene, part)
        try:
            found.append(trial.run().impacts)
        finally:
            trial.close()
    end = scales_of(scene, 0.5).window[1]
    first = found[0][found[0][:, 0] <= end]
    assert end == pytest.approx(8.0 * math.pi)
    assert 0 < len(first) < len(found[0])
    np.testing.assert_allclose(found[1], first, rtol=1e-6)


@pytest.mark.parametrize(
    "kind", ["fused", "coupled", "plain steps", "held forces", "step revision", "model exchange"]
)
def test_a_run_is_given_up_by_the_clock_that_limits_it_and_says_how_far_it_came(kind: str) -> None:
    tables, opened = TRIALS[kind]
    record = tables["record"] | {"recorded_periods": 40_000}
    trial, time = opened(Scene.from_dict(tables | {"record": record}), 1.0), 0.0

    def look() -> float:
        nonlocal time
        time += 0.01
        return time

    try:
        with runs_limited(0.015, look):
            found = trial.run()
    finally:
        trial.close()
    assert found.failure == LATE
    assert 0.0 <= found.reached < 0.5


def test_a_limit_of_runs_ends_with_its_block() -> None:
    trial = DrivenTrial(Scene.from_dict(RIGID))
    with runs_limited(-1.0, lambda: 0.0):
        assert trial.run().failure == LATE
    assert trial.run().failure == ""
    trial.close()


def test_recordings_are_halved_to_a_period() -> None:
    periods, scene = [], Scene.from_dict(RIGID)
    while (shorter := halved(scene)) is not None:
        scene = shorter
        periods.append(scene.record.recorded_periods)
    assert periods == [4, 2, 1]
    free = Scene.from_dict(
        {"body": {"mass": 1.0, "stiffness": 4.0, "displacement_start": 1.0}, "record": {"recorded_time": 5.0}}
    )
    shorter = halved(free)
    assert shorter is not None
    assert shorter.record.recorded_time == first_part(free, 0.5).record.recorded_time == 2.5


SLENDER: dict[str, Any] = {
    "body": {
        **{"kind": "beam", "modes": 16, "damping_ratio": 0.005, "length": 0.4, "width": 0.03},
        **{"thickness": 0.004, "youngs_modulus": 70e9, "density": 2700.0},
    },
    "forcing": {"location": 0.5, "amplitude": 4.0, "frequency": 21.0},
    "stop": [{"law": "kelvin_voigt", "position": 0.0015, "stiffness": 5e5, "damping": 20.0}],
    "record": {"recorded_periods": 1},
}
"""A beam whose FMU warns of modes that leave the validity of its theory."""


def test_what_an_fmu_logs_to_its_integrator_does_not_reach_the_user(
    capfd: pytest.CaptureFixture[str],
) -> None:
    found = ModelExchangeTrial(Scene.from_dict(SLENDER), 1e-4, part=2.0**-10).run()
    assert found.failure == ""
    assert capfd.readouterr() == ("", "")
