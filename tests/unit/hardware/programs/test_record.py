"""A recording equals the motion of the plant; a failure leaves a recording of all samples before it."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import ROOT

from vibroimpact.analysis.recording import Quality, open_recording, write_recording
from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.programs import keeping
from vibroimpact.hardware.programs.record import record
from vibroimpact.hardware.programs.recover import recover
from vibroimpact.hardware.rig import acquisition
from vibroimpact.hardware.rig import journal as journals
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.virtual_rig.control import RigControl

CALIBRATION = """
[tip]
unit = "mm"
sensitivity = 1.0        # V/mm
offset = 0.002
drift = 1e-4
how = "gauge blocks"
when = "2026-03-01"
"""


@contextmanager
def driven(rig: Rig, volts: float, frequency: float, rate: int = 10_000) -> Iterator[None]:
    """Drive the rig with whole cycles that repeat."""
    with daqmx.nidaqmx.Task(grpc_options=rig.options()) as task:
        task.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-10, max_val=10)
        task.timing.cfg_samp_clk_timing(rate, sample_mode=daqmx.constants.AcquisitionType.CONTINUOUS)
        count = round(rate / frequency)
        task.write(volts * np.sin(2.0 * np.pi * np.arange(count) / count))
        task.start()
        yield


def test_the_recorded_amplitude_is_that_of_the_plant_within_a_thousandth(
    rig: Rig, control: RigControl
) -> None:
    with driven(rig, 1.0, 10.0):
        control.advance(20.0)  # the remaining transient is below 1e-6 then
        tip = record(rig, ["tip=Dev1/ai0,2"], 5000.0, 1.0).channel("tip")
        motion = []
        for _ in range(400):
            control.advance(0.25e-3)
            motion.append(control.truth()["displacement"])
    assert np.ptp(tip.values) / 1000.0 == pytest.approx(np.ptp(motion), rel=1e-3)


def test_a_calibrated_channel_is_in_its_unit_and_its_volts_can_be_had_again(rig: Rig, tmp_path: Path) -> None:
    file = tmp_path / "tip.toml"
    file.write_text(CALIBRATION)
    with daqmx.nidaqmx.Task(grpc_options=rig.options()) as hold:
        hold.ao_channels.add_ao_voltage_chan("Dev1/ao0")
        hold.write(1.0)
    RigControl(rig.channel).advance(20.0)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0, 2.0, loopback=["back=Dev1/ai2"], calibration=[file])
    write_recording(found, tmp_path / "tip.nc")
    tip, back = (open_recording(tmp_path / "tip.nc").channel(name) for name in ("tip", "back"))
    assert (tip.unit, back.unit) == ("0.001 m", "V")
    assert back.attrs["role"] == "loopback"
    assert tip.attrs["calibration_how"] == "gauge blocks"
    volts = (
        tip.attrs["sensitivity"] * tip.values + tip.attrs["zero_offset"] + tip.attrs["zero_drift"] * tip.time
    )
    np.testing.assert_allclose(volts, 1.0, atol=1e-3)  # 0.1 N on 100 N/m, 1 V/mm
    steps = volts / (2.0 / 2**15)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)  # as output by the converter


def test_a_calibration_of_another_channel_is_refused_before_the_rig_is_opened(tmp_path: Path) -> None:
    file = tmp_path / "tip.toml"
    file.write_text(CALIBRATION)
    with pytest.raises(UsageError, match="tip: expected a channel that is measured: cell"):
        record("no rig at all", ["cell=Dev1/ai0"], 1000.0, 1.0, calibration=[file])


def test_ctrl_c_ends_a_recording_with_all_that_was_measured(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = keeping._Keeper.take

    def interrupted(self: Any, block: Any) -> None:
        take(self, block)
        if block.end > 3000:
            signal.raise_signal(signal.SIGINT)
            monkeypatch.setattr(keeping._Keeper, "take", take)

    monkeypatch.setattr(keeping._Keeper, "take", interrupted)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0)
    tip = found.channel("tip")
    assert len(tip.values) > 3000
    assert tip.good.all()
    assert found.attrs["ended"] == ""
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_device_that_is_gone_leaves_what_was_measured_and_says_so(
    rig: Rig, control: RigControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = keeping._Keeper.take

    def lost(self: Any, block: Any) -> None:
        take(self, block)
        if block.end > 2000:
            control.lose()

    monkeypatch.setattr(keeping._Keeper, "take", lost)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0, 60.0)
    assert len(found.channel("tip").values) > 2000
    assert "The device does not answer" in found.attrs["ended"]
    assert any(line.startswith("ended early: ") for line in found.remarks)


def test_a_rig_that_refuses_is_an_error_and_leaves_no_journal(rig: Rig, tmp_path: Path) -> None:
    for channel in ("tip=Dev1/ai9", "tip=Dev7/ai0", "tip=Dev1/ai0,99"):
        with pytest.raises(UsageError):
            record(rig, [channel], 1000.0, 1.0, journal=tmp_path / "a.journal")
    with daqmx.nidaqmx.Task(grpc_options=rig.options()) as other:
        other.ai_channels.add_ai_voltage_chan("Dev1/ai1")
        other.timing.cfg_samp_clk_timing(100.0, sample_mode=daqmx.constants.AcquisitionType.CONTINUOUS)
        other.start()
        with pytest.raises(RigError, match="reserved"):
            record(rig, ["tip=Dev1/ai0"], 1000.0, 1.0, journal=tmp_path / "a.journal")
    assert list(tmp_path.iterdir()) == []


def test_a_queue_that_overflows_leaves_a_gap_of_known_length(
    rig: Rig, control: RigControl, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(acquisition, "QUEUE_BLOCKS", 2)
    monkeypatch.setattr(acquisition, "LONGEST_BLOCK", 0.05)
    take, stalled = keeping._Keeper.take, threading.Event()

    def slow(self: Any, block: Any) -> None:
        while not stalled.is_set() and not self._acquired.gaps:
            control.advance(1.0)
        stalled.set()
        take(self, block)

    monkeypatch.setattr(keeping._Keeper, "take", slow)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0, 20.0, journal=tmp_path / "a.journal")
    tip, gaps = found.channel("tip"), json.loads(found.attrs["gaps"])
    missing = (tip.quality & np.uint8(Quality.missing)) > 0
    expected = np.zeros(20_000, dtype=bool)
    for gap in gaps:
        expected[gap["first"] : gap["first"] + gap["samples"]] = True
    assert len(tip.values) == 20_000
    assert tip.axis.interval == 1e-3
    np.testing.assert_array_equal(missing, expected)
    np.testing.assert_array_equal(missing, np.isnan(tip.values))
    assert "its queue is full" in found.attrs["remarks"]
    again = recover(tmp_path / "a.journal")
    np.testing.assert_array_equal(again.channel("tip").values, tip.values)
    assert again.attrs["remarks"] == found.attrs["remarks"]


def test_a_journal_that_ends_anywhere_gives_the_samples_before_its_end(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    with driven(rig, 1.0, 10.0):
        whole = record(rig, ["tip=Dev1/ai0,2", "back=Dev1/ai2"], 2000.0, 5.0, journal=path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    part = recover(path)
    for name in ("tip", "back"):
        count = len(part.channel(name).values)
        assert 1000 < count < 10_000
        np.testing.assert_array_equal(part.channel(name).values, whole.channel(name).values[:count])
    assert keeping.NO_END in part.remarks
    assert "bytes of the journal are damaged or cut off" in part.attrs["remarks"]
    assert part.attrs["recorded_at"] == whole.attrs["recorded_at"] != ""


def test_a_full_disk_ends_it_with_what_is_there(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    append = journals.Journal.append

    def full(self: Any, block: Any) -> None:
        if block.end > 3000:
            raise OSError(28, "No space left on device")
        append(self, block)

    monkeypatch.setattr(journals.Journal, "append", full)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0, 500.0, journal=tmp_path / "a.journal")
    tip = found.channel("tip")
    assert 3000 < len(tip.values) < 500_000
    assert tip.good.all()
    assert found.attrs["ended"] == "the journal cannot be written: No space left on device"


def test_a_disk_that_is_nearly_full_ends_it_while_the_recording_still_has_room(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journals.Journal, "is_short_of_room", lambda self: self.written > 50_000)
    found = record(rig, ["tip=Dev1/ai0,2"], 1000.0, 5000.0, journal=tmp_path / "a.journal")
    assert len(found.channel("tip").values) >= 5000
    assert found.attrs["ended"] == "the disk has hardly room for the recording"


def test_channels_of_a_multiplexed_device_have_axes_of_their_own() -> None:
    found = record(f"virtual:{ROOT}/examples/rig/beam.toml", ["tip=Dev1/ai0", "speed=Dev1/ai1"], 1000.0, 0.05)
    tip, speed = found.channel("tip"), found.channel("speed")
    np.testing.assert_allclose(speed.time - tip.time, 12e-6, rtol=0.01)


def test_a_loopback_without_a_drive_and_a_channel_within_its_noise_are_said(rig: Rig) -> None:
    still = record(rig, ["tip=Dev1/ai0,2"], 5000.0, 0.5, loopback=["back=Dev1/ai2"])
    assert any(line.startswith("back: the loopback shows no drive (") for line in still.remarks)
    assert any(line.startswith("tip: nothing is above its noise (") for line in still.remarks)
    with driven(rig, 1.0, 10.0):
        moving = record(rig, ["tip=Dev1/ai0,2"], 5000.0, 0.5, loopback=["back=Dev1/ai2"])
    assert not any("loopback" in line or "above its noise" in line for line in moving.remarks)
