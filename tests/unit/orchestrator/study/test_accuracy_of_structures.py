"""Chains and beams are followed by each way that takes them, and the ways that do not are named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.studied_scenes import SOFT, STRIP, studied_once

from vibroimpact.analysis.landmarks import observed_order
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.study import studied_scene
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.references import Reference, reference_of
from vibroimpact.orchestrator.study.ways.all_ways import remarks_on, ways_of
from vibroimpact.orchestrator.study.ways.plain_steps import PlainForcesTrial, PlainStepsTrial
from vibroimpact.orchestrator.study.ways.revision import RevisedTrial
from vibroimpact.orchestrator.study.ways.trials import CoupledTrial, ModelExchangeTrial
from vibroimpact.orchestrator.study.ways.way import Trial

CHAIN: dict[str, Any] = {
    "body": {"kind": "chain", "masses": [2.0, 1.0], "stiffnesses": [3.0, 1.0], "dampings": 0.1},
    "forcing": {"amplitude": [0.0, 1.0], "angular_frequency": 0.8},
    "record": {"transient_periods": 1, "recorded_periods": 2},
}
RIGID: dict[str, Any] = {"position": 1e-4, "restitution": 0.6}


def errors_by_step(reference: Reference, trials: dict[float, Trial]) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps, or steps a contact, and the errors of the trials that miss no impact."""
    errors = {
        step: errors_of(trial.run(), reference.observation, reference.scales)
        for step, trial in trials.items()
    }
    good = {step: one.worst() for step, one in errors.items() if not one.failure}
    return np.array(list(good)), np.array(list(good.values()))


@pytest.mark.parametrize(
    "tables",
    [
        CHAIN
        | {
            "stop": [
                {"position": 0.5, "restitution": 0.6, "mass": 1},
                {"position": -0.6, "side": "lower", "restitution": 0.7, "mass": 2},
            ]
        },
        STRIP
        | {
            "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
            "stop": [{"position": 1e-3, "restitution": 0.6}],
            "record": {"recorded_periods": 1},
        },
    ],
    ids=["chain", "beam"],
)
def test_a_structure_on_rigid_stops_is_followed_by_plain_steps_and_by_step_revision(
    tables: dict[str, Any],
) -> None:
    scene = studied_scene(Scene.from_dict(tables))
    assert scene.period is not None
    steps = [scene.period / count for count in (1009, 5003, 20011)]
    reference = reference_of(scene)
    found, errors = errors_by_step(reference, {step: PlainStepsTrial(scene, step) for step in steps})
    assert len(found) == 3
    assert errors[-1] < 0.1 * errors[0]  # first order: the last step is a twentieth of the first
    _, errors = errors_by_step(reference, {0.02: RevisedTrial(scene, 0.02 * scene.period)})
    assert errors[0] < 1e-9


@pytest.mark.parametrize(
    "tables",
    [
        CHAIN
        | {
            "stop": [
                {"law": "kelvin_voigt", "position": 0.5, "stiffness": 1e2, "damping": 2.0, "mass": 1},
                {"law": "hertz", "position": -0.6, "side": "lower", "stiffness": 1e2, "mass": 2},
            ]
        },
        STRIP | {"stop": [SOFT | {"location": 0.6}]},
    ],
    ids=["chain", "beam"],
)
def test_a_structure_on_yielding_stops_is_followed_by_held_forces_and_by_step_revision(
    tables: dict[str, Any],
) -> None:
    scene = studied_scene(Scene.from_dict(tables))
    assert scene.period is not None
    steps, reference = [scene.period / count for count in (503, 2503)], reference_of(scene)
    for exchange in ("jacobi", "gauss_seidel"):
        trials = {step: PlainForcesTrial(scene, exchange, step) for step in steps}
        _, errors = errors_by_step(reference, dict(trials))
        assert errors[1] == pytest.approx(errors[0] / 5.0, rel=0.5)
    longest = 0.2 * scene.period
    counts = {1.0 / count: RevisedTrial(scene, longest, count) for count in (10.0, 40.0)}
    found, errors = errors_by_step(reference, dict(counts))
    assert observed_order(found, errors) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(
    ("changes", "left_out", "kept"),
    [
        (
            {
                "stop": [SOFT | {"location": 0.6}],
                "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
            },
            "plain steps of equal size and step revision: a body with one force takes it where it is forced",
            None,
        ),
        (
            {"stop": [RIGID, RIGID | {"location": 0.6}]},
            "step revision: a body with one force takes it",
            "plain steps",
        ),
        (
            {"stop": [RIGID, SOFT | {"location": 0.6}]},
            "plain steps of equal size: some stops are rigid and others yield",
            None,
        ),
        (
            {"stop": [RIGID], "body": STRIP["body"] | {"impact_projection": "collocation"}},
            "plain steps of equal size: the impacts of a Beam with another projection",
            "step revision",
        ),
    ],
)
def test_a_way_that_a_body_does_not_take_is_left_out_by_name(
    changes: dict[str, Any], left_out: str, kept: str | None
) -> None:
    scene = studied_scene(Scene.from_dict(STRIP | changes))
    assert any(remark.startswith(left_out) for remark in remarks_on(scene))
    names = {way.name.partition(",")[0] for way in ways_of(scene)}
    assert names & {"plain steps", "step revision"} == ({kept} if kept else set())


def test_an_impact_whose_contact_is_not_over_is_one_of_each_way_too() -> None:
    scene = studied_scene(
        Scene.from_dict(
            STRIP
            | {
                "stop": [SOFT | {"location": 0.6}],
                "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
            }
        )
    )
    trials = (CoupledTrial(scene, "3.0"), CoupledTrial(scene, "2.0"), ModelExchangeTrial(scene, 1e-8))
    reference = reference_of(scene)
    _, errors = errors_by_step(reference, dict(enumerate(trials)))
    assert len(errors) == 3
    assert len(reference.observation.impacts) == 2


def test_a_chain_is_studied_with_fewer_modes_and_with_stops_of_other_laws() -> None:
    tables = {
        "body": {"kind": "chain", "masses": [2.0, 1.0], "stiffnesses": [3.0, 1.0], "dampings": 0.1},
        "forcing": {"amplitude": [0.0, 1.0], "angular_frequency": 0.8},
        "stop": [
            {"law": "kelvin_voigt", "position": 0.5, "stiffness": 1e4, "damping": 20.0, "mass": 1},
            {"law": "hunt_crossley", "position": 0.5, "stiffness": 1e5, "damping": 0.2, "mass": 2},
        ],
        "record": {"recorded_periods": 1},
    }
    study = studied_once(Scene.from_dict(tables))
    fused = [one for one in study.measured if one.way.name == "fused"]
    balances = [one.errors.of["energy_balance"] for one in fused]
    assert balances[0] > 1e-9  # at a contact tolerance of 0.01
    assert balances[-1] < 1e-13
    names = {one.way.name for one in study.measured if one.way.model}
    assert names == {
        "modes",
        *(f"{law} stops of equal restitution" for law in ("rigid", "Kelvin-Voigt", "Hunt-Crossley")),
    }
    assert study.modes_reference == "all 2 modes"
