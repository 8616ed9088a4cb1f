"""Truncated recordings: a last sample that may be wrong is missing or reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from vibroimpact.analysis.recording import Quality, Recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.formats.cut_off import without_cut_cells
from vibroimpact.hardware.recordings import import_recording, sources


@pytest.fixture(autouse=True)
def read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read files in this process: there are a thousand, and a process for each takes 20 ms."""
    monkeypatch.setattr(sources, "read_file", read_raw)


ROWS = 40
TIME = np.arange(ROWS) / 1000.0
BASE = np.sin(np.arange(ROWS) / 3.0)
BOARD = 40.0 * np.cos(np.arange(ROWS) / 5.0)
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.001000\t0.001000\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tbase\tboard\tComment\n"
)


def rows(form: str, newline: str = "\n") -> str:
    """Return the table with each row in the given form."""
    return "".join(form.format(t, a, b) + newline for t, a, b in zip(TIME, BASE, BOARD, strict=True))


WRITERS: dict[str, str] = {
    "fixed decimals": "t,base,board\n" + rows("{:.4f},{:.6f},{:.6f}"),
    "exponents between tabs": "t\tbase\tboard\n" + rows("{:.6e}\t{:.6e}\t{:.6e}", "\r\n"),
    "all digits": "t,base,board\n" + rows("{!r},{!r},{!r}").replace("np.float64(", "").replace(")", ""),
    "shortest": "t;base;board\n" + rows("{:g};{:g};{:g}"),
    "decimal comma": "t;base;board\n" + rows("{:.4f};{:.5f};{:.5f}").replace(".", ","),
    "whole numbers": "t base board\n" + rows("{:.3f} {:.3f} {:.0f}"),
    "blanks": "t base board\n" + rows("{:8.4f} {:12.5e} {:12.5e}"),
    "LabVIEW": LABVIEW + rows("{:.6f}\t{:.6f}\t{:.6f}"),
    "LabVIEW, exponents": LABVIEW + rows("{:.6E}\t{:.6E}\t{:.6E}\t"),
}


def imported(folder: Path, content: bytes, name: str = "record.txt") -> Recording:
    (folder / name).write_bytes(content)
    return import_recording([folder / name])


def wrong_samples(recording: Recording, whole: Recording) -> list[str]:
    """Return the channels with a sample that is neither right nor missing."""
    wrong = []
    for name, channel in recording.channels.items():
        known = whole.channels[name].values[: len(channel.values)]
        bad = ~np.isnan(channel.values) & (channel.values != known)
        if bad.any() or (channel.axis.time != whole.channels[name].axis.time[: len(known)]).any():
            wrong.append(name)
    return wrong


def is_told(recording: Recording) -> bool:
    return "the text ends with" in "\n".join(recording.remarks)


@pytest.mark.parametrize("text", WRITERS.values(), ids=WRITERS)
def test_up_to_90_bytes_cut_off_are_never_wrong_and_silent(text: str, tmp_path: Path) -> None:
    whole = imported(tmp_path, text.encode())
    assert not is_told(whole)
    assert len(whole.channels["board"].values) == ROWS
    for cut in range(1, 91):
        recording = imported(tmp_path, text.encode()[:-cut])
        assert is_told(recording) or not wrong_samples(recording, whole), f"{cut} bytes"
        lengths = {len(channel.values) for channel in recording.channels.values()}
        assert len(lengths) == 1, f"{cut} bytes"


@pytest.mark.parametrize("name", ["fixed decimals", "exponents between tabs", "LabVIEW, exponents"])
def test_a_last_number_that_lacks_digits_is_missing_and_said(name: str, tmp_path: Path) -> None:
    text = WRITERS[name].rstrip()
    whole = imported(tmp_path, text.encode())
    assert not is_told(whole)  # as many digits as in all others: a writer without a final line break
    for cut in (1, 2, 3, 5):
        board = imported(tmp_path, text[:-cut].encode()).channels["board"]
        assert len(board.values) == ROWS
        assert np.isnan(board.values[-1])
        assert board.quality[-1] == Quality.missing
        assert (board.quality[:-1] == 0).all()


