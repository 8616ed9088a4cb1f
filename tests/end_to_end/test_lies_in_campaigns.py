"""Campaigns of FMUs that lie or break in some points, with fixed and with chosen steps; interruption and resumption."""

from __future__ import annotations

import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.campaign_process import CampaignProcess
from support.campaign_scenes import assert_same_rows
from support.command_line import vibroimpact
from support.serial_pool import campaign_here

from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and processes")

SCENE = """
[component.culprit]
fmu = "{fmu}"
parameters = {{ fault_time = 0.35 }}
[component.body]
fmu = "Oscillator"
parameters = {{ mass = 1.0, stiffness = 1.1, displacement_start = 1.0 }}
[[connection]]
from = "body.displacement"
to = "culprit.u"
[[connection]]
from = "culprit.y"
to = "body.force"
gain = 0.1
[record]
recorded_time = 1.0
variables = ["body.displacement", "culprit.y"]
rate = 10
[execution]
macro_step = {macro_step}
guard = {guard}
[sweep]
{sweep}
"""
#: Numbers of faults, in Faulty's description: none, error, discard, segfault, not a number.
FAULTS = (0, 1, 3, 7, 10)
#: Calls with the fault: a step, restoring a state.
PLACES = (0, 9)
STEPS = {"fixed": "0.05", "chosen": '"auto"\ncoupling_tolerance = 1e-3'}


@pytest.mark.parametrize(
    ("steps", "fmi"),
    [
        ("chosen", "3.0"),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (("fixed", "3.0"), ("fixed", "2.0"), ("chosen", "2.0"))
        ),
    ],
)
def test_innocent_points_have_their_values_and_lies_a_reason(
    tmp_path: Path, cluster: str, steps: str, fmi: str
) -> None:
    fmu = fmu_factory.faulty(tmp_path, fmi)
    axes = {"culprit.fault": list(map(float, FAULTS)), "culprit.fault_place": list(map(float, PLACES))}
    sweep = "\n".join(f'"{key}" = {{ values = {values} }}' for key, values in axes.items())
    text = SCENE.format(fmu=fmu, macro_step=STEPS[steps], guard="true", sweep=sweep)
    scene = tmp_path / "scene.toml"
    scene.write_text(text)
    done = vibroimpact("campaign", scene, "-o", tmp_path / "out", "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    rows = read_flat(tmp_path / "out" / "dataset.nc")
    assert rows.sizes["run"] == len(FAULTS) * len(PLACES)
    samples = np.split(rows["body_displacement"].values, np.cumsum(rows["sample_count"].values)[:-1])
    innocent = np.flatnonzero(rows["fault"].values == 0)
    expected = samples[innocent[0]].tobytes()
    failed = set()
    for run, outcome in enumerate(rows["outcome"].values):
        if outcome == Outcome.ok:
            assert samples[run].tobytes() == expected
        else:
            assert re.match(
                r"(culprit|body)[.:]", str(rows["message"].values[run])
            )  # the body may refuse NaN
            failed.add((int(rows["fault"].values[run]), int(rows["fault_place"].values[run])))
    assert {(1, 0), (3, 0), (7, 0), (10, 0)} <= failed
    assert all(fault for fault, _ in failed)
    # fixed steps with samples at their ends go back to no state
    assert ((1, 9) in failed) is (steps == "chosen")


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a scene with chosen steps, and the dataset of its uninterrupted campaign."""
    folder = tmp_path_factory.mktemp("chosen")
    fmu = fmu_factory.faulty(folder, "3.0")
    sweep = '"body.stiffness" = { start = 1.0, stop = 9.0, points = 120 }'
    text = SCENE.format(fmu=fmu, macro_step=STEPS["chosen"], guard="false", sweep=sweep)
    scene = folder / "scene.toml"
    scene.write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        return scene, campaign_here(patch, text, folder / "whole", runner=DEFAULT_RUNNER).dataset


@pytest.mark.parametrize(
    "how", ["kill -9", *(pytest.param(how, marks=pytest.mark.long) for how in ("Ctrl-C", "worker"))]
)
def test_an_interrupted_campaign_with_chosen_steps_resumes_with_the_same_bits(
    swept: tuple[Path, Path], tmp_path: Path, how: str
) -> None:
    scene, expected = swept
    folder = tmp_path / "campaign"
    campaign = CampaignProcess(scene, folder, "--workers", "2", runner="UnhurriedRunner")
    campaign.wait_for_parts(2)
    if how == "worker":
        campaign.workers()[0].send_signal(signal.SIGKILL)
    elif how == "kill -9":
        campaign.process.kill()
    else:
        os.killpg(campaign.process.pid, signal.SIGINT)
    code, _, said = campaign.end()
    campaign.assert_nothing_lives()
    if how != "worker":
        assert code == (130 if how == "Ctrl-C" else -signal.SIGKILL), said
        assert not (folder / "dataset.nc").exists()
        code, _, said = CampaignProcess(scene, folder, "--workers", "1", runner="UnhurriedRunner").end()
    assert code == 0, said
    assert_same_rows(folder / "dataset.nc", expected)
