"""Tables that were silently misread: pairs of columns, headings that look like units, clocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vibroimpact.analysis.recording import Quality, Recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.recordings import import_recording

COUNT = 60
SIGNAL = np.round(np.sin(0.7 * np.arange(2 * COUNT)), 5)


def read(folder: Path, lines: list[str]) -> Recording:
    path = folder / "record.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return import_recording(path)


def rows(instants: list[str], mark: str = ",") -> list[str]:
    return [f"{instant}{mark}{value}" for instant, value in zip(instants, SIGNAL, strict=False)]


def each(step: float, start: float = 0.0, digits: int = 6) -> list[str]:
    return [f"{start + step * place:.{digits}f}" for place in range(COUNT)]


@pytest.mark.parametrize(
    "heading", ["t1 (s);a1 (g);t2 (s);a2 (g)", "Time 1;a1;Time 2;a2", "Zeit [s];a1 [V];Zeit [s];a2 [V]"]
)
def test_pairs_of_columns_have_instants_of_their_own(heading: str, tmp_path: Path) -> None:
    lines = [heading]
    for place in range(2 * COUNT):
        first = f"{0.002 * place:.3f};{SIGNAL[place]}" if place < COUNT else ";"
        lines.append(f"{first};{0.001 * place:.3f};{-SIGNAL[place]}")
    recording = read(tmp_path, lines)
    one, other = (recording.channels[name] for name in ("a1", "a2"))
    assert (one.axis.rate, other.axis.rate) == (pytest.approx(500.0), pytest.approx(1000.0))
    np.testing.assert_array_equal(one.values, SIGNAL[:COUNT])
    np.testing.assert_array_equal(other.values, -SIGNAL)
    assert len(recording.channels) == 2


def test_instants_that_are_written_twice_are_one_column_of_them_and_a_channel(tmp_path: Path) -> None:
    lines = ["Time (s);a;Time (s);b", *(f"{t};{v};{t};{v}" for t, v in zip(each(0.01), SIGNAL, strict=False))]
    recording = read(tmp_path, lines)
    assert {"a", "b"} <= set(recording.channels)
    assert recording.channels["a"].axis is recording.channels["b"].axis


def test_headings_that_pint_could_read_as_units_are_headings(tmp_path: Path) -> None:
    recording = read(tmp_path, ["ms,acc", *rows(each(2.0, digits=0))])
    assert (recording.channels["acc"].unit, recording.channels["acc"].axis.rate) == (
        "1",
        pytest.approx(500.0),
    )
    with pytest.raises(DatasetError, match="a: expected a column of instants"):
        read(tmp_path, ["a,b", *rows(each(1.0, digits=1))])


@pytest.mark.parametrize(
    ("heading", "unit", "remark"),
    [
        ("Acceleration (mg)", "0.00980665 m s-2", "is taken for a part of g"),
        ("acc [kg]", "9806.65 m s-2", "is taken for a part of g"),
        ("Displacement (mils)", "2.54e-05 m", ""),
        ("gap (thou)", "2.54e-05 m", ""),
        ("Velocity (mm)", "1", "is none of what the heading says"),
        ("Force (mm/s)", "1", "is none of what the heading says"),
        ("x (acc)", "1", "is not known"),
        ("Force (mV)", "0.001 V", ""),
        ("Force (kg)", "kg", ""),
        ("accelerometer (V)", "V", ""),
        ("accuracy (m)", "m", ""),
        ("Velocity (deg/s)", "0.0174532925199433 rad s-1", ""),
    ],
)
def test_a_unit_that_the_heading_denies_is_told(heading: str, unit: str, remark: str, tmp_path: Path) -> None:
    recording = read(tmp_path, [f"Time (s),{heading}", *rows(each(0.002))])
    (channel,) = recording.channels.values()
    assert channel.unit == unit
    said = "\n".join(recording.remarks)
    assert remark in said
    assert remark or "unit" not in said


@pytest.mark.parametrize("interval", [0.002, 0.1, 1.0])
def test_days_of_a_spreadsheet_are_no_seconds(interval: float, tmp_path: Path) -> None:
    recording = read(tmp_path, ["Time,Acc (g)", *rows(each(interval / 86_400.0, 43_500.5, 12))])
    assert recording.channels["acc"].axis.interval == pytest.approx(interval, rel=1e-6)
    assert recording.attrs["source_date"].startswith("2019-02-04T12:00:00")


@pytest.mark.parametrize(("step", "digits"), [(0.001, 3), (0.02, 2), (1.0, 0), (2.0**-10, 10), (0.00123, 5)])
def test_seconds_of_the_day_stay_seconds(step: float, digits: int, tmp_path: Path) -> None:
    recording = read(tmp_path, ["Time,Acc (g)", *rows(each(step, 43_500.5 if digits else 43_500.0, digits))])
    assert recording.channels["acc"].axis.interval == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("step", [60.0 / 86_400.0, 1.0 / 1200.0])
def test_what_may_be_days_or_seconds_is_asked_about(step: float, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="seconds, or days of a spreadsheet"):
        read(tmp_path, ["Time,Acc (g)", *rows(each(step, 43_500.5, 12))])
    answered = import_recording(tmp_path / "record.csv", {"rate": 1200.0})
    assert answered.channels["acc"].axis.rate == pytest.approx(1200.0)
    assert answered.channels["acc"].values.size == COUNT


def test_a_clock_of_the_day_passes_midnight(tmp_path: Path) -> None:
    instants = [
        f"{23 if s < 20 else 0:02d}:{59 if s < 20 else 0:02d}:{(40 + s) % 60:02d}" for s in range(COUNT)
    ]
    recording = read(tmp_path, ["Time;Weg (mm)", *rows(instants[:79], ";")])
    channel = recording.channels["weg"]
    assert channel.axis.interval == pytest.approx(1.0)
    assert not channel.quality.any()
    np.testing.assert_array_equal(channel.values, SIGNAL[:COUNT])


def test_a_small_step_back_of_a_clock_of_the_day_is_disorder(tmp_path: Path) -> None:
    instants = [f"12:00:{s:02d}" for s in range(COUNT)]
    instants[30], instants[31] = instants[31], instants[30]
    recording = read(tmp_path, ["Time;Weg (mm)", *rows(instants, ";")])
    assert "go back 1 times" in "\n".join(recording.remarks)


def test_lines_that_sum_up_a_table_are_no_samples(tmp_path: Path) -> None:
    lines = ["Time (s),acc (g)", *rows(each(0.002)), "", "Mean,0.01", "RMS,0.4", "Std Dev,0.4"]
    recording = read(tmp_path, lines)
    assert recording.channels["acc"].values.size == COUNT
    assert "the last 3 lines sum up the table and are left out: Mean,0.01" in "\n".join(recording.remarks)


def test_a_delimiter_between_quotes_is_part_of_its_heading(tmp_path: Path) -> None:
    heading = '"Time, of the rig (s)","Acc, tip (m/s^2)","Force ""stop"" (N)"'
    recording = read(tmp_path, [heading, *(f"{row},1.5" for row in rows(each(0.002)))])
    assert {name: channel.unit for name, channel in recording.channels.items()} == {
        "acc_tip": "m s-2",
        "force_stop": "N",
    }


def test_infinity_is_beyond_the_range(tmp_path: Path) -> None:
    lines = rows(each(0.002))
    lines[7], lines[9] = lines[7].partition(",")[0] + ",\u221e", lines[9].partition(",")[0] + ",-\u221e"
    channel = read(tmp_path, ["Time (s),A (V)", *lines]).channels["a"]
    assert np.flatnonzero(channel.quality & Quality.overrange).tolist() == [7, 9]


def test_a_column_that_counts_the_rows_is_no_channel(tmp_path: Path) -> None:
    lines = [f"{number},{row}" for number, row in enumerate(rows(each(0.002)), 1)]
    assert set(read(tmp_path, ["Index,Time (s),Acc (g)", *lines]).channels) == {"acc"}
