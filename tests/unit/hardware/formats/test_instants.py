"""Clocks and dates in cells of text; the references are Python's own dates."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process

from vibroimpact.analysis.recording import Recording, open_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.recordings import ImportSettings, import_recording

COUNT = 40
FORCE = np.round(np.sin(0.7 * np.arange(COUNT)), 5)


def read(folder: Path, instants: list[str], heading: str = "Time", **said: object) -> Recording:
    path = folder / "record.csv"
    rows = [f"{instant};{force}" for instant, force in zip(instants, FORCE, strict=False)]
    path.write_text("\n".join([f"{heading};Force (N)", *rows]) + "\n", encoding="utf-8")
    return import_recording(path, said or None)


def clocks(form: str, since: datetime, step: float) -> list[str]:
    return [(since + timedelta(seconds=step * place)).strftime(form) for place in range(COUNT)]


@pytest.mark.parametrize(
    ("form", "step"),
    [
        ("%Y-%m-%dT%H:%M:%S", 1.0),
        ("%Y-%m-%d %H:%M:%S.%f", 0.0125),
        ("%Y/%m/%d %H:%M:%S,%f", 0.5),
        ("%d.%m.%Y %H:%M:%S", 60.0),
        ("%d.%m.%y %H:%M:%S", 1.0),
        ("%d/%m/%Y %I:%M:%S %p", 1.0),
        ("%m/%d/%Y, %I:%M:%S\u202f%p", 1.0),
        ("%d-%b-%Y %H:%M:%S", 2.0),
        ("%I:%M:%S %p", 1.0),
        ("%H:%M:%S.%f", 0.25),
    ],
)
def test_clocks_of_12_and_24_hours_pass_noon_and_midnight(form: str, step: float, tmp_path: Path) -> None:
    for hour in (12, 0):
        since = datetime(2019, 3, 12, 11 if hour else 23, 59, 60 - min(int(10 * step) or 1, 59))
        recording = read(tmp_path, clocks(form, since, step))
        axis = recording.channels["force"].axis
        assert axis.interval == pytest.approx(step, rel=1e-9)
        np.testing.assert_array_equal(recording.channels["force"].values, FORCE)


def test_offsets_from_utc_are_taken_off(tmp_path: Path) -> None:
    since = datetime(2019, 10, 27, 0, 40, tzinfo=UTC)
    instants = []
    for place in range(COUNT):
        stamp = since + timedelta(minutes=place)
        summer = timezone(timedelta(hours=2 if stamp.hour < 1 else 1))
        instants.append(stamp.astimezone(summer).isoformat())
    assert read(tmp_path, instants).channels["force"].axis.interval == pytest.approx(60.0)


@pytest.mark.parametrize(("form", "step"), [("{:02d}:{:04.1f}", 0.1), ("{:d}:{:06.3f}", 2.5)])
def test_minutes_and_seconds_are_instants(form: str, step: float, tmp_path: Path) -> None:
    instants = [form.format(int(step * place // 60), step * place % 60) for place in range(COUNT)]
    assert read(tmp_path, instants).channels["force"].axis.interval == pytest.approx(step, rel=1e-9)


def test_minutes_and_seconds_pass_the_hour(tmp_path: Path) -> None:
    seconds = [(3590.0 + 0.5 * place) % 3600.0 for place in range(COUNT)]
    instants = [f"{int(one // 60):02d}:{one % 60:04.1f}" for one in seconds]
    assert read(tmp_path, instants).channels["force"].axis.interval == pytest.approx(0.5)


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d-%m-%Y %H:%M"])
def test_day_or_month_first_is_asked_about_where_both_fit_and_differ(form: str, tmp_path: Path) -> None:
    daily = clocks(form, datetime(2019, 3, 1, 10), 86_400.0)[:10]
    with pytest.raises(DatasetError, match="may have the day or the month first"):
        read(tmp_path, daily)
    order = "month-first" if form.startswith("%m") else "day-first"
    assert read(tmp_path, daily, dates=order).channels["force"].axis.interval == pytest.approx(86_400.0)
    # a given rate makes the question unnecessary
    assert read(tmp_path, daily, rate=2.0).channels["force"].axis.rate == pytest.approx(2.0)


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_day_or_month_first_is_found_where_one_alone_fits(form: str, tmp_path: Path) -> None:
    daily = clocks(form, datetime(2019, 3, 1, 10), 86_400.0)
    assert read(tmp_path, daily).channels["force"].axis.interval == pytest.approx(86_400.0)
    over_midnight = clocks(form, datetime(2019, 3, 2, 23, 59, 50), 1.0)
    assert read(tmp_path, over_midnight).channels["force"].axis.interval == pytest.approx(1.0)


def test_an_unknown_order_of_dates_is_misuse(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="dates: expected day-first or month-first"):
        read(tmp_path, clocks("%d/%m/%Y %H:%M:%S", datetime(2019, 3, 2), 1.0), dates="year-first")
    assert ImportSettings(dates="day-first").dates == "day-first"


def test_a_day_and_a_clock_in_columns_of_their_own_keep_a_pause_of_days(tmp_path: Path) -> None:
    days = ["12.03.2019;23:59:5" + str(k) for k in range(8)] + [
        "15.03.2019;00:00:0" + str(k) for k in range(8)
    ]
    recording = read(tmp_path, days, "Datum;Zeit")
    time = recording.channels["force"].time
    assert list(recording.channels) == ["force"]
    assert time[8] - time[7] == pytest.approx(2 * 86_400.0 + 3.0)


@pytest.mark.parametrize(
    ("heading", "form", "interval"),
    [
        ("millis", "{:.0f}", 0.002),
        ("micros", "{:.0f}", 2e-6),
        ("timestamp_ms", "{:.0f}", 0.002),
        ("time ms", "{:.1f}", 0.002),
        ("Zeit in ms", "{:.0f}", 0.002),
        ("Time in seconds", "{:.0f}", 2.0),
    ],
)
def test_a_heading_may_name_its_part_of_a_second(
    heading: str, form: str, interval: float, tmp_path: Path
) -> None:
    recording = read(tmp_path, [form.format(1000 + 2 * place) for place in range(COUNT)], heading)
    assert recording.channels["force"].axis.interval == pytest.approx(interval, rel=1e-9)


def test_milliseconds_since_1970_are_recognised_by_their_heading(tmp_path: Path) -> None:
    recording = read(tmp_path, [str(1552385472000 + 2 * place) for place in range(COUNT)], "timestamp_ms")
    assert recording.channels["force"].axis.interval == pytest.approx(0.002)
    assert recording.attrs["source_date"] == "2019-03-12T10:11:12.000000"


@pytest.mark.parametrize(
    "instant",
    ["2019-13-01 10:00:00", "30/02/2019 10:00:00", "25:00:00", "13:00:00 PM", "10:99:00", "0:00:00 AM"],
)
def test_an_instant_that_is_none_is_no_instant(instant: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError):
        read(tmp_path, [instant] * COUNT)


@pytest.mark.parametrize(("instants", "said"), [
    ([str(3 * k) for k in range(COUNT)], "Tried: column 1, 'count', ascends from 0 to 117"),
    ([str(k % 3) for k in range(COUNT)], "Tried: 'count', 'Force': no heading names a time, and no column ascends"),
])  # fmt: skip
def test_a_refusal_names_the_columns_that_were_tried_and_the_option(
    instants: list[str], said: str, tmp_path: Path
) -> None:
    with pytest.raises(DatasetError) as caught:
        read(tmp_path, instants, "count")
    assert said in str(caught.value)
    if "column 1" in said:
        assert "time_column='1' takes it as s" in str(caught.value)
        assert read(tmp_path, instants, "count", time_column="1").channels["force"].axis.interval == 3.0


def test_a_column_of_instants_in_disorder_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="column of instants, 'Time': expected them to ascend"):
        read(tmp_path, [str(7 * k % 11) for k in range(COUNT)])


@pytest.mark.parametrize(("unit", "cf"), [
    ("°/s", "0.0174532925199433 rad s-1"), ("µε", "1e-06 1"), ("g RMS", "9.80665 m s-2"), ("mV rms", "0.001 V"),
])  # fmt: skip
def test_units_of_instruments_are_known(unit: str, cf: str, tmp_path: Path) -> None:
    path = tmp_path / "units.csv"
    rows = [f"{0.01 * place:.2f},{force}" for place, force in enumerate(FORCE)]
    path.write_text("\n".join([f"Time (s),x ({unit})", *rows]) + "\n", encoding="utf-8")
    assert import_recording(path).channels["x"].unit == cf


@pytest.mark.parametrize(
    "footer",
    [
        ["Number of rows,40"],
        ["End of file", "Signed: a lab", "Rate: 500,Hz"],
        ["Sum of x,1.5", "Peak-Peak,2.0"],
    ],
)
def test_lines_below_a_table_are_no_samples(footer: list[str], tmp_path: Path) -> None:
    path = tmp_path / "footer.csv"
    rows = [f"{0.002 * place:.3f},{force}" for place, force in enumerate(FORCE)]
    path.write_text("\n".join(["Time (s),x (N)", *rows, *footer]) + "\n", encoding="utf-8")
    recording = import_recording(path)
    np.testing.assert_array_equal(recording.channels["x"].values, FORCE)
    assert "left out" in "\n".join(recording.remarks)


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_few_even_samples_are_even(count: int, tmp_path: Path) -> None:
    path = tmp_path / "few.csv"
    rows = [f"{0.001 * place:.3f},{force}" for place, force in enumerate(FORCE[:count])]
    path.write_text("\n".join(["Time (s),x (N)", *rows]) + "\n")
    recording = import_recording(path)
    assert recording.channels["x"].axis.interval == pytest.approx(0.001)
    assert "not evenly spaced" not in "\n".join(recording.remarks)


def test_the_command_line_asks_for_the_order_of_dates_and_takes_it(tmp_path: Path) -> None:
    path, output = tmp_path / "daily.csv", tmp_path / "daily.nc"
    daily = clocks("%d/%m/%Y %H:%M:%S", datetime(2019, 3, 1, 10), 86_400.0)[:10]
    path.write_text("Time;x (N)\n" + "".join(f"{day};{at}.5\n" for at, day in enumerate(daily)))
    asked = in_this_process("import", path, "-o", output)
    assert asked.returncode == 2
    assert "--dates day-first or --dates month-first" in " ".join(asked.stderr.split())
    assert in_this_process("import", path, "-o", output, "--dates", "day-first").returncode == 0
    assert open_recording(output).channels["x"].axis.interval == pytest.approx(86_400.0)
    assert in_this_process("import", path, "-o", output, "--dates", "year-first").returncode == 2
