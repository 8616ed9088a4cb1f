"""A program of NI's client sweeps the virtual rig up and down, and measures the motion of the scene."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from support.places import ROOT

from vibroimpact.hardware.daqmx import constants, nidaqmx, open_channel
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.plant import Floats
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig
from vibroimpact.simulation import run

RATE, STEP = 2000, 8
"""Samples per second, and seconds of a step; the last two seconds are measured."""
VOLTS = 1.5
UP = np.arange(6.0, 7.8, 0.25)
Ranges = tuple[Floats, Floats]


@pytest.fixture(scope="module")
def ranges() -> Ranges:
    """Return the displacement range (m) of each step up, and of the same steps down."""
    frequencies = np.repeat([*UP, *UP[::-1]], RATE * STEP)
    wave = VOLTS * np.sin(2.0 * np.pi * np.cumsum(frequencies) / RATE)
    wave = np.append(wave, np.zeros(2 * RATE))
    read = []
    settings = read_rig(ROOT / "examples" / "rig" / "oscillator.toml")
    with served(settings) as server, open_channel(server.address) as channel:
        RigControl(channel).pace(lockstep=True)
        options = nidaqmx.GrpcSessionOptions(channel, "")
        with nidaqmx.Task(grpc_options=options) as drive, nidaqmx.Task(grpc_options=options) as task:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-10, max_val=10)
            endless = constants.AcquisitionType.CONTINUOUS
            drive.timing.cfg_samp_clk_timing(RATE, sample_mode=endless)
            task.timing.cfg_samp_clk_timing(RATE, source="/Dev1/ao/SampleClock", sample_mode=endless)
            drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
            drive.out_stream.output_buf_size = 2 * RATE
            drive.write(wave[: 2 * RATE])
            task.start()
            drive.start()
            for begin in range(2 * RATE, len(wave), RATE):
                read.append(task.read(RATE))
                drive.write(wave[begin : begin + RATE])
    steps = np.reshape(read, (2 * len(UP), STEP * RATE))[:, -2 * RATE :]
    measured = np.ptp(steps, axis=1) / 1000.0
    return measured[: len(UP)], measured[: len(UP) - 1 : -1]


def test_two_motions_lie_side_by_side_between_the_jumps(ranges: Ranges) -> None:
    up, down = ranges
    side_by_side = up > 1.2 * down
    assert UP[side_by_side].tolist() == [6.5, 6.75, 7.0, 7.25]
    np.testing.assert_allclose(up[~side_by_side], down[~side_by_side], rtol=2e-3)


def test_the_measured_range_is_that_of_the_simulated_scene(ranges: Ranges) -> None:
    plant = tomllib.loads((ROOT / "examples" / "rig" / "oscillator_scene.toml").read_text(encoding="utf-8"))
    forcing = {"amplitude": VOLTS, "frequency": float(UP[0])}
    record = {"transient_periods": 100, "recorded_periods": 12}
    found = run(plant | {"forcing": forcing, "record": record}, progress=False)
    assert ranges[0][0] == pytest.approx(found.displacement_range.item(), rel=1e-3)
