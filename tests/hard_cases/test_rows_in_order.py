"""Rows are in the order of their beginnings, whatever ends first: contacts and rests within others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene

# Two uncoupled masses: the first is in a long contact when the second meets its stop.
TWO_MASSES = """
[scene]
units = "nondimensional"
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = [1.0, 0.0]
displacement_start = [-1.0, -0.5]
velocity_start = [1.0, 1.0]
[[stop]]
mass = 1
position = 0.0
law = "kelvin_voigt"
stiffness = 1.0
[[stop]]
mass = 2
position = 0.7
{second}
[record]
recorded_time = 5.0
[execution]
how = "{how}"
"""
SHORT_CONTACT = 'law = "kelvin_voigt"\nstiffness = 1000.0'
RIGID = "restitution = 0.5"
SWEEP = '[sweep]\n"stop[2].position" = { values = [0.6, 0.7, 5.9] }\n'


def assert_ordered(path: Path, runs: int) -> None:
    """Assert that all runs ended well, with their impacts and rests in the order of their beginning."""
    dataset = read_flat(path)
    assert dataset.sizes["run"] == runs
    assert set(dataset.outcome.values) <= {Outcome.ok, Outcome.stuck}
    assert dataset.message.values.tolist() == [""] * runs
    owner = np.repeat(np.arange(runs), dataset.impact_count.values)
    for run in range(runs):
        assert (np.diff(dataset.impact_time.values[owner == run]) >= 0.0).all()
        stick = np.repeat(np.arange(runs), dataset.stick_count.values) == run
        assert (np.diff(dataset.stick_start.values[stick]) >= 0.0).all()


@pytest.mark.parametrize("how", ["fused", "coupled"])
@pytest.mark.parametrize("second", [SHORT_CONTACT, RIGID], ids=["compliant", "rigid"])
def test_an_impact_within_a_longer_contact_comes_after_its_touch_down(
    second: str, how: str, tmp_path: Path
) -> None:
    run_scene(parse_scene(TWO_MASSES.format(second=second, how=how), "order.toml"), tmp_path / "runs.nc")
    assert_ordered(tmp_path / "runs.nc", 1)
    dataset = read_flat(tmp_path / "runs.nc")
    # touch-downs of the free flights of the two masses: at pi / 4 and at 1.2
    assert dataset.impact_contact.values[:2].tolist() == [1, 2]
    assert dataset.impact_time.values[:2] == pytest.approx([np.pi / 4.0, 1.2], abs=1e-12)


def test_a_campaign_with_impacts_within_contacts_ends_in_its_dataset(tmp_path: Path, cluster: str) -> None:
    scene = parse_scene(TWO_MASSES.format(second=RIGID, how="fused") + SWEEP, "order.toml")
    run_campaign(scene, tmp_path / "campaign", scheduler=cluster)
    assert_ordered(tmp_path / "campaign" / "dataset.nc", 3)


def test_a_rest_within_a_longer_rest_comes_after_its_beginning(tmp_path: Path) -> None:
    text = """
[scene]
units = "nondimensional"
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = [1.0, 0.0]
displacement_start = [-1.0, -0.6]
[forcing]
amplitude = [0.2, 3.0]
angular_frequency = 0.5
[[stop]]
mass = 1
position = -1.0
restitution = 0.0
[[stop]]
mass = 2
position = -0.5
restitution = 0.0
[record]
transient_periods = 0
recorded_periods = 4
"""
    run_scene(parse_scene(text, "rests.toml"), tmp_path / "runs.nc")
    dataset = read_flat(tmp_path / "runs.nc")
    assert_ordered(tmp_path / "runs.nc", 1)
    start, contact = dataset.stick_start.values, dataset.stick_contact.values
    assert contact[0] == 1
    assert np.isnan(dataset.stick_end.values[0])
    assert set(contact[1:]) == {2}
    assert (start[1:] > start[0]).all()
