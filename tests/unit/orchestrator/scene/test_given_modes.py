"""Bodies of given modes: equal to the bodies that have these modes, and their mistakes by name."""

from __future__ import annotations

import re
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.fmus.bodies.beam import BeamPoints
from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene

RECORD = {"transient_periods": 0, "recorded_periods": 20}
TWO_MODES: dict[str, Any] = {
    "body": {
        "kind": "modes",
        "frequencies": [10.0, 62.0],
        "damping_ratio": 0.01,
        "shapes": {"tip": [2.0, -2.0], "middle": [0.7, 1.4]},
    },
    "forcing": {"at": "body.middle", "amplitude": 0.5, "frequency": 11.0},
    "stop": [{"at": "body.tip", "position": 1e-4, "restitution": 0.7}],
    "record": RECORD,
}


def changed(**tables: Any) -> dict[str, Any]:
    """Return the tables of a scene of two modes, changed in `body` or replaced."""
    found = deepcopy(TWO_MODES)
    found["body"] |= tables.pop("body", {})
    return found | tables


def test_the_modes_of_a_beam_are_this_beam() -> None:
    beam: dict[str, Any] = {
        "kind": "beam",
        "length": 0.3,
        "flexural_rigidity": 0.35,
        "mass_per_length": 0.156,
    }
    beam |= {"modes": 4, "damping_ratio": 0.01}
    scene = Scene.from_dict(
        {
            "body": beam,
            "forcing": {"amplitude": 0.5, "frequency": 9.0},
            "stop": [{"position": 0.001, "restitution": 0.6}],
            "record": RECORD,
        }
    )
    numbers = {"length": 0.3, "flexural_rigidity": 0.35, "mass_per_length": 0.156, "sensor_location": 1.0}
    numbers |= {"forcing_location": 1.0, "contact[1].location": 1.0}
    numbers |= {f"damping_ratio[{i}]": 0.01 for i in range(1, 5)}
    integers = {"modes": 4, "residual": 0, "boundary": 1, "impact_projection": 1, "forcing.kind": 1}
    known = BeamPoints(numbers, integers, 1).structure_of(numbers)
    tip = beam_modes("clamped_free", 4).shapes(1.0)[0] / np.sqrt(known.mass)
    given = {
        "kind": "modes",
        "angular_frequencies": known.frequencies.tolist(),
        "damping_ratio": 0.01,
        "shapes": {"tip": tip.tolist()},
    }
    one, other = (
        vi.run(each)
        for each in (
            scene,
            Scene.from_dict(
                {
                    "body": given,
                    "forcing": {"at": "body.tip", "amplitude": 0.5, "frequency": 9.0},
                    "stop": [{"at": "body.tip", "position": 0.001, "restitution": 0.6}],
                    "record": {**RECORD, "observed": ["body.tip"]},
                }
            ),
        )
    )
    first = min(int(one.impact_count), 20)
    assert first > 5
    np.testing.assert_allclose(one.impact_time[:first], other.impact_time[:first], rtol=1e-11)
    np.testing.assert_allclose(one.impact_velocity[:first], other.impact_velocity[:first], rtol=1e-8)


def test_a_contact_of_two_points_of_one_shape_is_refused_by_its_key() -> None:
    shapes = {"tip": [2.0, -2.0], "end": [2.0, -2.0], "middle": [0.7, 1.4]}
    own = TWO_MODES["body"] | {"name": "own", "shapes": shapes}
    tables = {
        "body": [own, {"name": "ball", "mass": 1.0, "stiffness": 1.0}],
        "record": {"recorded_time": 1.0},
    }
    contact = {"restitution": 0.5, "clearance": 0.0}
    text = re.escape('contact[1].between: expected two points that move apart, got "own.tip" and "own.end"')
    with pytest.raises(SceneError, match=text):
        Scene.from_dict(tables | {"contact": [contact | {"between": ["own.tip", "own.end"]}]})
    for between in (["own.tip", "own.middle"], ["own.tip", "ball"]):
        assert len(Scene.from_dict(tables | {"contact": [contact | {"between": between}]}).stops) == 1


def test_the_rounding_of_a_product_leaves_a_damping_matrix_symmetric() -> None:
    dashpots = 0.1 * np.array([[0.3, 1.7], [0.1, 0.7]])
    rounded = dashpots @ np.array([[1.1, 0.3], [0.3, 0.7]]) @ dashpots.T
    rounded[0, 1] = np.nextafter(rounded[1, 0], 1.0)
    exact = 0.5 * (rounded + rounded.T)
    one, other = (
        vi.run(Scene.from_dict(changed(body={"damping_matrix": each.tolist()}))) for each in (rounded, exact)
    )
    assert (one.final_state.values == other.final_state.values).all()


@pytest.mark.parametrize(
    ("tables", "key", "expected"),
    [
        ({"body": {"angular_frequencies": [1.0, 2.0]}}, "body[1]", "frequencies, Hz, or angular_frequencies"),
        ({"body": {"frequencies": [1.0, -2.0]}}, "body[1].frequencies[2]", "a number >= 0"),
        ({"body": {"frequencies": [1.0] * 65}}, "body[1].frequencies", "an array of numbers >= 0"),
        (
            {"body": {"shapes": {"tip": [1.0]}}},
            "body[1].shapes.tip",
            "an array of 2, one number for each mode",
        ),
        ({"body": {"shapes": {"a b": [1.0, 2.0]}}}, "body[1].shapes", "names of letters"),
        (
            {"body": {"damping_matrix": [[1.0, 0.2], [0.1, 1.0]]}},
            "body[1].damping_matrix",
            "a symmetric matrix",
        ),
        ({"body": {"damping_matrix": [[1.0, 0.2]]}}, "body[1].damping_matrix", "an array of 2"),
        ({"body": {"displacement_start": [0.0] * 3}}, "body[1].displacement_start", "at most 2 numbers"),
        ({"body": {"mass": 1.0}}, "body[1].mass", "a known key"),
        (
            {"stop": [{"at": "body.top", "position": 1.0, "restitution": 0.5}]},
            "stop[1].at",
            "a point with shapes",
        ),
        (
            {"body": {"shapes": {"tip": [0.0, 0.0], "middle": [0.7, 1.4]}}},
            "stop[1].at",
            "a point that a mode moves",
        ),
        (
            {"forcing": {"kind": "base_acceleration", "amplitude": 1.0, "frequency": 11.0}},
            "body[1].participation",
            "it beside base_acceleration",
        ),
    ],
)
def test_mistakes_of_given_modes_have_one_line(tables: dict[str, Any], key: str, expected: str) -> None:
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(changed(**tables))
    first = str(caught.value).splitlines()[0]
    assert f"{key}: expected {expected}" in first


def test_a_damping_matrix_couples_given_modes() -> None:
    coupled = vi.run(Scene.from_dict(changed(body={"damping_matrix": [[2.0, 1.0], [1.0, 3.0]]})))
    alone = vi.run(Scene.from_dict(changed()))
    assert int(coupled.outcome) == 0
    assert float(coupled.impact_time[3]) != float(alone.impact_time[3])


def test_frequencies_of_given_modes_are_keys_of_a_sweep() -> None:
    sweep = {"body.frequencies[2]": {"values": [60.0, 70.0]}, "body.damping_ratio": {"values": [0.01, 0.02]}}
    scene = Scene.from_dict(changed(sweep=sweep))
    assert [axis.key for axis in scene.sweep] == ["body[1].frequencies[2]", "body[1].damping_ratio"]
