"""LabVIEW measurement files, written here according to National Instruments' specification of the format."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from vibroimpact.analysis.recording import Quality, Recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.labview import read_labview
from vibroimpact.hardware.recordings import import_recording

FILE_HEADER = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
Multi_Headings\t{headings}
X_Columns\t{columns}
Time_Pref\tRelative
Operator\tada
Date\t2026/07/30
Time\t20:00:00.5000000000000000
***End_of_Header***\t
\t
"""


def file_header(columns: str = "One", headings: str = "No", decimal: str = ".") -> str:
    return FILE_HEADER.format(columns=columns, headings=headings, decimal=decimal)


def segment(
    rows: list[str], labels: str, begins: str = "20:00:00.5", interval: str = "0.010000", **more: str
) -> str:
    channels = labels.count("\t") - 1
    entries = {
        "Channels": str(channels),
        "Samples": "\t".join([str(len(rows))] * channels),
        "Date": "\t".join(["2026/07/30"] * channels),
        "Time": "\t".join([begins] * channels),
        "Y_Unit_Label": "\t".join(["m/s^2"] * channels),
        "X_Dimension": "\t".join(["Time"] * channels),
        "X0": "\t".join(["0.0000000000000000E+0"] * channels),
        "Delta_X": "\t".join([interval] * channels),
        **more,
    }
    lines = [f"{key}\t{cells}\t" for key, cells in entries.items()]
    return "\n".join([*lines, "***End_of_Header***\t\t", labels, *rows]) + "\n"


def imported(folder: Path, text: str) -> Recording:
    path = folder / "record.lvm"
    path.write_text(text)
    return import_recording([path])


def two_channels(count: int, first: int = 0, printed: str = "{:.6f}") -> list[str]:
    return [f"{printed.format((k + first) * 0.01)}\t{k + first}.5\t{-k - first}.25" for k in range(count)]


def test_one_column_of_instants_holds_for_all_channels(tmp_path: Path) -> None:
    recording = imported(tmp_path, file_header() + segment(two_channels(20), "X_Value\tbase\tboard\tComment"))
    base, board = recording.channels["base"], recording.channels["board"]
    np.testing.assert_array_equal(base.values, np.arange(20) + 0.5)
    assert base.axis is board.axis
    assert (base.axis.interval, base.unit) == (0.01, "m s-2")
    assert recording.attrs["source_operator"] == "ada"
    assert recording.attrs["source_date"] == "2026-07-30T20:00:00.500000"


def test_without_a_column_of_instants_the_header_gives_the_interval(tmp_path: Path) -> None:
    rows = [f"\t{k}\t{-k}" for k in range(20)]
    text = file_header("No") + segment(rows, "X_Value\tbase\tboard\tComment", interval="0.002")
    axis = imported(tmp_path, text).channels["board"].axis
    assert (axis.interval, axis.source) == (0.002, "the sampling interval of the header")


def test_with_a_column_of_instants_for_each_channel_each_has_its_own_axis(tmp_path: Path) -> None:
    rows = [f"{k * 0.01:.6f}\t{k}.5\t{k * 0.03:.6f}\t{-k}.5" for k in range(20)]
    labels = "X_Value\tfast\tX_Value\tslow\tComment"
    both = {key: f"{value}\t\t{value}" for key, value in {"Samples": "20", "Date": "2026/07/30"}.items()}
    both |= {"Time": "20:00:00.5\t\t20:00:00.5", "X_Dimension": "Time\t\tTime", "X0": "0\t\t0"}
    both |= {"Delta_X": "0.01\t\t0.03", "Y_Unit_Label": "g\t\tm/s^2", "Channels": "2"}
    recording = imported(tmp_path, file_header("Multi") + segment(rows, labels, **both))
    assert recording.channels["fast"].axis.interval == 0.01
    assert recording.channels["slow"].axis.interval == 0.03
    assert recording.channels["fast"].unit == "9.80665 m s-2"
    assert recording.channels["slow"].unit == "m s-2"


@pytest.mark.parametrize("first", [0, 30])
def test_a_segment_that_goes_on_later_is_joined_and_its_gap_is_missing(tmp_path: Path, first: int) -> None:
    """The instants of the second segment restart or continue: 0.3 s after the start in both cases."""
    labels = "X_Value\tbase\tboard\tComment"
    later = segment(two_channels(20, first), labels, begins="20:00:00.8")
    recording = imported(
        tmp_path, file_header("One", "Yes") + segment(two_channels(20), labels) + "\n" + later
    )
    base = recording.channels["base"]
    assert len(base.values) == 50
    assert (base.quality[20:30] == int(Quality.missing)).all()
    assert base.quality.sum() == 10 * int(Quality.missing)
    np.testing.assert_array_equal(base.values[30:], np.arange(20) + first + 0.5)
    told = "\n".join(recording.remarks)
    assert "segment 2 begins 0.11 s after the last sample of the one before" in told
    assert "10 samples are missing in 1 gap of 0.11 s at 0.19 s" in told


def test_segments_of_other_channels_stay_apart(tmp_path: Path) -> None:
    text = file_header("One", "Yes") + segment(two_channels(20), "X_Value\tbase\tboard\tComment")
    text += "\n" + segment(two_channels(12), "X_Value\tforce\tstroke\tComment", begins="20:00:09")
    recording = imported(tmp_path, text)
    assert list(recording.channels) == ["base", "board", "force", "stroke"]
    assert recording.channels["force"].axis.time[0] == pytest.approx(8.5, abs=1e-12)


