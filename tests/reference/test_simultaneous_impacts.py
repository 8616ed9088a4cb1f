"""Two masses hit their stops at one instant: coupled equals fused, in any order of the stops."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

# symmetric about its middle, with a symmetric motion: both masses move alike
SCENE = """
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = [1.0, 0.7]
dampings = [0.0, 0.0]
far_stiffness = 1.0
velocity_start = [1.0, 1.0]
[[stop]]
mass = {first}
position = 0.3
restitution = {restitution}
[[stop]]
mass = {second}
position = 0.3
restitution = {restitution}
[record]
recorded_time = 30.0
"""


def impacts_of(how: str, first: int, restitution: float) -> NDArray[np.float64]:
    scene = parse_scene(SCENE.format(first=first, second=3 - first, restitution=restitution), "scene.toml")
    runner = PointRunner(scene, execution=how)
    try:
        impacts = runner.run({}).impacts
    finally:
        runner.close()
    assert impacts is not None
    return impacts


@pytest.mark.parametrize("restitution", [1.0, 0.6])
@pytest.mark.parametrize("how", ["fused", "coupled"])
def test_masses_that_move_alike_hit_alike_whatever_the_order_of_their_stops(
    how: str, restitution: float
) -> None:
    one, other = impacts_of(how, 1, restitution), impacts_of(how, 2, restitution)
    assert len(one) >= 6
    np.testing.assert_allclose(one[:, [0, 2, 3]], other[:, [0, 2, 3]], rtol=1e-12)
    pairs = one.reshape(-1, 2, one.shape[1])
    np.testing.assert_allclose(pairs[:, 0, [0, 2]], pairs[:, 1, [0, 2]], rtol=1e-12)


def test_elastic_masses_that_hit_together_keep_their_speed() -> None:
    # each is a unit mass on a unit spring: the spring between them has no effect. Speed at .3 from speed 1 at 0
    one = impacts_of("fused", 1, 1.0)
    np.testing.assert_allclose(one[:, 2], np.sqrt(1.0 - 0.3**2), rtol=1e-12)


@pytest.mark.parametrize("restitution", [1.0, 0.6])
def test_coupled_stops_that_are_hit_together_answer_together(restitution: float) -> None:
    fused, coupled = impacts_of("fused", 1, restitution), impacts_of("coupled", 1, restitution)
    np.testing.assert_allclose(coupled[:, [0, 2, 3, 4]], fused[:, [0, 2, 3, 4]], rtol=1e-12)
