"""Files are read in a separate process: with the same numbers as here, and within bounded time."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from soak.recordings import MAKERS, TEXTS, whole
from support.command_line import in_this_process

from vibroimpact.fmus import reader_process
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import typed
from vibroimpact.fmus.reader_process import ReaderServer
from vibroimpact.hardware.formats import reading, reading_child
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.formats.crossing import packed, unpacked
from vibroimpact.hardware.formats.reading import read_file
from vibroimpact.hardware.formats.table import Column, RawFile, Table
from vibroimpact.hardware.recordings import import_recording

FIELDS = ("label", "unit", "interval", "start", "group", "rails", "attrs", "dated", "ambiguity")


@pytest.fixture(scope="module")
def server_of_all() -> Iterator[ReaderServer]:
    server = ReaderServer()
    yield server
    server.close()


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch, server_of_all: ReaderServer) -> ReaderServer:
    """Return the server of the tests of this file, in place of the process's own."""
    monkeypatch.setattr(reader_process, "_server", server_of_all)
    return server_of_all


def same_columns(one: Column, other: Column) -> None:
    assert [getattr(one, name) for name in FIELDS] == [getattr(other, name) for name in FIELDS]
    assert one.values.dtype == other.values.dtype
    np.testing.assert_array_equal(one.values, other.values)
    assert (one.overrange is None) == (other.overrange is None)
    if one.overrange is not None:
        np.testing.assert_array_equal(one.overrange, other.overrange)


def same_files(one: RawFile, other: RawFile) -> None:
    assert (one.source_format, list(one.remarks), one.attrs, one.damage) == (
        other.source_format,
        list(other.remarks),
        other.attrs,
        other.damage,
    )
    assert len(one.tables) == len(other.tables)
    for mine, others in zip(one.tables, other.tables, strict=True):
        known = ("title", "vectors", "time_place", "rate")
        assert [getattr(mine, name) for name in known] == [getattr(others, name) for name in known]
        assert (mine.time is None) == (others.time is None)
        for pair in zip((*mine.columns, mine.time), (*others.columns, others.time), strict=True):
            if pair[0] is not None and pair[1] is not None:
                same_columns(*pair)


@pytest.mark.parametrize("name", sorted({*TEXTS, *MAKERS}))
@pytest.mark.parametrize("forks", [False, True], ids=["by the server", "by a fork"])
def test_a_file_of_every_format_reads_in_the_other_process_as_here(
    tmp_path: Path, name: str, forks: bool, monkeypatch: pytest.MonkeyPatch, server: ReaderServer
) -> None:
    monkeypatch.setattr(reader_process, "FORKS", forks)
    path = tmp_path / name
    path.write_bytes(whole()[name])
    same_files(read_file(path), read_raw(path))


def test_an_error_that_no_reader_foresaw_is_a_refusal_with_the_name_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_raw(path: Path, **options: str) -> RawFile:
        raise KeyError("data")

    monkeypatch.setattr(reading_child, "read_raw", read_raw)
    path = tmp_path / "record.csv"
    path.write_text("1,2\n3,4\n")
    said = r"record\.csv: expected a whole text file, got one that cannot be read \(KeyError: 'data'\)\. Report it"
    with pytest.raises(DatasetError, match=said):
        import_recording([path])


@pytest.mark.skipif(sys.platform != "linux", reason="no process is forked there")
@pytest.mark.parametrize("command", [True, False])
def test_no_python_is_started_anew_to_read_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: bool
) -> None:
    """A new Python with numpy and pint takes 1.3 s of processor time, a fork 0.02 s."""
    server = ReaderServer()
    monkeypatch.setattr(reader_process, "_server", server)
    path = tmp_path / "record.tdms"
    path.write_bytes(whole()["record.tdms"])
    if command:
        done = in_this_process("import", path, "-o", tmp_path / "recording.nc")
        assert done.returncode == 0, done.stderr
    else:
        read_file(path)
    assert server._process is None


