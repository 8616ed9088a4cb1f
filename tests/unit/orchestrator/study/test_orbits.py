"""Names of orbits in a study of accuracy are the names that `classify` gives to the same motion."""

from __future__ import annotations

from typing import Any

import pytest

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.study import studied_scene
from vibroimpact.orchestrator.study.orbits import orbit_of
from vibroimpact.orchestrator.study.references import observed, scales_of

CHATTER: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 40.0, "damping_ratio": 0.02},
    "forcing": {"amplitude": 50.0, "angular_frequency": 0.7},
    "stop": [{"position": 0.0, "restitution": 0.8}],
    "record": {"transient_periods": 2, "recorded_periods": 8, "extrema": True, "strobe": True},
}
P11: dict[str, Any] = {
    "body.stiffness": 1.0,
    "body.damping_ratio": 0.1,
    "forcing.amplitude": 0.5,
    "forcing.angular_frequency": 1.0,
    "stop[1].position": 1.0,
    "stop[1].restitution": 0.7,
    "record.transient_periods": 300,
}
FREE_FLIGHT: dict[str, Any] = {"stop[1].position": 1000.0}
PRESSED: dict[str, Any] = {"stop[1].position": -1000.0, "body.displacement_start": -1000.0}


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "P(inf,1)"),
        ({"forcing.angular_frequency": 0.9}, "P(inf,1)"),
        ({"stop[1].restitution": 0.0}, "P(inf,1)"),
        (P11, "P(1,1)"),
        (FREE_FLIGHT, "no impacts"),
        (PRESSED | {"record.transient_periods": 30}, "rest"),
    ],
)
def test_a_study_and_classify_give_a_motion_one_name(changes: dict[str, Any], name: str) -> None:
    scene = studied_scene(Scene.from_dict(CHATTER).with_values(changes))
    window = scales_of(scene).window
    assert orbit_of(observed(scene), scene.period, window) == name
    assert vi.classify(vi.run(scene.with_values({"record.strobe": True})))[0].name == name
