"""An FMU that hangs or crashes in steps made in C: the outcome names the call, as in any other step."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support import fmu_factory

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and processes")

#: A scene without samples and events: all steps are plain.
SCENE = """
[scene]
units = "SI"
[component.body]
fmu = "Oscillator"
parameters = {{ displacement_start = 1.0 }}
[component.culprit]
fmu = "{fmu}"
parameters = {{ fault_after = 3, fault_time = 0.35, fault = "{fault}", fault_place = "{place}" }}
[[connection]]
from = "body.displacement"
to = "culprit.u"
[record]
recorded_time = 1.0
[execution]
macro_step = 0.1
guard = true
deadline = {deadline}
"""


@pytest.mark.parametrize(
    ("fault", "place", "outcome", "said"),
    [
        ("abort", "set", Outcome.crash, "culprit: fmi3SetFloat64 at time 0.1"),
        ("hang", "step", Outcome.timeout, "culprit: fmi3DoStep at time 0.60"),
    ],
)
def test_the_call_that_ends_a_point_is_named(
    tmp_path: Path, fault: str, place: str, outcome: Outcome, said: str
) -> None:
    fmu = fmu_factory.faulty(tmp_path)
    deadline = 0.4 if outcome is Outcome.timeout else 30.0
    text = SCENE.format(fmu=fmu, fault=fault, place=place, deadline=deadline)
    runner = open_scene(parse_scene(text, str(tmp_path / "scene.toml")))
    try:
        record = runner.run({})
    finally:
        runner.close()
    assert record.outcome is outcome, record.message
    assert said in record.message