def test_a_row_cut_after_a_column_leaves_the_others_missing(tmp_path: Path) -> None:
    text = WRITERS["fixed decimals"].rstrip()
    recording = imported(tmp_path, text[: text.rindex(",") + 1].encode())
    assert recording.channels["base"].values[-1] == pytest.approx(BASE[-1], abs=1e-6)
    assert recording.channels["board"].quality[-1] == Quality.missing
    assert "the text ends within a row: its last columns count as missing" in recording.remarks


def test_a_row_cut_within_its_instant_is_left_out(tmp_path: Path) -> None:
    text = WRITERS["fixed decimals"]
    recording = imported(tmp_path, text[: text.rindex("0.0390") + 4].encode())
    assert len(recording.channels["base"].values) == ROWS - 1
    assert "the text ends within a row: what is left of it, '0.03', is left out" in recording.remarks


def test_a_row_cut_within_an_instant_of_all_digits_is_no_row_in_the_wrong_place(tmp_path: Path) -> None:
    """`0.58` remains of `0.5861328125`: earlier than the rows above, and no shorter than their shortest instant."""
    instants = [f"{place / 512.0!r},{value:.6f},{value:.6f}\n" for place, value in enumerate(BASE)]
    recording = imported(tmp_path, ("t,base,board\n" + "".join(instants) + "0.07").encode())
    assert len(recording.channels["base"].values) == ROWS
    assert recording.remarks[0] == "the text ends within a row: what is left of it, '0.07', is left out"
    assert recording.channels["base"].axis.interval == 1.0 / 512.0


def test_a_cell_of_any_digits_in_a_row_that_lacks_others_is_missing(tmp_path: Path) -> None:
    rows_of_all_digits = WRITERS["all digits"].splitlines()
    cut = "\n".join([*rows_of_all_digits, "0.04,0.7212"]).encode()
    recording = imported(tmp_path, cut)
    assert recording.channels["base"].quality[-1] == Quality.missing
    assert "the text ends within a row: its last value, '0.7212', counts as missing" in recording.remarks


def test_channels_of_unequal_lengths_are_said(tmp_path: Path) -> None:
    lines = WRITERS["fixed decimals"].splitlines()
    short = [line if place < 30 else line[: line.rindex(",") + 1] for place, line in enumerate(lines)]
    recording = imported(tmp_path, ("\n".join(short) + "\n").encode())
    said = "channels of unequal lengths, 29 to 40 samples: board ends first"
    assert said in recording.remarks


def test_a_labview_binary_file_that_was_cut_off_is_said(tmp_path: Path) -> None:
    path = tmp_path / "record.tdms"
    with TdmsWriter(path) as writer:
        known = {"wf_increment": 0.001}
        writer.write_segment(
            [ChannelObject("run", "base", BASE, known), ChannelObject("run", "board", BOARD, known)]
        )
    content = path.read_bytes()
    for cut in range(1, 91):
        path.write_bytes(content[:-cut])
        recording = import_recording([path])
        told = "\n".join(recording.remarks)
        assert recording.remarks[0].startswith("the file is cut off: its last segment")
        assert "npTDMS" not in told
        assert "channels of unequal lengths" in told
        for name, values in (("base", BASE), ("board", BOARD)):
            found = recording.channels[name].values
            np.testing.assert_array_equal(found, values[: len(found)])


def test_a_refusal_of_a_binary_file_that_was_cut_off_says_so(tmp_path: Path) -> None:
    path = tmp_path / "record.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("run", "base", BASE)])
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(DatasetError, match=r"Give rate .*Besides, the file is cut off"):
        import_recording([path])


@pytest.mark.parametrize(
    ("last", "left", "remarks"),
    [
        ('"', 2, ["the text ends within a row: what is left of it, '\"', is left out"]),
        ("||", 3, []),
    ],
)
def test_a_last_row_without_a_cell_is_an_open_quotation_mark_or_missing_values(
    last: str, left: int, remarks: list[str]
) -> None:
    rows = ['"1,5"|"2"|"3"', '"1,6"|"4"|"5"', last]
    kept, said = without_cut_cells(rows, "\n".join(rows), "|", ",")
    assert (len(kept), said) == (left, remarks)
