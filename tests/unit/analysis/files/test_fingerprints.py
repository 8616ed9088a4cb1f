"""A dataset file ends with the SHA-256 of its content, so that damage is known before a library opens the file."""

from __future__ import annotations

import hashlib
import random
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from support.dataset_examples import record

from vibroimpact.analysis.dataset import Direction, build_dataset, open_dataset, read_flat, write_dataset
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH, closing_line, matches_recorded_hash
from vibroimpact.fmus.errors import DatasetError


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "run.nc"
    runs = [record(1.0, impacts=3, samples=2), record(2.0, impacts=1, samples=4)]
    names = ("displacement", "velocity")
    directions = [Direction.independent] * 2
    dataset = build_dataset(
        runs,
        coordinates={"stop_position": np.array([0.1, 0.2])},
        direction=directions,
        run_index=[0, 1],
        sample_variables=names,
        unit_of={"stop_position": "m"},
    )
    write_dataset(dataset, path)
    return path


def test_a_file_ends_with_the_hash_of_what_is_before_it(written: Path) -> None:
    content = written.read_bytes()
    assert content[-LINE_LENGTH:].split()[-1].decode() == hashlib.sha256(content[:-LINE_LENGTH]).hexdigest()
    assert matches_recorded_hash(written)


def test_every_flipped_bit_is_noticed_before_a_library_opens_the_file(
    written: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = written.read_bytes()

    def opened(*_: object, **__: object) -> None:
        pytest.fail("a damaged file was opened")

    monkeypatch.setattr(netCDF4, "Dataset", opened)
    draw = random.Random(4)
    for place in [
        *range(48),
        *(len(sound) - k for k in range(1, LINE_LENGTH + 1)),
        *draw.sample(range(len(sound)), 200),
    ]:
        damaged = bytearray(sound)
        damaged[place] ^= 1 << draw.randrange(8)
        written.write_bytes(damaged)
        for read in (read_flat, open_dataset):
            with pytest.raises(DatasetError, match="the file is damaged"):
                read(written)


def test_zeros_over_the_end_do_not_hide_the_hash(written: Path) -> None:
    sound = written.read_bytes()
    written.write_bytes(sound[:-512] + bytes(512))
    with pytest.raises(DatasetError, match="the file is damaged"):
        matches_recorded_hash(written)


@pytest.mark.parametrize("end", [-1, -LINE_LENGTH + 1, -50])
def test_a_line_that_is_cut_short_is_noticed(written: Path, end: int) -> None:
    written.write_bytes(written.read_bytes()[:end])
    with pytest.raises(DatasetError, match="the file is damaged"):
        matches_recorded_hash(written)


@pytest.mark.parametrize("more", [b"\0", bytes(LINE_LENGTH), b"x" * 500])
def test_what_follows_the_line_is_noticed(written: Path, more: bytes) -> None:
    written.write_bytes(written.read_bytes() + more)
    with pytest.raises(DatasetError, match="the file is damaged"):
        matches_recorded_hash(written)


def test_a_file_of_version_0_1_has_no_hash_and_opens(written: Path) -> None:
    written.write_bytes(written.read_bytes()[:-LINE_LENGTH])
    assert not matches_recorded_hash(written)
    assert read_flat(written).sizes["run"] == 2


@pytest.mark.parametrize("content", [b"", b"text", bytes(200)])
def test_other_files_have_no_hash(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other"
    path.write_bytes(content)
    assert not matches_recorded_hash(path)


@pytest.mark.parametrize(("version", "place"), [(0, 40), (1, 44), (2, 28), (3, 28)])
def test_a_file_that_lost_its_end_is_noticed_in_every_version_of_hdf5(
    version: int, place: int, tmp_path: Path
) -> None:
    # the superblock of HDF5 1.14 has version 0, that of HDF5 2 has version 2
    head = bytearray(b"\x89HDF\r\n\x1a\n" + bytes([version]) + bytes(91))
    head[place : place + 8] = (5000).to_bytes(8, "little")
    content = bytes(head) + bytes(4900)
    path = tmp_path / "runs.nc"
    path.write_bytes(content + closing_line(content))
    assert matches_recorded_hash(path)
    # the line is damaged at its beginning, but the content still states its length
    path.write_bytes(content + b"X" + closing_line(content)[1:])
    with pytest.raises(DatasetError, match="SHA-256"):
        matches_recorded_hash(path)
