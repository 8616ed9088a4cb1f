"""Laws of every replay: superposition, any division of the steps, removed offsets."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.replay_scenes import Floats

from vibroimpact.orchestrator.replay.drive import quiet_level, step_instants
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.scene import parse_scene

BODY = "[body]\nmass = 1.0\nstiffness = {stiffness!r}\ndamping = {damping!r}\n[record]\nrecorded_time = 1\n"
STEP = 0.01
signals = arrays(np.float64, 40, elements=st.floats(-100.0, 100.0, allow_subnormal=False))
bodies = st.builds(
    lambda stiffness, ratio: BODY.format(stiffness=stiffness, damping=2.0 * ratio * stiffness**0.5),
    st.floats(1.0, 1e5),
    st.floats(0.0, 1.5),
)


def response(body: str, times: Floats, values: Floats) -> Floats:
    with Session(parse_scene(body, "body.toml"), ["displacement"]) as session:
        session.begin()
        return session.follow(times, "base_acceleration", values)[:, 0]


@settings(max_examples=40)
@given(bodies, signals, signals, st.floats(-3.0, 3.0))
def test_the_response_to_a_sum_of_drives_is_the_sum_of_responses(
    body: str, one: Floats, other: Floats, factor: float
) -> None:
    times = STEP * np.arange(len(one))
    parts = response(body, times, one) + factor * response(body, times, other)
    together = response(body, times, one + factor * other)
    size = max(1e-12, float(np.abs(one).max() + abs(factor) * np.abs(other).max()))
    # displacements are at most of the size of the base's own, acceleration times duration squared
    np.testing.assert_allclose(together, parts, rtol=0.0, atol=1e-11 * size * times[-1] ** 2)


@settings(max_examples=40)
@given(bodies, signals, st.integers(2, 7))
def test_any_division_of_the_steps_gives_the_same_motion(body: str, values: Floats, parts: int) -> None:
    times = STEP * np.arange(len(values))
    fine = step_instants(times, STEP / parts, float(times[-1]))
    assert set(times) <= set(fine)
    divided = response(body, fine, np.interp(fine, times, values))
    whole = response(body, times, values)
    size = max(1e-12, float(np.abs(values).max())) * times[-1] ** 2
    np.testing.assert_allclose(divided[::parts], whole, rtol=0.0, atol=1e-11 * size)


@given(signals, st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_the_level_of_rest_shifts_and_scales_with_the_signal(
    values: Floats, offset: float, scale: float
) -> None:
    level = quiet_level(values)
    assert abs(quiet_level(scale * values) - scale * level) <= 1e-9 * scale * (1.0 + np.abs(values).max())
    # rounding of the offset may choose another one of several equally quiet parts
    assert values.min() - 1e-9 <= quiet_level(values + offset) - offset <= values.max() + 1e-9
