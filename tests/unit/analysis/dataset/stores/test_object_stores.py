"""Stores in an object store: S3 as a server of this machine plays it, also when the bucket is gone or refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
import s3fs
import xarray as xr
from support.command_line import in_this_process
from support.dataset_examples import dataset_of, record
from support.object_store import close_all

import vibroimpact as vi
from vibroimpact.analysis.dataset import dataset_place, write_dataset
from vibroimpact.fmus.errors import DatasetError

pytestmark = pytest.mark.long
"""The server alone takes seconds; stores in memory have the same path through fsspec."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    runs = dataset_of([record(1.0), record(2.0)]).drop_dims(["impact", "stick", "sample"])
    write_dataset(
        runs.drop_vars([f"{dim}_count" for dim in ("impact", "stick", "sample")]), tmp_path / "a.nc"
    )
    return tmp_path / "a.nc"


def test_a_store_in_a_bucket_is_the_dataset_of_its_file(
    bucket: s3fs.S3FileSystem, file: Path, tmp_path: Path
) -> None:
    address = "s3://bucket/campaign/dataset.zarr"
    with vi.convert(file, address) as stored, vi.open_dataset(file) as opened:
        xr.testing.assert_identical(stored.load(), opened.load())
    assert dataset_place(Path("s3://bucket/campaign")) == address
    done = in_this_process("convert", "s3://bucket/campaign", tmp_path / "b.nc")
    assert done.returncode == 0, done.stderr
    assert "2 runs in" in done.stdout
    with vi.open_dataset(tmp_path / "b.nc") as back, vi.open_dataset(file) as opened:
        xr.testing.assert_identical(back.load(), opened.load())
    done = in_this_process("describe", address)
    assert done.returncode == 0, done.stderr


def test_a_bucket_that_is_gone_or_refuses_is_one_line(
    bucket: s3fs.S3FileSystem, file: Path, monkeypatch: pytest.MonkeyPatch, endpoint: str
) -> None:
    for words in (("describe", "s3://gone/a.zarr"), ("convert", file, "s3://gone/a.zarr")):
        done = in_this_process(*words)
        assert done.returncode == 2, done.stdout
        assert done.stderr.startswith("s3://gone/a.zarr: ")
        assert done.stderr.count("\n") == 1
    vi.convert(file, "s3://bucket/a.zarr").close()
    with vi.open_dataset("s3://bucket/a.zarr") as opened:
        bucket.rm("bucket", recursive=True)
        with pytest.raises(DatasetError, match=r"s3://bucket/a\.zarr: ") as gone:
            opened.load()
        assert "\n" not in str(gone.value)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    close_all()
    with pytest.raises(DatasetError, match=r"s3://bucket/a\.zarr: ") as problem:
        vi.open_dataset("s3://bucket/a.zarr")
    assert "\n" not in str(problem.value)
    close_all()
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
