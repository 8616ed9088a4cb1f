"""WAV files, written here with scipy, the standard library and by hand."""

from __future__ import annotations

import struct
import wave
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import wavfile

from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.recordings import ImportSettings, import_recording

RATE = 5120
SIGNAL = 0.5 * np.sin(np.arange(300) / 9.0)
FULL_SCALE = "the samples are parts of full scale, which is 1 (scale, unit)"


def by_scipy(folder: Path, samples: Any) -> Path:
    path = folder / "record.wav"
    wavfile.write(path, RATE, samples)
    return path


def of_24_bits(folder: Path, *channels: Any) -> Path:
    path = folder / "record.wav"
    whole = np.stack([np.rint(one * 2**23).astype("<i4") for one in channels], axis=1)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(len(channels))
        file.setsampwidth(3)
        file.setframerate(RATE)
        file.writeframes(b"".join(int(one).to_bytes(3, "little", signed=True) for one in whole.ravel()))
    return path


@pytest.mark.parametrize(("kind", "scale"), [("int16", 2**15), ("int32", 2**31)])
def test_whole_numbers_are_parts_of_full_scale(tmp_path: Path, kind: str, scale: float) -> None:
    path = by_scipy(tmp_path, np.rint(SIGNAL * scale).astype(kind))
    recording = import_recording([path])
    channel = recording.channels["channel_1"]
    np.testing.assert_allclose(channel.values, SIGNAL, rtol=0.0, atol=0.51 / scale)
    assert channel.axis.rate == pytest.approx(RATE, rel=1e-12)
    assert FULL_SCALE in recording.remarks


def test_24_bits_of_two_channels_are_read_to_the_last_bit(tmp_path: Path) -> None:
    recording = import_recording([of_24_bits(tmp_path, SIGNAL, -SIGNAL)])
    np.testing.assert_allclose(recording.channels["channel_2"].values, -SIGNAL, rtol=0.0, atol=0.51 / 2**23)
    assert recording.attrs["source_format"] == "WAV, 24 bit"


def test_a_signalling_nan_is_a_missing_value_without_a_warning(tmp_path: Path) -> None:
    samples = np.float32(SIGNAL)
    samples.view(np.uint32)[5] = 0x7F800001
    values = import_recording([by_scipy(tmp_path, samples)]).channels["channel_1"].values
    assert np.flatnonzero(np.isnan(values)).tolist() == [5]


def test_floats_keep_their_values(tmp_path: Path) -> None:
    recording = import_recording([by_scipy(tmp_path, np.float32(SIGNAL * 20.0))])
    np.testing.assert_array_equal(recording.channels["channel_1"].values, np.float32(SIGNAL * 20.0))
    assert FULL_SCALE not in recording.remarks


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_one_sample_at_the_end_of_the_range_is_clipped(tmp_path: Path, bits: int) -> None:
    driven = SIGNAL.copy()
    driven[40], driven[90] = 1.0 - 2.0 ** (1 - bits), -1.0
    if bits == 24:
        path = of_24_bits(tmp_path, driven)
    elif bits == 8:
        path = by_scipy(tmp_path, np.rint(driven * 128 + 128).astype(np.uint8))
    else:
        path = by_scipy(tmp_path, np.rint(driven * 2.0 ** (bits - 1)).astype(f"int{bits}"))
    channel = import_recording([path]).channels["channel_1"]
    assert np.flatnonzero(channel.quality & Quality.clipped).tolist() == [40, 90]


def test_scale_and_unit_make_a_measurement_of_it(tmp_path: Path) -> None:
    path = by_scipy(tmp_path, np.int16(SIGNAL * 2**15))
    recording = import_recording([path], ImportSettings(scale=(200.0,), unit=("g",), name=("base",)))
    assert recording.channels["base"].unit == "9.80665 m s-2"
    assert np.abs(recording.channels["base"].values).max() == pytest.approx(100.0, rel=1e-3)


@pytest.mark.parametrize("bits", [16, 24])
def test_a_file_cut_off_at_any_byte_is_read_and_said(tmp_path: Path, bits: int) -> None:
    samples = np.stack([SIGNAL, -SIGNAL], axis=1)
    path = (
        of_24_bits(tmp_path, SIGNAL, -SIGNAL) if bits == 24 else by_scipy(tmp_path, np.int16(samples * 2**15))
    )
    content = path.read_bytes()
    for cut in range(1, 14):
        path.write_bytes(content[:-cut])
        recording = import_recording([path])
        assert recording.remarks[0].startswith("the file is cut off")
        frame = 2 * bits // 8
        assert len(recording.channels["channel_2"].values) == 300 - -(-cut // frame)
        np.testing.assert_allclose(
            recording.channels["channel_2"].values[-1], -SIGNAL[299 - -(-cut // frame)], atol=2.0**-14
        )


def test_compressed_samples_and_no_samples_are_refused_in_one_line(tmp_path: Path) -> None:
    path = by_scipy(tmp_path, np.int16(SIGNAL * 2**15))
    content = bytearray(path.read_bytes())
    struct.pack_into("<H", content, 20, 7)  # mu-law
    path.write_bytes(content)
    with pytest.raises(DatasetError, match="plain samples, got one that cannot be read") as refused:
        import_recording([path])
    assert "\n" not in str(refused.value)
    empty = by_scipy(tmp_path, np.empty(0, np.int16))
    with pytest.raises(DatasetError, match="expected samples of 1 to 1024 channels"):
        import_recording([empty])


def test_a_file_that_promises_4_gigabytes_is_cut_off(tmp_path: Path) -> None:
    path = by_scipy(tmp_path, np.int16(SIGNAL * 2**15))
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, 40, 0xFFFFFFF0)
    path.write_bytes(content)
    recording = import_recording([path])
    assert len(recording.channels["channel_1"].values) == 300
    assert recording.remarks[0].startswith("the file is cut off")


def test_a_file_of_a_million_empty_parts_is_refused_at_once(tmp_path: Path) -> None:
    path = by_scipy(tmp_path, np.int16(SIGNAL * 2**15))
    path.write_bytes(path.read_bytes() + b"junk\x00\x00\x00\x00" * 1_000_000)
    with pytest.raises(DatasetError, match="at most 10000 parts"):
        import_recording([path])
