"""A scene run fused, and coupled (its stop an FMU), has the same impacts and the same energy losses.

Only the first impacts are compared: in chaotic motion rounding grows, and the two runs differ later.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

#: Number of compared impacts.
IMPACTS = {"restitution": 5, "kelvin_voigt": 5, "hertz": 2, "hunt_crossley": 2}
#: Relative difference of the impacts. The importer divides a compliant contact into thirty steps: exact for a linear
#: law, fourth order for the others. The orbit decides the growth of a difference from one impact to the next.
AGREEMENT = {"restitution": 1e-9, "kelvin_voigt": 1e-9, "hertz": 1e-3, "hunt_crossley": 1e-3}

laws = st.one_of(
    st.fixed_dictionaries({"law": st.just("restitution"), "restitution": st.floats(0.3, 1.0)}),
    st.fixed_dictionaries(
        {
            "law": st.just("restitution"),
            "restitution": st.floats(0.5, 1.0),
            "yield_velocity": st.floats(0.05, 1.0),
        }
    ),
    st.fixed_dictionaries(
        {"law": st.just("kelvin_voigt"), "stiffness": st.floats(1e2, 1e6), "damping": st.floats(0.0, 10.0)}
    ),
    st.fixed_dictionaries({"law": st.just("hertz"), "stiffness": st.floats(1e3, 1e6)}),
    st.fixed_dictionaries(
        {"law": st.just("hunt_crossley"), "stiffness": st.floats(1e3, 1e6), "damping": st.floats(0.0, 0.5)}
    ),
)


def scene_text(body: str, stop: dict[str, Any], angular_frequency: float, position: float, how: str) -> str:
    """Return a forced scene of a few periods."""
    keys = "\n".join(f"{k} = {v!r}".replace("'", '"') for k, v in stop.items())
    return f"""
    {body}
    angular_frequency = {angular_frequency!r}
    [[stop]]
    position = {position!r}
    {keys}
    [record]
    recorded_periods = 3
    [execution]
    how = "{how}"
    """


OSCILLATOR = "[body]\nmass = 1.0\nstiffness = 1.0\ndamping = 0.1\n[forcing]\namplitude = 1.0\n"
CHAIN = """[body]
kind = "chain"
masses = [1.0, 0.7]
stiffnesses = [1.0, 2.0]
dampings = [0.1, 0.05]
[forcing]
amplitude = [1.0, 0.0]
"""


def impacts_of(text: str) -> NDArray[np.float64]:
    runner = PointRunner(
        parse_scene(text, "scene.toml"), execution="fused" if '"fused"' in text else "coupled"
    )
    try:
        impacts = runner.run({}).impacts
    finally:
        runner.close()
    assert impacts is not None
    return impacts


@settings(max_examples=50)
@given(
    body=st.sampled_from([OSCILLATOR, CHAIN]),
    stop=laws,
    angular_frequency=st.floats(0.5, 1.5),
    position=st.floats(0.1, 0.6),
)
def test_coupled_and_fused_meet_the_same_impacts_and_lose_the_same_energies(
    body: str, stop: dict[str, Any], angular_frequency: float, position: float
) -> None:
    fused, coupled = (
        impacts_of(scene_text(body, stop, angular_frequency, position, how)) for how in ("fused", "coupled")
    )
    most = IMPACTS[stop["law"]]
    both = min(len(fused), len(coupled), most)
    assert min(len(fused), most) == min(len(coupled), most)
    room = AGREEMENT[stop["law"]]
    fused, coupled = fused[:both], coupled[:both]
    phase_apart = np.abs(np.exp(1j * fused[:, 1]) - np.exp(1j * coupled[:, 1]))
    assert (phase_apart <= room * (1.0 + 2.0 * math.pi)).all()
    scale = float(np.abs(fused[:, 2]).max(initial=1e-3))
    np.testing.assert_allclose(fused[:, 2], coupled[:, 2], atol=room * scale)
    lost = [rows[:, 2] ** 2 * (1.0 - rows[:, 5] ** 2) for rows in (fused, coupled)]
    np.testing.assert_allclose(lost[0], lost[1], atol=4.0 * room * scale**2)
