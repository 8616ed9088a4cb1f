"""Damaged or inconsistent files give a recording or one clear refusal, never another error or a stray file."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import netCDF4
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from vibroimpact.analysis.recording import Recording, SingleValue, write_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.recordings import import_recording

SIGNAL = np.round(np.sin(np.arange(120) / 7.0), 4)
LABVIEW = (
    "LabVIEW Measurement,\nWriter_Version,2\nSeparator,Comma\nMulti_Headings,No\nX_Columns,One\n"
    "Date,2026/07/30\nTime,20:07:43.6224169731140136719\n***End_of_Header***,\n,\nChannels,2,,\nSamples,120,120,\n"
    "Date,2026/07/30,2026/07/30,\nTime,20:07:43.62,20:07:43.62,\nY_Unit_Label,g,g,\nX_Dimension,Time,Time,\n"
    "X0,0.0E+0,0.0E+0,\nDelta_X,0.010000,0.010000,\n***End_of_Header***,,,\nX_Value,base,board,Comment\n"
)


def text() -> bytes:
    return b"time (s);base (g)\n" + b"".join(b"%.3f;%.4f\n" % (k / 100, a) for k, a in enumerate(SIGNAL))


def labview() -> bytes:
    return (LABVIEW + "".join(f"{k / 100:.6f},{a},{-a}\n" for k, a in enumerate(SIGNAL))).encode()


def tdms() -> bytes:
    content = io.BytesIO()
    with TdmsWriter(content) as writer:
        known = {
            "wf_increment": 0.01,
            "wf_samples": 60,
            "wf_start_time": np.datetime64("2026-07-30T10:00:00"),
        }
        writer.write_segment([ChannelObject("run", "base", SIGNAL, {**known, "unit_string": "g"})])
        writer.write_segment([ChannelObject("run", "base", SIGNAL)])
    return content.getvalue()


def matlab() -> bytes:
    content = io.BytesIO()
    savemat(content, {"t": np.arange(120) / 100, "base": SIGNAL, "note": "hello"}, do_compression=False)
    return content.getvalue()


def netcdf() -> bytes:
    file = netCDF4.Dataset("memory.nc", "w", memory=1, format="NETCDF3_CLASSIC")
    file.createDimension("time", 120)
    for name, values, unit in (("time", np.arange(120) / 100, "s"), ("base", SIGNAL, "m s-2")):
        variable = file.createVariable(name, "f8", ("time",))
        variable.units = unit
        variable[:] = values
    return bytes(file.close())


MAKERS: dict[str, Callable[[], bytes]] = {
    "csv": text,
    "lvm": labview,
    "tdms": tdms,
    "mat": matlab,
    "nc": netcdf,
}
WHOLE = {ending: make() for ending, make in MAKERS.items()}
INSERTED = (
    b",",
    b"\n",
    b"1e999",
    b"nan",
    b"\xff\xfe",
    b"OVRNG",
    b"\t",
    b"-" * 40,
    b"9" * 400,
    b"#",
    b"\x00",
    b"***",
)


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, bytes]:
    """Return a file with some bytes changed, inserted or removed, or with its end cut off."""
    ending = draw(st.sampled_from(["csv", "lvm", "nc", "tdms"]))
    content = bytearray(WHOLE[ending])
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(0, len(content) - 1)))
        kind = draw(st.sampled_from(["change", "insert", "remove", "cut"]))
        if kind == "change" and content:
            content[place] = draw(st.integers(0, 255))
        elif kind == "insert":
            content[place:place] = draw(st.sampled_from(INSERTED)) * draw(st.sampled_from([1, 3, 30]))
        elif kind == "remove":
            del content[place : place + draw(st.integers(1, 300))]
        else:
            del content[place:]
    return ending, bytes(content)


def imported(path: Path) -> tuple[Recording | None, str]:
    """Return the recording or the refusal; any other error is raised."""
    try:
        return import_recording([path]), ""
    except (DatasetError, UsageError) as refusal:
        return None, str(refusal)


def import_or_refuse(ending: str, content: bytes) -> str | None:
    """Return the refusal; None if a recording was made, which is then written."""
    with TemporaryDirectory() as folder:
        path, output = Path(folder) / f"record.{ending}", Path(folder) / "record_imported.nc"
        path.write_bytes(content)
        recording, said = imported(path)
        if recording is not None:
            write_recording(recording, output)
            return None
        assert said.startswith(str(path))
        assert "Report it" not in said  # an error that no reader anticipated
        return said


@pytest.mark.parametrize("ending", sorted(WHOLE))
def test_the_whole_files_of_these_tests_are_imported(ending: str) -> None:
    assert import_or_refuse(ending, WHOLE[ending]) is None


@settings(max_examples=120)
@given(damaged())
def test_a_damaged_file_is_imported_or_refused_and_nothing_else(case: tuple[str, bytes]) -> None:
    refusal = import_or_refuse(*case)
    assert refusal is None or "expected" in refusal


@settings(max_examples=30)
@given(st.sampled_from(["csv", "lvm", "tdms", "nc"]), st.binary(max_size=400))
def test_binary_garbage_of_any_name_is_refused_or_read_as_text(ending: str, content: bytes) -> None:
    refusal = import_or_refuse(ending, content)
    assert refusal is None or "expected" in refusal


@pytest.mark.parametrize(
    ("ending", "content", "said"),
    [
        ("csv", b"", "got an empty file"),
        ("csv", b"PK\x03\x04" + b"\x00" * 50, "a spreadsheet"),
        ("txt", b"\x7fELF" + b"\x00" * 60, "other binary contents"),
        ("csv", b"time,a\n" + b"1e400,5\n" * 9, "expected numbers, got none"),
        ("csv", b"," * 5000, "expected rows of numbers"),
        ("csv", b"\n".join([b",".join([b"1"] * 3000)] * 5), "expected at most 1024 columns"),
    ],
)
def test_what_is_no_record_at_all_is_refused_with_its_kind(ending: str, content: bytes, said: str) -> None:
    refusal = import_or_refuse(ending, content)
    assert refusal is not None
    assert said in refusal


def test_a_name_that_flags_use_is_refused_by_the_writer(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_bytes(text().replace(b"base", b"base_quality"))
    recording = import_recording([path])
    assert list(recording.channels) == ["base_quality_column"]
    write_recording(recording, tmp_path / "record.nc")
    bad = {"base_quality": SingleValue(1.0)}
    with pytest.raises(DatasetError, match="does not end in _quality"):
        write_recording(type(recording)(recording.channels, {}, bad, {}), tmp_path / "other.nc")


@pytest.mark.parametrize("place", [136, 152, 176, 184, 190, 400, len(WHOLE["mat"]) - 60])
def test_a_damaged_matlab_file_cannot_take_the_program_with_it(place: int) -> None:
    """scipy's reader crashes on some of them."""
    content = bytearray(WHOLE["mat"])
    content[place] ^= 0xFF
    refusal = import_or_refuse("mat", bytes(content))
    assert refusal is None or "expected" in refusal


def test_a_file_that_kills_its_reader_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "record.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\x00" * 200)
    with pytest.raises(
        DatasetError, match=r"record\.nc: expected an HDF5 file that is whole, got one that cannot be read"
    ):
        import_recording([path])


def test_what_the_writer_refuses_is_told_with_the_file_that_was_read(tmp_path: Path) -> None:
    path = tmp_path / "record.lvm"
    unsound = LABVIEW.replace("X0,0.0E+0,0.0E+0", "X0,1e300,1e300").replace(
        "0.010000,0.010000", "1e308,1e308"
    )
    path.write_text(unsound + "".join(f"{k / 100:.6f},{a},{-a}\n" for k, a in enumerate(SIGNAL)))
    with pytest.raises(DatasetError) as refused:
        write_recording(import_recording([path]), tmp_path / "recording.nc")
    assert all(line.startswith("record.lvm: ") for line in str(refused.value).splitlines())
