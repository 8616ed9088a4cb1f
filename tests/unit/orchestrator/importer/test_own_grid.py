"""Components with one step size where others cut the steps: on a grid of their own, with held outputs.

Their FMU makes every step as long as its first, without a word: any other step gives wrong values.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support import fmu_factory
from support.coupled_parts import link, part, values
from support.fmu_factory import redescribed

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.own_grid import Divisions
from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import parse_scene

ANY_SIZE = 'canHandleVariableCommunicationStepSize="true"'
ONE_SIZE = (ANY_SIZE, ANY_SIZE.replace("true", "false"))
FLAG = "(canHandleVariableCommunicationStepSize = false)"
SCENE = """
[component.m]
fmu = "{fmu}"
parameters = {{ v = 1.0, k = 4.0{more} }}
{parts}
[record]
{record}
variables = ["m.x", "m.v"]
[execution]
macro_step = {macro_step}
"""
BALL = '[component.ball]\nfmu = "SteppedBall.fmi3.fmu"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("grids")
    fmu_factory.faulty(folder)
    fmu_factory.stepped_ball(folder)
    for fmi in ("2.0", "3.0"):
        redescribed(fmu_factory.mass(folder, fmi), folder / f"OneSize{fmi[0]}.fmu", ONE_SIZE)
    redescribed(fmu_factory.mass(folder, "2.0", states=False), folder / "Stateless.fmu", ONE_SIZE)
    internal = (f"{ANY_SIZE}", f'{ONE_SIZE[1]} fixedInternalStepSize="4e-3"')
    redescribed(folder / "Mass.fmi3.fmu", folder / "Internal.fmu", internal)
    redescribed(
        folder / "Mass.fmi3.fmu", folder / "Grid.fmu", (ANY_SIZE, f'{ANY_SIZE} fixedInternalStepSize="3e-3"')
    )
    return folder


def run(
    folder: Path, fmu: str, record: str, macro_step: float = 0.01, parts: str = "", more: str = ""
) -> RunRecord:
    text = SCENE.format(fmu=fmu, record=record, macro_step=macro_step, parts=parts, more=more)
    runner = GeneralRunner(parse_scene(text, str(folder / "scene.toml")))
    try:
        found = runner.run({})
    finally:
        runner.close()
    assert found.outcome is Outcome.ok, found.message
    return found


def moved(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([0.5 * np.sin(2.0 * time), np.cos(2.0 * time)])


@pytest.mark.parametrize("fmu", ["OneSize2.fmu", "OneSize3.fmu", "Stateless.fmu"])
def test_outputs_are_held_between_the_steps_of_a_component_that_events_would_cut(
    folder: Path, fmu: str
) -> None:
    record = run(folder, fmu, "recorded_time = 0.7\nrate = 1000", parts=BALL, more=", scheme = 5.0")
    assert record.events is not None
    assert len(record.events) >= 1  # the ball cuts steps
    assert record.samples is not None
    time = record.samples[:, 0]
    reached = 0.01 * np.floor(time / 0.01 + 1e-9)
    np.testing.assert_allclose(record.samples[:, 1:], moved(reached), atol=1e-12)
    assert f"m takes steps of 0.01 s alone {FLAG} and was stepped on this grid" in record.message


def test_a_time_of_the_record_between_its_steps_cuts_none(folder: Path) -> None:
    text = "transient_time = 0.123\nrecorded_time = 0.2\nrate = 1000"
    record = run(folder, "OneSize2.fmu", text, more=", scheme = 5.0")
    assert record.samples is not None
    time = record.samples[:, 0]
    assert time[0] == 0.123
    np.testing.assert_allclose(record.samples[:, 1:], moved(0.01 * np.floor(time / 0.01 + 1e-9)), atol=1e-12)


@pytest.mark.parametrize("fmu", ["OneSize2.fmu", "Stateless.fmu"])
def test_samples_between_steps_that_nothing_cuts_are_interpolated(folder: Path, fmu: str) -> None:
    record = run(folder, fmu, "recorded_time = 0.3\nrate = 300", 0.001, more=", scheme = 5.0")
    assert record.samples is not None
    np.testing.assert_allclose(record.samples[:, 1:], moved(record.samples[:, 0]), atol=1e-6)
    assert record.message == f"samples of m between its steps of 0.001 s are interpolated {FLAG}"


def test_its_step_is_a_multiple_of_its_solvers(folder: Path) -> None:
    record = run(folder, "Internal.fmu", "recorded_time = 0.4\nrate = 1000", more=", scheme = 5.0")
    assert record.samples is not None
    reached = 0.008 * np.floor(record.samples[:, 0] / 0.008 + 1e-9)
    np.testing.assert_allclose(record.samples[:, 1:], moved(reached), atol=1e-12)
    assert "m takes steps of 0.008 s alone" in record.message


def test_a_solver_with_fixed_steps_says_that_it_is_behind(folder: Path) -> None:
    record = run(folder, "Grid.fmu", "recorded_time = 0.3\nrate = 1000", 0.006)
    expected = (
        "m has the values of the last multiple of 0.003 s (fixedInternalStepSize) between these multiples"
    )
    assert record.message == expected
    assert run(folder, "Grid.fmu", "recorded_time = 0.3\nrate = 333.3333333333333", 0.006).message == ""
    assert run(folder, "Grid.fmu", "recorded_time = 0.3\nrate = 333.3333333333333", 0.005).message == expected


@pytest.mark.parametrize("exchange", ["gauss_seidel", "jacobi", "iterated"])
def test_its_inputs_are_those_at_the_start_of_its_steps(folder: Path, exchange: Exchange) -> None:
    # y = t cuts nothing itself, but handles events; a free mass of 1 kg under the force y
    parts = [part("m", folder / "OneSize3.fmu", k=0.0, scheme=5.0), part("y", folder / "Faulty.fmi3.fmu")]
    ball = part("ball", folder / "SteppedBall.fmi3.fmu")
    importer = Importer([*parts, ball], [link("y.y", "m.f")], exchange=exchange, macro_step=0.1)
    importer.begin()
    importer.advance(1.0)
    velocity = values(importer, "m", "v")
    importer.free()
    assert velocity[0] == pytest.approx(sum(0.1 * 0.1 * k for k in range(10)), abs=1e-12)


def test_an_impact_of_ours_is_exact_beside_it(folder: Path) -> None:
    # it follows our body, which impacts a rigid stop inside its own FMU
    contact = {"contact[1].law": "restitution", "contact[1].position": 0.1, "contact[1].restitution": 0.8}
    ours = part("body", fmu_path("Oscillator"), velocity_start=1.0, **contact)  # type: ignore[arg-type]
    mass = part("m", folder / "OneSize2.fmu", v=1.0, k=4.0, scheme=5.0)
    ends = []
    for others, macro_step in (([], 0.01), ([mass], 0.01)):
        importer = Importer([ours, *others], macro_step=macro_step)
        importer.begin()
        importer.advance(0.7)
        ends.append(values(importer, "body", "displacement", "velocity"))
        if others:
            moving = values(importer, "m", "x", "v")
        importer.free()
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-12)
    np.testing.assert_allclose(moving, moved(np.array([0.7]))[0], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    macro_step=st.floats(0.003, 0.3),
    ends=st.lists(st.floats(0.01, 1.0), min_size=1, max_size=4).map(sorted),
    internal=st.booleans(),
    ball=st.booleans(),
)
def test_it_is_at_a_point_of_its_grid_wherever_others_stop(
    folder: Path, macro_step: float, ends: list[float], internal: bool, ball: bool
) -> None:
    fmu = folder / ("Internal.fmu" if internal else "OneSize3.fmu")
    parts = [part("m", fmu, v=1.0, k=4.0, scheme=5.0)]
    parts += [part("ball", folder / "SteppedBall.fmi3.fmu")] if ball else []
    divisions = Divisions((macro_step,), tuple(ends))
    importer = Importer(parts, macro_step=macro_step, divisions=divisions)
    importer.begin()
    for end in ends:
        importer.advance(end)
    found = values(importer, "m", "x", "v")
    step, time = importer.components["m"].instance.only_step, importer.components["m"].instance.time
    importer.free()
    assert time <= ends[-1] + 1e-12
    assert time > ends[-1] - step * (1.0 + 1e-9)
    np.testing.assert_allclose(found, moved(np.array([time]))[0], atol=1e-11)
