"""A scene as a function gives the bits of its runs, for any values of its keys."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi

RANGES = {
    "body.mass": (0.5, 2.0),
    "body.stiffness": (0.5, 4.0),
    "body.damping_ratio": (0.0, 0.5),
    "body.velocity_start": (-2.0, 2.0),
    "forcing.amplitude": (0.0, 3.0),
    "forcing.angular_frequency": (0.3, 3.0),
    "forcing.phase": (-4.0, 4.0),
    "stop[1].position": (0.2, 2.0),
    "stop[1].restitution": (0.0, 1.0),
}
"""Keys with the smallest and the largest of their drawn values."""


@st.composite
def points(draw: st.DrawFn) -> tuple[list[str], list[list[float]]]:
    """Draw some keys, and values of them."""
    keys = draw(st.lists(st.sampled_from(list(RANGES)), min_size=1, max_size=3, unique=True))
    one = st.tuples(*(st.floats(*RANGES[key]) | st.sampled_from(RANGES[key]) for key in keys))
    return keys, [list(values) for values in draw(st.lists(one, min_size=2, max_size=3))]


@settings(max_examples=40, deadline=None)
@given(points(), st.sampled_from(["force", "base_acceleration"]))
def test_calls_have_the_bits_of_runs(drawn: tuple[list[str], list[list[float]]], kind: str) -> None:
    keys, values = drawn
    scene = vi.Scene.from_dict(
        {
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
            "forcing": {"kind": kind, "amplitude": 1.0, "angular_frequency": 0.9},
            "stop": [{"position": 1.0, "restitution": 0.7}],
            "record": {"transient_periods": 1, "recorded_periods": 2},
            "execution": {"impact_limit": 300},
        }
    )
    with vi.runner(scene, keys) as motion:
        for point in values:
            found = motion(point)
            expected = vi.run(scene.with_values(dict(zip(keys, point, strict=True))), progress=False)
            for name, array in found.items():
                own, values_of_run = np.asarray(array), expected[name].values
                assert own.dtype.kind == "U" or own.tobytes() == values_of_run.tobytes(), name
            assert str(found["message"]) == str(expected.message.values)
