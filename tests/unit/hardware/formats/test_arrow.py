"""Parquet and Feather files, written here with pyarrow."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather, parquet

from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.recordings import ImportSettings, import_recording, sources

TIME = np.arange(80) / 512.0
ACC = 9.81 * np.sin(TIME * 90.0)


def written(folder: Path, kind: str, **columns: Any) -> Path:
    path = folder / f"record.{kind}"
    table = pa.table(dict(columns))
    if kind == "parquet":
        parquet.write_table(table, path)
    else:
        feather.write_feather(table, path, compression="zstd")
    return path


@pytest.fixture(params=["parquet", "feather"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_columns_are_read_with_the_units_of_their_headings(tmp_path: Path, kind: str) -> None:
    path = written(
        tmp_path, kind, **{"time [ms]": TIME * 1e3, "acc [m/s^2]": ACC, "count": np.arange(80) % 7}
    )
    recording = import_recording([path])
    np.testing.assert_array_equal(recording.channels["acc"].values, ACC)
    assert recording.channels["acc"].unit == "m s-2"
    assert recording.channels["acc"].axis.rate == pytest.approx(512.0)
    np.testing.assert_array_equal(recording.channels["count"].values, np.arange(80) % 7)


def test_dates_are_instants_to_the_microsecond(tmp_path: Path, kind: str) -> None:
    stamps = np.datetime64("2026-07-30T10:00:00", "us") + (np.arange(80) * 200).astype("timedelta64[us]")
    recording = import_recording([written(tmp_path, kind, when=stamps, acc=ACC)])
    np.testing.assert_allclose(recording.channels["acc"].axis.time, np.arange(80) * 2e-4, atol=1e-12)


def test_nulls_are_missing_infinities_overrange_and_words_left_out(tmp_path: Path, kind: str) -> None:
    values = pa.array([None, np.inf, *ACC[2:]])
    recording = import_recording([written(tmp_path, kind, time=TIME, acc=values, note=["x"] * 80)])
    assert recording.channels["acc"].quality[:3].tolist() == [Quality.missing, Quality.overrange, 0]
    assert "note: its values are string, it is left out; numbers are read" in recording.remarks


def test_a_damaged_file_is_one_line_of_refusal(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, kind, time=TIME, acc=ACC)
    content = path.read_bytes()
    for broken in (content[:-40], content[: len(content) // 2], content[:8]):
        path.write_bytes(broken)
        with pytest.raises(DatasetError, match="expected a whole") as refused:
            import_recording([path])
        assert "\n" not in str(refused.value)


def test_the_first_version_of_feather_is_named(tmp_path: Path) -> None:
    path = tmp_path / "old.feather"
    path.write_bytes(b"FEA1" + bytes(200) + b"FEA1")
    with pytest.raises(DatasetError, match="Feather file of version 2, got version 1"):
        import_recording([path])


def test_a_package_that_is_missing_is_named(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, kind, time=TIME, acc=ACC)
    monkeypatch.setattr(sources, "read_file", read_raw)  # in this process
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DatasetError, match=r"pip install 'vibroimpact\[parquet\]'"):
        import_recording([path])


def test_columns_of_one_name_and_tables_of_nothing_are_said(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"record.{kind}"
    write = parquet.write_table if kind == "parquet" else feather.write_feather
    write(pa.Table.from_arrays([pa.array(ACC)] * 3, names=["a", "a", "b"]), path)
    told = "\n".join(import_recording([path], ImportSettings(rate=10.0)).remarks)
    assert "a: 2 columns have this name, they are left out" in told
    write(pa.table({"word": ["x", "y"]}), path)
    with pytest.raises(DatasetError, match=r"got none\. Besides, word: its values are string"):
        import_recording([path])


def test_a_page_whose_checksum_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    table = pa.table({"time": np.arange(40.0), "base": np.sin(np.arange(40.0))})
    parquet.write_table(table, path, compression="none", use_dictionary=False, write_page_checksum=True)
    content = path.read_bytes()
    place = content.index(np.sin(np.arange(40.0)).tobytes())
    path.write_bytes(content[: place + 80] + bytes([content[place + 80] ^ 16]) + content[place + 81 :])
    with pytest.raises(DatasetError, match=r"table\.parquet: expected a whole Parquet file"):
        import_recording(path)
