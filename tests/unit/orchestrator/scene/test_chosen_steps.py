"""Scenes of components whose communication steps an error estimate chooses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory

from vibroimpact.analysis import figures
from vibroimpact.fmus.errors import DatasetError, SceneError
from vibroimpact.orchestrator.campaign.manifest import scene_hash
from vibroimpact.orchestrator.importer.adaptive.record import MOST_TRACED, StepRecord
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.run.summary import engine
from vibroimpact.orchestrator.running.whole import run_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.ways.all_ways import ways_of
from vibroimpact.orchestrator.study.ways.way import own_step

TWO = """
[component.a]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.1, displacement_start = 1.0 }
[component.b]
fmu = "Oscillator"
parameters = { mass = 1.0, stiffness = 1.1 }
[[connection]]
from = "b.displacement"
to = "a.force"
gain = 0.1
gain_unit = "N/m"
[[connection]]
from = "a.displacement"
to = "b.force"
gain = 0.1
gain_unit = "N/m"
[record]
recorded_time = 1.0
variables = ["a.displacement"]
rate = 20
[execution]
macro_step = "auto"
coupling_tolerance = 1e-3
"""
ONE = '[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 1\n[execution]\nhow = "coupled"\n'


def test_the_record_of_a_run_has_its_steps() -> None:
    runner = open_runner(Scene.from_text(TWO), "auto")
    record = runner.run({})
    again = runner.run({"connection[1].gain": 0.1})
    runner.close()
    assert record.chosen_steps is not None
    steps, rejected, smallest, largest, error = record.chosen_steps
    assert steps > rejected >= 0
    assert 0.0 < smallest < largest < 1.0
    assert 0.0 < error <= 1.001e-3 * steps
    assert again.chosen_steps is not None
    np.testing.assert_array_equal(again.chosen_steps, record.chosen_steps)


def test_the_engine_says_the_tolerance() -> None:
    assert engine(Scene.from_text(TWO)).endswith("gauss_seidel exchange in steps with an error of 0.001")


def test_a_number_in_its_place_drops_the_tolerance() -> None:
    changed = Scene.from_text(TWO).with_values({"execution.macro_step": 0.1})
    assert changed.macro_step == 0.1
    assert changed.execution.coupling_tolerance is None


def test_campaigns_tell_tolerances_apart() -> None:
    scene = Scene.from_text(TWO)
    other = scene.with_values({"execution.coupling_tolerance": 1e-4})
    whole = scene.with_values({"execution.macro_step": 1.0})
    assert len({scene_hash(scene), scene_hash(other), scene_hash(whole)}) == 3


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (TWO.replace('macro_step = "auto"', "macro_step = 0.1"), 'expected macro_step = "auto" beside it'),
        (TWO.replace('"auto"', '"adaptive"'), 'execution.macro_step: expected a number > 0, or "auto"'),
        (TWO.replace("1e-3", "2"), "execution.coupling_tolerance: expected 0 < tolerance <= 1"),
        (
            TWO + '[sweep]\n"execution.macro_step" = { values = [0.1, 0.2] }\n',
            'execution.macro_step: expected a number where it is swept, got "auto"',
        ),
        (
            ONE + 'macro_step = "auto"\n',
            'execution.macro_step: expected a number in a scene of one body, got "auto"',
        ),
        (
            ONE + "coupling_tolerance = 1e-3\n",
            "execution.coupling_tolerance: expected no coupling_tolerance in a scene",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(text: str, problem: str) -> None:
    with pytest.raises(SceneError) as refused:
        Scene.from_text(text)
    assert problem in str(refused.value)


def test_a_component_with_one_step_size_is_refused_by_its_flag(tmp_path: Path) -> None:
    flag = "canHandleVariableCommunicationStepSize"
    fmu_factory.redescribed(
        fmu_factory.mass(tmp_path), tmp_path / "fixed.fmu", (f'{flag}="true"', f'{flag}="false"')
    )
    place = tmp_path / "scene.toml"
    place.write_text(
        '[component.m]\nfmu = "fixed.fmu"\n[record]\nrecorded_time = 1\n[execution]\nmacro_step = "auto"\n'
    )
    with pytest.raises(
        SceneError, match=rf'macro_step: expected a number, since m .*{flag} = false.*got "auto"'
    ):
        Scene.from_file(place)


def test_a_study_compares_chosen_steps_with_steps_of_their_mean_size() -> None:
    scene = Scene.from_text(TWO)
    ways = ways_of(scene)
    own = own_step(scene)
    assert 1e-4 < own < 0.5
    fixed = [way.setting for way in ways if way.name == "coupled, jacobi"]
    assert own in fixed
    assert {way.name for way in ways if way.knob == "coupling_tolerance"} == {
        f"chosen steps, {exchange}" for exchange in ("jacobi", "gauss_seidel", "iterated")
    }


def test_a_run_lists_its_steps_and_a_sweep_does_not(tmp_path: Path) -> None:
    opened = run_scene(Scene.from_text(TWO), tmp_path / "run.nc")
    steps = opened.vibroimpact.chosen_steps()
    assert steps.sizes["chosen_step"] == opened["coupling_steps"].item()
    assert steps["chosen_step_end"].values[-1] == 1.0
    np.testing.assert_allclose(np.diff(steps["chosen_step_end"]), steps["chosen_step_size"][1:], rtol=1e-9)
    assert float(steps["chosen_step_error"].max()) <= 1.0
    total = 1e-3 * float(steps["chosen_step_error"].sum())
    assert total == pytest.approx(opened["coupling_error"].item())
    above, below = figures.draw(opened, "steps").axes
    assert above.lines[0].get_xdata().size == steps.sizes["chosen_step"]
    assert below.lines[1].get_label() == "coupling_tolerance"
    swept = Scene.from_text(TWO + '[sweep]\n"a.stiffness" = { values = [1.0, 1.1] }\n')
    opened = run_scene(swept, tmp_path / "sweep.nc")
    assert "chosen_step_size" not in opened
    with pytest.raises(DatasetError, match=r"chosen_steps: expected them .* and no sweep in the scene"):
        figures.draw(opened, "steps", run=0)


def test_a_long_trace_leaves_every_second_step_out() -> None:
    record, count = StepRecord(), 3 * MOST_TRACED
    for step in range(count):
        record.add(step + 1.0, 1.0, 0.5, cut=False)
    traced = record.traced(0.5)
    assert MOST_TRACED // 2 <= len(traced) <= MOST_TRACED
    assert set(np.diff(traced[:, 0])) == {4.0}
    assert traced[0].tolist() == [1.0, 1.0, 1.0]
    assert record.steps == count
