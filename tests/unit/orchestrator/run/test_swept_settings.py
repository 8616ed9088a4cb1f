"""Sweeps over numbers of modes, tolerances and steps: each point equals the scene with that setting."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.replay_scenes import BOARD, channel, pulse, written

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.replay.fit import fit_keys
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.run.parameters import padded_state, without_padding
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.changes import text_with_values

BEAM = """
[body]
kind = "beam"
length = 1.0
mass_per_length = 1.0
flexural_rigidity = 1.0
damping_ratio = 0.01
[forcing]
kind = "uniform"
amplitude = 1.0
frequency = 0.5
[[stop]]
position = 0.05
law = "hertz"
stiffness = 1e5
[record]
transient_periods = 2
recorded_periods = 4
"""
COUPLED = """
[component.a]
fmu = "Oscillator"
parameters = { stiffness = 1.0, displacement_start = 1.0 }
[component.b]
fmu = "Oscillator"
parameters = { stiffness = 2.0 }
[[connection]]
from = "a.displacement"
to = "b.force"
gain = 1.0
gain_unit = "N/m"
[record]
recorded_time = 10
variables = ["b.displacement"]
rate = 10
[execution]
macro_step = 0.2
"""
KELVIN_VOIGT = BEAM.replace('law = "hertz"', 'law = "kelvin_voigt"') + '[execution]\nhow = "coupled"\n'


def run(scene: Scene) -> xr.Dataset:
    return vi.run(scene, progress=False)


@pytest.mark.parametrize(
    ("text", "key", "values"),
    [
        (BEAM, "body.modes", [4, 1, 64, 2]),
        (BEAM, "execution.contact_tolerance", [1e-3, 1e-9]),
        (KELVIN_VOIGT, "execution.macro_step", [0.5, 0.01]),
    ],
)
def test_each_point_is_bit_for_bit_the_scene_that_says_so(text: str, key: str, values: list[float]) -> None:
    scene = Scene.from_text(text)
    swept = run(scene.with_sweep({key: values}))
    found = []
    for value in sorted(values):
        alone = run(scene.with_values({key: int(value) if key == "body.modes" else value}))
        own = swept.impact_velocity.values[swept.impact_run.values == values.index(value)]
        assert len(own)
        np.testing.assert_array_equal(own, alone.impact_velocity.values)
        found.append(float(alone.final_velocity))
    np.testing.assert_array_equal(swept.final_velocity.values, found)
    assert len(set(found)) == len(values)


def test_states_of_fewer_modes_are_filled_up_and_cut_again() -> None:
    scene = Scene.from_text(BEAM).with_sweep({"body.modes": [1, 3]})
    states = run(scene).final_state.values
    assert states.shape == (2, 6)
    np.testing.assert_array_equal(states[0] == 0.0, [False, True, True, False, True, True])
    assert without_padding(tuple(states[0]), 1) == (states[0, 0], states[0, 3])
    whole = np.arange(6.0)
    np.testing.assert_array_equal(padded_state(whole, 3), whole)


def test_a_continuation_goes_on_within_each_number_of_modes() -> None:
    axes = {
        "body.modes": [1, 3],
        "forcing.frequency": {"start": 0.5, "stop": 0.52, "points": 3, "path": "up"},
    }
    whole = run(Scene.from_text(BEAM).with_sweep(axes))
    for count in (1, 3):
        one = Scene.from_text(BEAM).with_values({"body.modes": count})
        alone = run(one.with_sweep({"forcing.frequency": axes["forcing.frequency"]}))
        own = whole.final_velocity.sel(modes=count)
        np.testing.assert_array_equal(own.values.ravel(), alone.final_velocity.values.ravel())


def test_the_step_of_an_exchange_is_swept_and_converges() -> None:
    steps = [0.2, 0.1, 0.05, 0.025]
    found = run(Scene.from_text(COUPLED).with_sweep({"execution.macro_step": steps}))
    assert found.macro_step.attrs["units"] == "s"
    ends = found["b_displacement"].values.reshape(len(steps), -1)[:, -1]
    for step, end in zip(steps, ends, strict=True):
        alone = run(Scene.from_text(COUPLED).with_values({"execution.macro_step": step}))
        assert alone["b_displacement"].values.ravel()[-1] == end
    falling = np.abs(np.diff(ends))
    assert (falling[1:] < 0.7 * falling[:-1]).all()


def test_a_replay_is_scored_at_each_number_of_modes(tmp_path: Path) -> None:
    time = 2e-5 * np.arange(1500)
    path = written(
        tmp_path / "own.nc", channel("base", time, pulse(time)), channel("board", time, pulse(time))
    )
    text = BOARD.replace("[replay]", f'[replay]\nrecordings = ["{path}"]')
    scene = Scene.from_text(text, str(tmp_path / "board.toml"))
    counts = [1, 2, 3]
    swept = run(scene.with_sweep({"body.modes": counts}))
    scores = [run(scene.with_values({"body.modes": n})).variance_accounted_for.values for n in counts]
    np.testing.assert_array_equal(swept.variance_accounted_for.values.ravel(), np.ravel(scores))
    assert (
        len(set(swept.variance_accounted_for.values.ravel())) == 2
    )  # the second mode has a node at the sensor


def test_what_components_are_made_for_is_neither_fitted_nor_changed_in_a_session() -> None:
    scene = Scene.from_text(BOARD, "board.toml")
    with pytest.raises(UsageError, match=r"change without steps, got body\.modes"):
        fit_keys(scene, "body.frequency,body.modes")
    with Session(Scene.from_text(BEAM)) as session, pytest.raises(UsageError, match=r"body\.modes"):
        session.begin({"body.modes": 2.0})


def test_a_scene_that_is_saved_has_whole_numbers_of_modes() -> None:
    text = text_with_values(BEAM, {"body.modes": 3.0, "execution.contact_tolerance": 1e-6})
    saved = Scene.from_text(text)
    assert saved.value("body.modes") == 3
    assert saved.execution.contact_tolerance == 1e-6


def test_no_state_is_carried_from_one_number_of_modes_to_another() -> None:
    axis = {"values": [1, 2], "path": "up"}
    with pytest.raises(SceneError, match='path: expected "independent" for modes'):
        Scene.from_text(BEAM).with_sweep({"body.modes": axis})
