"""Recordings of laboratories, imported: the facts that were found by hand in each, and its traps.

The numbers come from the notes next to the recordings, and from plain `numpy.loadtxt` on the files.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.real_data import recording_folder

from vibroimpact.analysis.recording import Quality, Recording
from vibroimpact.hardware.recordings import ImportSettings, import_recording

GRAVITY = 9.80665


@cache
def imported(folder: str, *names: str, settings: ImportSettings | None = None) -> Recording:
    place: Path = recording_folder(folder)
    return import_recording([place / name for name in names], settings)


def counted(recording: Recording, name: str, flag: Quality) -> int:
    return int(np.sum(recording.channels[name].quality & np.uint8(flag) != 0))


@pytest.mark.parametrize(("trial", "clipped", "base_peak"), [(0, 14, 485.972074), (1, 13, 478.148382)])
def test_base_and_board_of_a_shock_have_their_own_triggers_and_the_board_is_clipped(
    trial: int, clipped: int, base_peak: float
) -> None:
    settings = ImportSettings(name=("base", "board"), unit=("g",))
    names = f"acc_base_a{trial}.txt", f"acc_pcb_a{trial}.txt"
    recording = imported("pcb_repeated_shock", *names, settings=settings)
    base, board = recording.channels["base"], recording.channels["board"]
    assert base.axis.interval == pytest.approx(20.0028e-6, rel=1e-5)
    assert board.axis.interval == pytest.approx(20e-6, rel=1e-9)
    assert base.axis.trigger != board.axis.trigger
    assert base.si().max() == pytest.approx(base_peak * GRAVITY, rel=1e-12)
    assert counted(recording, "board", Quality.clipped) == clipped
    assert counted(recording, "base", Quality.clipped) == 0
    extremes = board.values[board.quality == int(Quality.clipped)]
    np.testing.assert_allclose(np.abs(extremes), 546.5, atol=0.1)
    remarks = "\n".join(recording.remarks)
    assert "base: rests at -1.1" in remarks
    assert "the lag between their time axes is not known" in remarks


def test_the_header_of_the_second_board_gives_the_interval_that_its_instants_are_too_short_for() -> None:
    recording = imported("pcb_repeated_shock", "dataset2_Test_001.lvm")
    base, board = recording.channels["acceleration_0"], recording.channels["acceleration_1"]
    assert base.axis.interval == board.axis.interval == 1.953125e-5
    assert base.axis.rate == 51200.0
    assert len(base.values) == len(board.values) == 51200
    assert (base.unit, board.unit) == ("m s-2", "m s-2")
    assert base.values.max() / GRAVITY == pytest.approx(4008.0, abs=1.0)
    assert board.values.min() / GRAVITY == pytest.approx(-12444.0, abs=1.0)
    assert base.time[np.argmax(base.values)] == pytest.approx(0.0925, abs=5e-4)
    short = [recording.channels[name] for name in ("untitled", "untitled_1", "untitled_2", "untitled_3")]
    assert [len(channel.values) for channel in short] == [5, 5, 5, 5]
    assert short[0].axis.time[0] == pytest.approx(1.076191, abs=1e-6)
    assert "rounded to 1e-06 s" in "\n".join(recording.remarks)


@pytest.mark.parametrize(
    ("number", "scalar", "rest", "base_range"),
    [("00", 0.294531, 8.4, 20.0), ("05", 0.295134, -1783.0, 5742.0)],
)
def test_the_file_without_a_header_has_two_channels_and_a_number_in_its_first_row(
    number: str, scalar: float, rest: float, base_range: float
) -> None:
    settings = ImportSettings(name=("base", "board"), unit=("g", "g", "1"))
    recording = imported("smd_repeated_5kg", f"board3.4_{number}.lvm", settings=settings)
    base = recording.channels["base"]
    assert base.axis.rate == pytest.approx(200e3, rel=1e-9)
    assert len(base.values) == len(recording.channels["board"].values) == 20_000
    assert recording.scalars["column_4"].value == scalar
    assert np.median(base.values) == pytest.approx(rest, abs=0.5)
    assert np.ptp(base.values) == pytest.approx(base_range, rel=0.05)
    assert "base: rests at" in "\n".join(recording.remarks)


@pytest.mark.parametrize("impact", ["0.0", "0.3"])
def test_the_shaker_s_conflicting_clocks_are_told_with_their_uncertainty(impact: str) -> None:
    recording = imported("shaker_vibration_plus_shock", f"amp7_impact{impact}_vib0.5.lvm")
    command, base = recording.channels["excitation_vibration"], recording.channels["accelerometer_base"]
    assert (len(command.values), len(base.values)) == (13216, 12375)
    assert {channel.axis.trigger for channel in recording.channels.values()} == {command.axis.trigger}
    for channel in recording.channels.values():
        assert channel.axis.interval == pytest.approx(0.000605, rel=1e-6)
        assert channel.axis.interval_uncertainty == pytest.approx(0.033, abs=5e-4)
        assert not channel.quality.any()
        assert channel.unit == "1"
    remarks = "\n".join(recording.remarks)
    assert "0.000586, 0.000606 s an interval in the header, 0.000605 s in the column of instants" in remarks
    assert "uncertain by 3.3%" in remarks
    assert "unit s, which is that of time: not believed" in remarks
    # the command is a sine of 5 Hz, up to the difference of its clocks
    spectrum = np.abs(np.fft.rfft(command.values * np.hanning(len(command.values))))
    frequency = np.argmax(spectrum[1:]) + 1
    assert frequency * command.axis.rate / len(command.values) == pytest.approx(5.0, abs=0.165)


def test_the_spikes_of_two_neurons_are_event_trains() -> None:
    recording = imported("retina_spikes", "08_spikes-1.mat", settings=ImportSettings(window=(0.0, 30.0)))
    low, high = recording.events["spikeslow"], recording.events["spikeshigh"]
    assert (len(low.times), len(high.times)) == (750, 969)
    assert (low.window, low.resolution) == ((0.0, 30.0), 0.0)
    for train, variation in ((low, 0.9642), (high, 2.0218)):
        intervals = np.diff(train.times)
        assert intervals.std(ddof=1) / intervals.mean() == pytest.approx(variation, abs=2e-3)


def test_the_third_neuron_was_written_to_a_millisecond() -> None:
    recording = imported("retina_spikes", "08_spikes-2.mat", settings=ImportSettings(window=(0.0, 30.0)))
    train = recording.event_train()
    assert len(train.times) / 30.0 == pytest.approx(23.3, abs=0.05)
    assert train.resolution == 1e-3


def test_the_bounces_lie_on_the_grid_of_a_beat_tracker() -> None:
    recording = imported("ttd_bounces", "ttd-world-record_beats.csv")
    train = recording.event_train()
    assert len(train.times) == 49_923
    assert train.resolution == pytest.approx(1024 / 44100, rel=1e-3)
    assert len(np.unique(np.rint(np.diff(train.times) * 1000.0))) == 24
    assert "24 distinct intervals" in "\n".join(recording.remarks)
    span = float(train.times[-1] - train.times[0])
    assert 60.0 * (len(train.times) - 1) / span == pytest.approx(156.49, abs=0.005)


def test_the_pendulum_keeps_its_uneven_instants() -> None:
    recording = imported("damped_pendulum", "pendolo_smorzato.txt")
    channel = recording.channel()
    time, position = np.loadtxt(recording_folder("damped_pendulum") / "pendolo_smorzato.txt").T
    np.testing.assert_array_equal(channel.time, time)
    np.testing.assert_array_equal(channel.values, position)
    assert (channel.name, channel.unit, channel.axis.interval) == ("pos", "1", None)
    assert channel.axis.rate == pytest.approx(20.0, rel=0.01)
    assert "not evenly spaced (0.05 to 0.052 s apart)" in "\n".join(recording.remarks)


def test_seven_channels_of_scaled_integers_come_from_their_waveform_increment() -> None:
    recording = imported("tdms", "raw1.tdms")
    assert len(recording.channels) == 7
    for channel in recording.channels.values():
        assert len(channel.values) == 2000
        assert channel.axis.rate == pytest.approx(50e3, rel=1e-9)
        assert channel.unit == "V"
    assert recording.attrs["source_date"].startswith("2016-12-15T22:35:21")
    assert "wf_samples is the size of a block" in "\n".join(recording.remarks)


def test_a_start_in_1904_is_relative_time() -> None:
    recording = imported("tdms", "big_endian.tdms")
    assert [len(channel.values) for channel in recording.channels.values()] == [3500, 3500]
    assert all(channel.axis.rate == 1000.0 for channel in recording.channels.values())
    assert "source_date" not in recording.attrs
    assert "time is relative" in "\n".join(recording.remarks)
    assert recording.channels["phase_sweep"].values.max() == pytest.approx(1.0, abs=1e-6)
