"""HDF5 files and MATLAB files of version 7.3, written here with h5py, including malicious ones."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats import choosing
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.recordings import ImportSettings, import_recording, sources

TIME = np.arange(60) / 128.0
ACC = np.sin(TIME * 40.0)


def matlab73(path: Path) -> Path:
    """Write a file as MATLAB does: dimensions in reverse order, structures as groups, a leading user block."""
    with h5py.File(path, "w", userblock_size=512) as file:
        arrays = {"t": TIME[None, :], "acc": np.stack([ACC, -ACC]), "run/force": ACC[None, :] * 3.0}
        for name, values in arrays.items():
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["run"].attrs["MATLAB_class"] = np.bytes_("struct")
        file["note"] = np.frombuffer("hello".encode("utf-16-le"), "<u2")
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
        cell = file.create_dataset("cell", data=np.array([file["acc"].ref], dtype=h5py.ref_dtype))
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        file["#refs#/a"] = ACC
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + content[128:])
    return path


def test_datasets_in_groups_are_channels_with_the_clock_of_their_group(tmp_path: Path) -> None:
    path = tmp_path / "record.h5"
    with h5py.File(path, "w") as file:
        file["first/acc"], file["second/acc"], file["second/inner/acc"] = ACC, ACC, ACC
        file["first"].attrs["fs"] = 128
        file["second/time"] = TIME * 2.0
        file["first/acc"].attrs["units"] = "mm/s^2"
    recording = import_recording([path])
    labels = [channel.label for channel in recording.channels.values()]
    assert labels == ["first.acc", "second.acc", "second.inner.acc"]
    rates = [channel.axis.rate for channel in recording.channels.values()]
    assert rates == pytest.approx([128.0, 64.0, 64.0])
    assert recording.channels["first_acc"].unit == "0.001 m s-2"
    np.testing.assert_array_equal(recording.channels["second_inner_acc"].values, ACC)


def test_an_attribute_of_a_dataset_gives_its_own_rate(tmp_path: Path) -> None:
    path = tmp_path / "record.h5"
    with h5py.File(path, "w") as file:
        file["fast"], file["slow"] = ACC, ACC[:30]
        file["fast"].attrs["sampling_rate"], file["slow"].attrs["dt"] = 1000.0, 0.5
    recording = import_recording([path])
    assert recording.channels["fast"].axis.rate == pytest.approx(1000.0)
    assert recording.channels["slow"].axis.rate == pytest.approx(2.0)


def test_matlab_7_3_is_read_as_version_7_is(tmp_path: Path) -> None:
    recording = import_recording([matlab73(tmp_path / "record.mat")])
    assert [channel.label for channel in recording.channels.values()] == ["acc_1", "acc_2", "run.force"]
    np.testing.assert_array_equal(recording.channels["acc_2"].values, -ACC)
    np.testing.assert_allclose(recording.channels["run_force"].axis.time, TIME, atol=1e-12)
    assert "note: its values are char, it is left out; numbers are read" in recording.remarks
    assert "cell: its values are cell, it is left out; numbers are read" in recording.remarks
    assert "#refs#" not in "\n".join(recording.remarks)


def test_overrange_and_missing_samples_are_flagged(tmp_path: Path) -> None:
    path, driven = tmp_path / "record.h5", ACC.copy()
    driven[[3, 4]] = np.inf, np.nan
    with h5py.File(path, "w") as file:
        file["acc"], file["dt"] = driven, 0.1
    acc = import_recording([path]).channels["acc"]
    assert acc.quality[[3, 4]].tolist() == [Quality.overrange, Quality.missing]


def test_no_value_of_another_file_gets_in(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["acc"] = ACC * 7.0
    (tmp_path / "secret.bin").write_bytes(ACC.tobytes())
    path = tmp_path / "hostile.h5"
    with h5py.File(path, "w") as file:
        file["own"], file["dt"] = ACC, 0.1
        file["linked"] = h5py.ExternalLink("secret.h5", "/acc")
        file["soft"] = h5py.SoftLink("/own")
        file.create_dataset("stored", (60,), "f8", external=[(str(tmp_path / "secret.bin"), 0, 480)])
        layout = h5py.VirtualLayout((60,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "acc", (60,))
        file.create_virtual_dataset("virtual", layout)
    recording = import_recording([path])
    assert list(recording.channels) == ["own"]
    told = "\n".join(recording.remarks)
    assert all(f"{name}: a link to elsewhere is left out" in told for name in ("linked", "soft"))
    assert all(f"{name}: its values are in another file" in told for name in ("stored", "virtual"))


@pytest.mark.parametrize("storage", ["stored", "virtual"])
def test_nor_does_it_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, storage: str) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["acc"] = ACC * 7.0
    (tmp_path / "secret.bin").write_bytes(ACC.tobytes())
    path = tmp_path / "hostile.h5"
    with h5py.File(path, "w") as file:
        if storage == "stored":
            file.create_dataset("acc", (60,), "f8", external=[(str(tmp_path / "secret.bin"), 0, 480)])
        else:
            layout = h5py.VirtualLayout((60,), "f8")
            layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "acc", (60,))
            file.create_virtual_dataset("acc", layout)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(DatasetError, match="expected a whole NetCDF file") as refused:
        import_recording([path])
    assert "\n" not in str(refused.value)


def test_a_file_that_promises_8_terabytes_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("acc", (10**12,), "f8", chunks=(1000,))
    with pytest.raises(DatasetError, match="expected at most 50000000 numbers"):
        import_recording([path])


def test_without_the_extra_datasets_outside_groups_are_read_and_those_within_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flat, grouped = tmp_path / "flat.h5", tmp_path / "grouped.h5"
    with h5py.File(flat, "w") as file:
        file["time"], file["acc"] = TIME, ACC
        file["time"].attrs["units"] = "s"
    with h5py.File(grouped, "w") as file:
        file["run/acc"] = ACC
    mat = matlab73(tmp_path / "record.mat")
    monkeypatch.setattr(sources, "read_file", read_raw)  # in this process
    monkeypatch.setitem(sys.modules, "h5py", None)
    np.testing.assert_array_equal(import_recording([flat]).channels["acc"].values, ACC)
    for path in (grouped, mat):
        with pytest.raises(DatasetError, match=r"pip install 'vibroimpact\[hdf5\]'"):
            import_recording([path])


def test_attributes_of_unusual_kinds_and_circles_of_groups_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "odd.h5"
    with h5py.File(path, "w") as file:
        file["run/acc"] = ACC
        file["run"].attrs["fs"] = [128.0, 256.0]
        file["run/acc"].attrs["CLASS"] = ["DIMENSION_SCALE", "x"]
        file["run/acc"].attrs["units"] = np.array([1, 2])
        file["run/acc"].attrs["dt"] = "soon"
        file["nothing"] = h5py.Empty("f8")
        file["whole"] = np.float16(2.0)
    recording = import_recording([path], ImportSettings(rate=128.0))
    assert list(recording.channels) == ["run_acc"]
    assert recording.scalars["whole"].value == 2.0
    assert "nothing: holds no numbers and is left out" in recording.remarks


def test_a_file_of_another_program_is_not_shown_to_the_netcdf_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The NetCDF library follows every link, even in a circle: 20 s and 4 GB for 5 kB."""
    path = tmp_path / "circle.h5"
    with h5py.File(path, "w") as file:
        file["time"], file["acc"] = TIME, ACC
        file["run/back"] = h5py.SoftLink("/")

    def shown(path: Path) -> None:
        raise AssertionError(path)

    monkeypatch.setattr(choosing, "check_reads", shown)
    recording = import_recording([path])
    np.testing.assert_array_equal(recording.channels["acc"].values, ACC)
    assert "run.back: a link to elsewhere is left out" in recording.remarks