def test_what_is_one_column_or_array_stays_one_on_its_way() -> None:
    time, values = Column("t", np.arange(3.0), "s"), np.array([1.0, np.nan, 3.0])
    over = np.array([False, True, False])
    columns = [Column("a", values, overrange=over, rails=(-1.0, 1.0), attrs={"n": np.int64(3)}), time]
    raw = RawFile(
        "text", [Table(columns, time), Table([Column("b", values)], time, "two", True, 1, 0.5)], ["a"]
    )
    facts, buffers = packed(raw)
    copy = unpacked(json.loads(json.dumps(facts)), [bytearray(buffer) for buffer in buffers])
    same_files(copy, raw)
    assert copy.tables[0].time is copy.tables[1].time is copy.tables[0].columns[1]
    assert len(buffers) == 3
    copy.tables[0].columns[0].values[0] = 5.0  # writable, as any array


@pytest.mark.parametrize(
    "change",
    [
        {"kinds": ["O", "<f8"]},
        {"kinds": ["<f8"]},
        {"columns": []},
        {"tables": [{"columns": [9]}]},
        {"attrs": 3},
    ],
)
def test_facts_that_lie_are_refused(change: Mapping[str, Any]) -> None:
    facts, buffers = packed(RawFile("text", [Table([Column("a", np.ones(2))], Column("t", np.arange(2.0)))]))
    with pytest.raises((ValueError, TypeError, KeyError, IndexError)):
        unpacked({**facts, **change}, [bytearray(buffer) for buffer in buffers])


def nested(levels: int) -> dict[str, Any]:
    """Return scales each of which adds the previous one to itself: npTDMS computes the first 2^levels times."""
    known: dict[str, Any] = {"NI_Number_Of_Scales": np.uint32(levels), "wf_increment": 0.01}
    for at in range(levels):
        inputs = np.uint32(at - 1 if at else 0xFFFFFFFF)
        known |= {
            f"NI_Scale[{at}]_Scale_Type": "Add",
            f"NI_Scale[{at}]_Add_Left_Operand_Input_Source": inputs,
            f"NI_Scale[{at}]_Add_Right_Operand_Input_Source": inputs,
        }
    return known


def test_a_file_whose_reading_does_not_end_is_given_up_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "SECONDS", 1.0)
    path = tmp_path / "record.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("run", "base", np.arange(9.0), nested(60))])
    with pytest.raises(
        DatasetError, match="a whole TDMS file, got one that the library had not read"
    ) as late:
        import_recording([path])
    assert str(late.value).startswith(f"{path}: ")


def test_a_file_that_takes_more_memory_than_its_size_allows_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fork inherits the memory that other files left in this process: the request is far larger."""
    monkeypatch.setattr(reading, "MEMORY", 1 << 20)
    monkeypatch.setattr(reading_child, "read_raw", lambda path, **options: np.ones(1 << 25))
    path = tmp_path / "record.csv"
    path.write_text("1,2\n3,4\n")
    with pytest.raises(DatasetError, match=r"record\.csv: expected .* memory"):
        import_recording([path])


@pytest.mark.parametrize("forks", [False, True], ids=["by the server", "by a fork"])
def test_messages_of_the_other_process_keep_both_spellings(
    tmp_path: Path, forks: bool, monkeypatch: pytest.MonkeyPatch, server: ReaderServer
) -> None:
    monkeypatch.setattr(reader_process, "FORKS", forks)
    path = tmp_path / "record.csv"
    path.write_text("".join(f"{k / 100},{k}\n" for k in range(90)))
    said = "the first column has no heading and ascends: it is taken as the instants"
    (remark,) = read_file(path).remarks
    assert (remark, typed(remark)) == (f"{said} (time_column)", f"{said} (--time-column)")
    path.write_text("no numbers\nin this file\n")
    with pytest.raises(DatasetError, match=r"Give delimiter and decimal if it is\.$") as raised:
        read_file(path)
    assert raised.value.typed.endswith("Give --delimiter and --decimal if it is.")


def test_a_file_that_is_gone_meanwhile_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "record.csv"
    path.write_text("1,2\n3,4\n")
    monkeypatch.setattr(reading, "_kind_of", lambda path: path.unlink() or ("text", ()))
    with pytest.raises(
        DatasetError, match=r"record\.csv: expected a readable file, got an error: No such file"
    ):
        import_recording([path])
