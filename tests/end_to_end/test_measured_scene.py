"""A simulated dataset with a measuring chain is analysed like a recording: the estimates agree with the parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.recording import open_signals
from vibroimpact.analysis.spikes import Mechanics, spike_report
from vibroimpact.orchestrator.commands.cli import main

SCENE = """\
[body]
mass = 1.0
stiffness = 4000.0
damping = 1.0
[forcing]
amplitude = 2.0
frequency = 9.0
[sensor]
gain = 300.0
offset = 0.0
[load_cell]
sensitivity = 0.003
natural_frequency = 8000.0
damping_ratio = 0.05
contact_duration = 1e-3
[exciter]
gain = 5.0
[noise]
seed = 3
sensor = 1e-3
load_cell = 2e-3
[daq]
rate = 20e3
bits = 16
range = 5.0
[[stop]]
position = 0.01
restitution = 0.7
[record]
recorded_periods = 24
time_series = { variables = ["sensor.displacement", "load_cell", "drive"] }
"""
REPLAY = """\
[body]
mass = 1.0
stiffness = 4000.0
damping = 1.2
[sensor]
gain = 300.0
offset = 0.0
[exciter]
gain = 5.01
[[stop]]
position = 0.01
restitution = 0.7
[replay]
drive = "force"
from = "drive"
stop = 1.0
compare = [{ simulated = "sensor.displacement", measured = "sensor_displacement" }]
"""


def vibroimpact(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as left:
        main(list(map(str, arguments)))
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("measured")
    (folder / "scene.toml").write_text(SCENE)
    assert vibroimpact("run", folder / "scene.toml", "-o", folder / "run.nc") == 0
    return folder / "run.nc"


def test_impulses_of_the_load_cell_are_those_of_the_impacts_within_their_errors(measured: Path) -> None:
    truth = open_dataset(measured)
    report = spike_report(open_signals(measured).channels["load_cell"], None, Mechanics(sensitivity=0.003))
    found = report.dataset
    assert found.sizes["spike"] == truth.sizes["impact"] > 5
    error = found.spike_impulse.values - truth.impact_impulse.values
    assert (np.abs(error) < 3.0 * found.spike_impulse_error.values).all()
    assert (found.spike_impulse_error.values < 0.02 * truth.impact_impulse.values).all()


def test_restitution_damping_and_frequency_come_back_from_the_sensor(measured: Path, tmp_path: Path) -> None:
    output = tmp_path / "estimates.nc"
    command = ("estimate", "impacts", measured, "--channel", "sensor_displacement", "-o", output)
    assert vibroimpact(*command) == 0
    with xr.open_dataset(output) as found:
        weak = found.sel(estimator="weak_form")
        truth = {
            "restitution": 0.7,
            "damping_ratio": 0.5 / np.sqrt(4000.0),
            "natural_frequency": np.sqrt(4000.0),
        }
        for quantity, true in truth.items():
            row = weak.sel(quantity=quantity)
            width = float(row.interval_high - row.interval_low)
            assert float(row.interval_low) - width < true < float(row.interval_high) + width


def test_a_replay_that_is_driven_in_volts_finds_damping_and_exciter(measured: Path, tmp_path: Path) -> None:
    (tmp_path / "replay.toml").write_text(REPLAY)
    output = tmp_path / "replay.nc"
    fit = ("--fit", "body.damping,exciter.gain")
    assert vibroimpact("replay", tmp_path / "replay.toml", measured, "-o", output, *fit) == 0
    with xr.open_dataset(output) as found:
        assert float(found.variance_accounted_for.squeeze()) > 99.99
        # 4 standard errors: they include the noise of the sensor, but not the rounding of the drive to 16 bits
        off = np.abs(found.fitted_value.values - [1.0, 5.0]) / found.standard_error.values
        assert (off < 4.0).all()
        assert (found.standard_error.values < 1e-3).all()