def test_words_of_netcdf_are_found_wherever_a_file_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choosing, "_STRETCH", 16)
    path = tmp_path / "words"
    for word in (b"_NCProperties", b"DIMENSION_SCALE", b"vibroimpact SHA-256"):
        for place in range(40):
            path.write_bytes(bytes(place) + word + bytes(7))
            assert choosing._has_word_of_netcdf(path)
            path.write_bytes(bytes(place) + word[:-1] + bytes(7))
            assert not choosing._has_word_of_netcdf(path)


def test_the_indices_of_a_sparse_matrix_are_no_channels(tmp_path: Path) -> None:
    path = matlab73(tmp_path / "record.mat")
    with h5py.File(path, "r+") as file:
        group = file.create_group("stiffness")
        group.attrs["MATLAB_sparse"], group.attrs["MATLAB_class"] = np.uint64(4), np.bytes_("double")
        group["data"], group["ir"] = np.arange(1.0, 6.0), np.arange(5, dtype=np.uint64)
        group["jc"] = np.array([0, 2, 3, 5, 9], dtype=np.uint64)
    recording = import_recording([path])
    assert not [name for name in (*recording.channels, *recording.events) if "stiffness" in name]
    assert "stiffness: a sparse matrix is left out; save full(stiffness)" in recording.remarks
    assert {"acc_1", "acc_2", "run_force"} <= set(recording.channels)