def test_instants_printed_with_too_few_digits_are_taken_from_the_header(tmp_path: Path) -> None:
    rows = [f"{k * 1.953125e-5:.6f}\t{k}\t{-k}" for k in range(4000)]
    text = file_header() + segment(rows, "X_Value\tbase\tboard\tComment", interval="1.953125E-5")
    recording = imported(tmp_path, text)
    axis = recording.channels["base"].axis
    assert (axis.interval, axis.interval_uncertainty) == (1.953125e-5, 0.0)
    np.testing.assert_allclose(axis.time, np.arange(4000) * 1.953125e-5, rtol=0.0, atol=1e-12)
    assert "rounded to 1e-06 s" in "\n".join(recording.remarks)


def test_a_header_that_contradicts_the_instants_makes_the_interval_uncertain(tmp_path: Path) -> None:
    text = file_header() + segment(two_channels(50), "X_Value\tbase\tboard\tComment", interval="0.0105")
    recording = imported(tmp_path, text)
    axis = recording.channels["base"].axis
    assert axis.interval == pytest.approx(0.01, rel=1e-9)
    assert axis.interval_uncertainty == pytest.approx(0.05, rel=1e-6)
    assert "uncertain by 5.0%" in "\n".join(recording.remarks)


def test_special_blocks_comments_and_notes_are_told_and_do_no_harm(tmp_path: Path) -> None:
    rows = two_channels(20)
    rows[0] += "\tafter lunch"
    special = "***Start_Special***\nanything\t1\t2\n***End_Special***\n"
    text = file_header() + special + segment(rows, "X_Value\tbase\tboard\tComment", Notes="loose screw")
    recording = imported(tmp_path, text)
    told = "\n".join(recording.remarks)
    assert list(recording.channels) == ["base", "board"]
    assert all(words in told for words in ("1 special blocks", "after lunch", "loose screw"))


def test_decimal_commas_are_read_where_the_header_says_so(tmp_path: Path) -> None:
    rows = [f"{k * 0.01:.6f}\t{k}.5\t{-k}.25".replace(".", ",") for k in range(20)]
    text = file_header(decimal=",") + segment(rows, "X_Value\tbase\tboard\tComment", interval="0,010000")
    channel = imported(tmp_path, text).channels["base"]
    assert channel.values[3] == 3.5
    assert channel.axis.interval == 0.01


def test_fewer_samples_than_the_header_says_are_told(tmp_path: Path) -> None:
    text = file_header() + segment(two_channels(20), "X_Value\tbase\tboard\tComment", Samples="500\t500")
    assert "base: the header says 500 samples, the file has 20" in "\n".join(imported(tmp_path, text).remarks)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("LabVIEW Measurement\t\nSeparator\tTab\n", "the file is cut off"),
        (file_header(), "The measurement holds no data"),
        (file_header() + segment([], "X_Value\tbase\tboard\tComment"), "The measurement holds no data"),
        (file_header() + segment(two_channels(9), "X_Value\tbase\tboard\tComment") + "end of\tstory\n", ""),
        (
            file_header()
            + segment(two_channels(9), "X_Value\tbase\tboard\tComment")
            + "***End_of_Header***\n",
            "expected a row of numbers, got the end of the file",
        ),
    ],
)
def test_a_header_without_its_data_is_refused(tmp_path: Path, text: str, said: str) -> None:
    if said:
        with pytest.raises(DatasetError, match=f"(?i){said}"):
            imported(tmp_path, text)
    else:
        assert len(imported(tmp_path, text).channels) == 2


@pytest.mark.parametrize("begins", ["20:00:00.5", "20:00:07.5"])
def test_segments_that_began_at_the_same_instant_have_one_trigger(tmp_path: Path, begins: str) -> None:
    rows = [f"{k * 0.01:.6f}\t{k}.5" for k in range(20)]
    first = segment(rows, "X_Value\tbase\tComment")
    second = segment(rows, "X_Value\tboard\tComment", begins=begins, interval="0.02")
    recording = imported(tmp_path, file_header("One", "Yes") + first + "\n" + second)
    triggers = {channel.axis.trigger for channel in recording.channels.values()}
    assert len(recording.channels) == 2
    assert len(triggers) == (1 if begins == "20:00:00.5" else 2)
    assert ("triggers: the lag" in "\n".join(recording.remarks)) == (len(triggers) == 2)


def test_a_thousand_channels_cost_a_thousand_times_one(tmp_path: Path) -> None:
    many = 1000
    entries = {"Date": "2026/07/30", "Time": "10:00:00.5", "X0": "0", "Delta_X": "0.5"}
    header = "".join(key + f"\t{value}" * many + "\n" for key, value in entries.items())
    row = "\t".join(["", *["1.5"] * many])
    text = (
        "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\n\n"
        f"{header}***End_of_Header***\n"
        + "\t".join(["X_Value", *(f"a{at}" for at in range(many))])
        + f"\n{row}\n{row}\n"
    )
    started = time.process_time()
    (table,) = read_labview(text).tables
    assert time.process_time() - started < 1.5
    assert [column.interval for column in table.columns] == [0.5] * many
    with pytest.raises(DatasetError, match="at most 1024 columns"):
        read_labview(text.replace(row, row + "\t2.5" * 100))


@pytest.mark.parametrize("samples", ["1e999", "-1e999", "1e40", "-1e40"])
def test_a_header_of_any_number_of_samples_is_compared_with_the_rows(tmp_path: Path, samples: str) -> None:
    text = file_header() + segment(two_channels(20), "X_Value\tbase\tboard\tComment", Samples=samples)
    assert len(imported(tmp_path, text).channels["base"].values) == 20
