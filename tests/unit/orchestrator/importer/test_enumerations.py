"""Connections between integers and enumerations: an item is passed on as its number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.fmu_factory import bouncing_ball, redescribed

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene

SCENE = """
[component.a]
fmu = "ball.fmu"
[component.b]
fmu = "taught.fmu"
[[connection]]
from = "a.bounces"
to = "b.landing"
[record]
recorded_time = 1.0
rate = 10
variables = ["a.bounces", "b.landing"]
[execution]
macro_step = 0.1
exchange = "jacobi"
guard = false
"""
FIXED = 'causality="parameter" variability="fixed" initial="exact"'
INPUT = 'causality="input" variability="discrete"'


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_integer_feeds_an_enumeration_by_its_number(tmp_path: Path, fmi: str) -> None:
    ball = bouncing_ball(tmp_path, fmi)
    ball.rename(tmp_path / "ball.fmu")
    head = 'name="landing" valueReference="5" '
    redescribed(tmp_path / "ball.fmu", tmp_path / "taught.fmu", (head + FIXED, head + INPUT))
    (tmp_path / "scene.toml").write_text(SCENE)
    data = vi.run(Scene.from_file(tmp_path / "scene.toml"))
    counted, passed_on = data.a_bounces.values, data.b_landing.values
    assert counted.max() >= 1.0
    # a value is passed on at the beginning of a step, after the sample of its instant
    np.testing.assert_array_equal(passed_on[1:], counted[:-1])
