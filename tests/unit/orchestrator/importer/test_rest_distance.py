"""Bodies of two FMUs at rest on each other: a remark reports an overlap or an opening that is more than rounding."""

from __future__ import annotations

import re

import numpy as np
import pytest

from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import parse_scene

# a ball that is put on a heavy table which moves, and stays there: its load is larger than the table's acceleration
SCENE = """[scene]
units = "nondimensional"
[component.table]
fmu = "Oscillator"
parameters = { mass = 1e6, stiffness = 1e6, displacement_start = 1.0 }
[component.ball]
fmu = "Oscillator"
parameters = { stiffness = 0.0, displacement_start = 1.0, velocity_start = -0.1, "forcing.amplitude" = -1.2 }
[[contact]]
between = ["table", "ball"]
restitution = 0.0
[record]
recorded_time = 4.0
variables = ["ball.displacement", "table.displacement"]
rate = 20
[execution]
macro_step = STEP
"""


@pytest.mark.parametrize(("macro_step", "most"), [(0.05, 1e-3), (0.005, 1e-6)])
def test_the_overlap_of_bodies_at_rest_is_said_with_its_size(macro_step: float, most: float) -> None:
    runner = GeneralRunner(parse_scene(SCENE.replace("STEP", str(macro_step)), "rest.toml"))
    record = runner.run({})
    runner.close()
    assert record.samples is not None
    distance = record.samples[:, 1] - record.samples[:, 2]
    said = re.search(r"overlap by up to (\S+) m and part by up to (\S+) m", record.message)
    assert said is not None
    overlap, opening = (float(number) for number in said.groups())
    assert 1e-9 < max(overlap, opening) < most
    assert -distance.min() <= 1.06 * overlap + 1e-12  # the remark has two digits
    assert distance.max() <= 1.06 * opening + 1e-12


def test_a_body_that_a_constant_force_holds_on_another_lies_on_it_without_a_remark() -> None:
    text = SCENE.replace("STEP", "0.05").replace("stiffness = 1e6", "stiffness = 0.0")
    runner = GeneralRunner(parse_scene(text, "rest.toml"))
    record = runner.run({})
    runner.close()
    assert record.samples is not None
    assert record.message == ""
    assert np.abs(record.samples[:, 1] - record.samples[:, 2]).max() <= 1e-9
