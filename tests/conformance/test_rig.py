"""The rig of `make conformance` opens, and each input has the volts that NI's tests expect."""

from __future__ import annotations

from pathlib import Path

import pytest

from conformance.__main__ import rig_in
from vibroimpact.hardware.daqmx import nidaqmx, open_channel
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig


def test_each_input_has_its_number_in_volts(tmp_path: Path) -> None:
    with (
        served(read_rig(rig_in(tmp_path))) as server,
        open_channel(server.address) as channel,
        nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, "")) as task,
    ):
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:7", min_val=-10.0, max_val=10.0)
        assert task.read() == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], abs=1e-3)
