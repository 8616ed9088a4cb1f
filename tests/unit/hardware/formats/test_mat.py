"""MATLAB and NetCDF files, written here with scipy and netCDF4."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
from scipy.io import savemat

from vibroimpact.analysis.recording import Quality, open_recording, write_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.formats.mat import read_mat
from vibroimpact.hardware.recordings import ImportSettings, import_recording

RANDOM = np.random.default_rng(8)


def matlab(folder: Path, **variables: Any) -> Path:
    path = folder / "record.mat"
    savemat(path, variables)
    return path


def test_a_vector_of_instants_makes_the_others_channels(tmp_path: Path) -> None:
    time = np.arange(50) * 0.02 + 3.0
    path = matlab(tmp_path, t=time, base=np.sin(time), pair=np.stack([time, -time], axis=1), gain=4.0)
    recording = import_recording([path])
    assert list(recording.channels) == ["base", "pair_1", "pair_2"]
    assert recording.scalars["gain"].value == 4.0
    np.testing.assert_allclose(recording.channels["pair_2"].axis.time, time, rtol=1e-12)


@pytest.mark.parametrize("variable", [{"fs": 500.0}, {"dt": 0.002}])
def test_a_sampling_rate_in_the_file_is_used(tmp_path: Path, variable: dict[str, float]) -> None:
    recording = import_recording([matlab(tmp_path, base=RANDOM.normal(size=40), **variable)])
    assert recording.channels["base"].axis.rate == pytest.approx(500.0)
    assert not recording.scalars


def test_vectors_that_ascend_unevenly_are_events(tmp_path: Path) -> None:
    low, high = np.cumsum(RANDOM.exponential(size=40)), np.cumsum(RANDOM.exponential(size=60))
    recording = import_recording([matlab(tmp_path, low=low, high=high)])
    np.testing.assert_array_equal(recording.events["high"].times, high)
    assert len(recording.events["low"].times) == 40


def fields(count: int) -> dict[str, np.ndarray]:
    return {f"f{number}": np.arange(3.0) for number in range(count)}


@pytest.mark.parametrize("is_compressed", [False, True])
@pytest.mark.parametrize(
    "place",
    [
        lambda within: {"s": within},
        lambda within: {"s": {"a": {"b": within}}},
        lambda within: {"c": np.array([1.0, within, "x"], dtype=object)},
    ],
    ids=["a variable", "in structures", "in a cell"],
)
def test_a_structure_of_very_many_fields_is_refused_before_scipy_compares_their_names(
    place: Callable[[Any], dict[str, Any]],
    is_compressed: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "record.mat"
    savemat(path, {"t": np.arange(9.0)} | place(fields(10_001)), do_compression=is_compressed)
    monkeypatch.setattr("scipy.io.whosmat", None)
    with pytest.raises(DatasetError, match="expected at most 10000 fields of a structure, got 10001"):
        read_mat(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_fields_are_counted_in_files_of_both_byte_orders_and_damage_is_left_to_scipy(
    order: str, tmp_path: Path
) -> None:
    path = tmp_path / "record.mat"
    savemat(path, {"s": fields(3)})
    content = bytearray(path.read_bytes())
    many = struct.pack(f"{order}II", 14, 48) + struct.pack(f"{order}IIII", 6, 8, 2, 0)
    many += struct.pack(f"{order}HHI", *((4, 5) if order == ">" else (5, 4)), 1)  # small: dimensions
    many += struct.pack(f"{order}II", 1, 0) + struct.pack(
        f"{order}HHI", *((4, 5) if order == ">" else (5, 4)), 1
    )
    many += struct.pack(f"{order}II", 1, 10_001)
    path.write_bytes(bytes(content[:126]) + (b"MI" if order == ">" else b"IM") + many)
    with pytest.raises(DatasetError, match="got 10001"):
        read_mat(path)
    for cut in range(0, len(content), 7):
        path.write_bytes(content[:cut])
        with suppress(DatasetError):
            read_mat(path)


def test_what_is_no_vector_of_numbers_is_left_out_and_told(tmp_path: Path) -> None:
    many = np.array([(1.0,), (2.0,)], dtype=[("a", object)])
    path = matlab(
        tmp_path, base=RANDOM.normal(size=40), fs=10.0, note="hello", box=many, cube=np.zeros((3, 3, 3))
    )
    told = "\n".join(import_recording([path]).remarks)
    assert all(f"{name}: " in told for name in ("note", "box", "cube"))


def test_fields_of_structures_are_channels_by_dotted_names(tmp_path: Path) -> None:
    time = np.arange(40) * 0.25
    run = {"t": time, "acc": np.sin(time), "gauge": {"force": np.cos(time), "name": "load cell"}}
    recording = import_recording([matlab(tmp_path, run=run, rest={"acc": np.sin(time), "fs": 8.0})])
    assert [channel.label for channel in recording.channels.values()] == [
        "run.acc",
        "run.gauge.force",
        "rest.acc",
    ]
    np.testing.assert_allclose(recording.channels["run_gauge_force"].axis.time, time, rtol=1e-12)
    assert recording.channels["rest_acc"].axis.rate == pytest.approx(8.0)
    assert "run.gauge.name: holds no real numbers and is left out" in recording.remarks


def test_a_file_of_which_all_is_left_out_is_refused_with_what_that_was(tmp_path: Path) -> None:
    path = matlab(tmp_path, note="hello", runs=np.array([(1.0,), (2.0,)], dtype=[("a", object)]))
    with pytest.raises(
        DatasetError, match=r"got none. Besides, note: a char array is left out.*runs: a structure"
    ):
        import_recording([path])


def test_a_rate_that_the_instants_contradict_is_told(tmp_path: Path) -> None:
    path = matlab(tmp_path, t=np.arange(40) * 0.25, acc=RANDOM.normal(size=40), fs=8.0)
    recording = import_recording([path])
    assert recording.channels["acc"].axis.interval == pytest.approx(0.25)
    assert "the time axes conflict" in recording.remarks[0]


def foreign(path: Path, unit: str = "s", count: int = 40) -> Path:
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", count)
        time = file.createVariable("time", "f8", ("time",))
        time.units = unit
        time[:] = np.arange(count) * 0.5 + (1.7e9 if "since" in unit else 0.0)
        base = file.createVariable("base", "f4", ("time",), fill_value=-999.0)
        base.units = "m s-2"
        base[:] = np.sin(np.arange(count))
        base[5] = np.ma.masked
        file.createVariable("name", str, ())
    return path


@pytest.mark.parametrize("unit", ["s", "seconds since 1970-01-01"])
def test_a_foreign_netcdf_file_gives_its_variables_of_one_dimension(tmp_path: Path, unit: str) -> None:
    recording = import_recording([foreign(tmp_path / "foreign.nc", unit)])
    base = recording.channels["base"]
    assert (base.axis.interval, base.unit) == (pytest.approx(0.5, rel=1e-12), "m s-2")
    assert base.quality[5] == int(Quality.missing)
    assert base.quality.sum() == int(Quality.missing)
    assert "name: is left out" in "\n".join(recording.remarks)
    with netCDF4.Dataset(tmp_path / "foreign.nc", "a") as file:
        file.createGroup("calibration")
    told = import_recording([tmp_path / "foreign.nc"]).remarks
    assert "calibration: a group is left out; variables outside groups are read" in told


def test_nan_that_signals_is_a_missing_value_without_a_warning(tmp_path: Path) -> None:
    path = foreign(tmp_path / "foreign.nc")
    with netCDF4.Dataset(path, "a") as file:
        instants = file["time"][:].filled()
        instants.view(np.uint64)[7] = 0x7FF0000000000001
        file["time"][:] = instants
    recording = import_recording([path])
    assert "1 rows have no instant; they are counted on" in recording.remarks
    assert recording.channels["base"].axis.interval == pytest.approx(0.5)


def test_a_recording_is_passed_on_as_it_is_and_takes_no_options(tmp_path: Path) -> None:
    first = import_recording([foreign(tmp_path / "foreign.nc")])
    write_recording(first, tmp_path / "ours.nc")
    again = import_recording([tmp_path / "ours.nc"])
    np.testing.assert_array_equal(again.channels["base"].values, first.channels["base"].values)
    assert again.attrs["source_sha256"] == first.attrs["source_sha256"]
    with pytest.raises(UsageError, match="expected no options"):
        import_recording([tmp_path / "ours.nc"], ImportSettings(rate=2.0))


def test_what_an_importer_makes_is_the_same_after_writing_and_opening(tmp_path: Path) -> None:
    made = import_recording([foreign(tmp_path / "foreign.nc")])
    write_recording(made, tmp_path / "ours.nc")
    opened = open_recording(tmp_path / "ours.nc")
    assert opened.remarks == made.remarks
    for name, channel in made.channels.items():
        other = opened.channels[name]
        np.testing.assert_array_equal(other.values, channel.values)
        np.testing.assert_array_equal(other.quality, channel.quality)
        np.testing.assert_array_equal(other.axis.time, channel.axis.time)
        assert (other.unit, other.label, other.axis.trigger) == (
            channel.unit,
            channel.label,
            channel.axis.trigger,
        )
