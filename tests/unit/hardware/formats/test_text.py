"""Tables of text; the references are the numbers written by each test."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vibroimpact.analysis.recording import Quality, open_recording, write_recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import read_cells
from vibroimpact.hardware.formats.text import find_dialect, headings, read_text
from vibroimpact.hardware.recordings import ImportSettings, import_recording


def written(folder: Path, text: str, name: str = "record.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def remarks(path: Path, settings: ImportSettings | None = None) -> str:
    return "\n".join(import_recording([path], settings).remarks)


@pytest.mark.parametrize(
    ("line", "delimiter", "decimal"),
    [
        ("0.5\t1.5\t2.5", "\t", "."),
        ("0.5;1.5;2.5", ";", "."),
        ("0.5,1.5,2.5", ",", "."),
        ("0,5;1,5;2,5", ";", ","),
        ("0,5\t1,5\t2,5", "\t", ","),
        ("0,5 1,5 2,5", None, ","),
        ("  0.5   1.5 2.5", None, "."),
        ("0.5, 1.5, 2.5", ",", "."),
        ("1e-3|-2E+5|.5", "|", "."),
    ],
)
def test_delimiter_and_decimal_sign_are_found_from_the_rows(
    line: str, delimiter: str | None, decimal: str
) -> None:
    dialect, _ = find_dialect(["a b c", *[line] * 5])
    assert (dialect.delimiter, dialect.decimal) == (delimiter, decimal)


def test_a_comma_that_may_be_decimal_is_told() -> None:
    _, doubt = find_dialect(["1,25", "1,50", "1,75"])
    assert "decimal=','" in doubt[0]
    assert find_dialect(["1,25", "1,50"], "", ",")[0].decimal == ","


@pytest.mark.parametrize(
    ("header", "names", "units"),
    [
        (["# time(s), \t \t acceleration(g)"], ["time", "acceleration"], ["s", "g"]),
        (["#Time\tPos", "#[s]\t[au]"], ["Time", "Pos"], ["s", "au"]),
        (["Zeit / s;Kraft / N"], ["Zeit", "Kraft"], ["s", "N"]),
        (["made by a logger", "time,base", "s,m/s^2"], ["time", "base"], ["s", "m/s^2"]),
        (['"time [ms]","force [kN]"'], ["time", "force"], ["ms", "kN"]),
        (["three words here"], ["", ""], ["", ""]),
    ],
)
def test_headings_and_units_are_found_above_the_rows(
    header: list[str], names: list[str], units: list[str]
) -> None:
    delimiter = ";" if ";" in header[0] else "," if "," in header[0] and "#" not in header[0] else "\t"
    assert headings(header, 2, delimiter if "words" not in header[0] else ",") == (names, units)


@settings(max_examples=60)
@given(
    table=arrays(
        np.float64,
        st.tuples(st.integers(2, 12), st.integers(2, 5)),
        elements=st.floats(-1e30, 1e30, allow_nan=False),
    ),
    dialect=st.sampled_from([("\t", "."), (";", ","), (",", "."), (" ", "."), ("\t", ","), (";", ".")]),
    titled=st.booleans(),
)
def test_a_table_written_in_any_dialect_is_read_back_to_the_last_digit(
    table: np.ndarray, dialect: tuple[str, str], titled: bool
) -> None:
    delimiter, decimal = dialect
    rows = [delimiter.join(repr(float(cell)).replace(".", decimal) for cell in row) for row in table]
    header = [delimiter.join(f"signal{place}" for place in range(table.shape[1]))] if titled else []
    raw = read_text("\n".join([*header, *rows]) + "\n")
    columns = [*([raw.tables[0].time] if raw.tables[0].time else []), *raw.tables[0].columns]
    assert len(columns) == table.shape[1]
    for column, expected in zip(columns, table.T, strict=True):
        np.testing.assert_array_equal(column.values, expected)


def test_a_column_that_ends_early_is_shorter_and_not_missing(tmp_path: Path) -> None:
    rows = [f"{k / 100}\t{k * 2}\t{k if k < 30 else ''}" for k in range(50)]
    recording = import_recording([written(tmp_path, "time\tlong\tshort\n" + "\n".join(rows))])
    assert (len(recording.channels["long"].values), len(recording.channels["short"].values)) == (50, 30)
    assert not recording.channels["short"].quality.any()


def test_one_number_in_the_first_row_is_a_single_value(tmp_path: Path) -> None:
    rows = ["0.0\t1.5\t0.295", *[f"{k / 100}\t{k % 7}\t" for k in range(1, 40)]]
    recording = import_recording([written(tmp_path, "\n".join(rows))])
    assert recording.scalars["column_3"].value == 0.295
    assert list(recording.channels) == ["column_2"]


def test_markers_of_overrange_and_of_nothing_are_told_apart(tmp_path: Path) -> None:
    marks = ["OVRNG", "Inf", "1e308", "9.9e37", "NaN", "", "n/a", "9.91e37"]
    rows = [f"{k / 10},{marks[k - 3] if 3 <= k < 11 else k * 0.5}" for k in range(20)]
    channel = import_recording([written(tmp_path, "time,force\n" + "\n".join(rows) + "\n")]).channels["force"]
    overrange, missing = int(Quality.overrange), int(Quality.missing)
    assert channel.quality[3:11].tolist() == [overrange] * 4 + [missing] * 4
    assert np.isnan(channel.values[3:11]).all()
    assert channel.good.sum() == 12


def test_words_among_numbers_count_as_missing_and_are_told_while_they_are_few(tmp_path: Path) -> None:
    rows = [f"{k / 10},{'sensor off' if k == 7 else k}" for k in range(30)]
    path = written(tmp_path, "time,force\n" + "\n".join(rows))
    assert "'sensor off' in row 8" in remarks(path)
    many = [f"{k / 10},{'off' if 5 < k < 15 else k}" for k in range(30)]
    with pytest.raises(DatasetError, match="force: expected numbers, got 9 other cells"):
        import_recording([written(tmp_path, "time,force\n" + "\n".join(many))])


def test_a_column_of_words_is_left_out_and_told(tmp_path: Path) -> None:
    rows = [f"{k / 10},{k},operator asleep" for k in range(30)]
    path = written(tmp_path, "time,force,notes\n" + "\n".join(rows))
    recording = import_recording([path])
    assert list(recording.channels) == ["force"]
    assert "notes: a column of words is left out: operator asleep" in "\n".join(recording.remarks)


def test_dates_become_seconds_after_the_first(tmp_path: Path) -> None:
    rows = [f"2026-07-30 20:59:{58 + k // 4:02d}.{k % 4 * 25:02d},{k}" for k in range(8)]
    recording = import_recording([written(tmp_path, "timestamp,force\n" + "\n".join(rows))])
    assert recording.channels["force"].axis.interval == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize("day", ["2026-07-30", "30.07.2026", "7/30/2026"])
def test_a_day_and_a_time_of_day_in_columns_of_their_own_are_understood(tmp_path: Path, day: str) -> None:
    rows = [f"{day};09:59:{58 + k // 4:02d},{k % 4 * 25:02d};{k},5" for k in range(8)]
    recording = import_recording([written(tmp_path, "Date;Time;force\n" + "\n".join(rows))])
    assert list(recording.channels) == ["force"]
    assert recording.channels["force"].axis.interval == pytest.approx(0.25, rel=1e-9)


def test_times_in_milliseconds_become_seconds(tmp_path: Path) -> None:
    rows = [f"{k * 2.5};{k}" for k in range(9)]
    recording = import_recording([written(tmp_path, "time [ms];force [mN]\n" + "\n".join(rows))])
    assert recording.channels["force"].axis.rate == pytest.approx(400.0, rel=1e-12)
    assert recording.channels["force"].unit == "0.001 N"


def test_names_units_scale_and_offset_of_the_user_come_first(tmp_path: Path) -> None:
    path = written(tmp_path, "time,a\n" + "\n".join(f"{k / 10},{k}" for k in range(9)))
    chosen = ImportSettings(name=("force",), unit=("N",), scale=(2.0,), offset=(-1.0,))
    channel = import_recording([path], chosen).channels["force"]
    np.testing.assert_array_equal(channel.values, 2.0 * np.arange(9) - 1.0)
    assert (channel.unit, channel.label, channel.attrs["scale"]) == ("N", "a", 2.0)


def test_an_unknown_unit_is_told_and_a_known_one_stored_as_cf_reads_it(tmp_path: Path) -> None:
    path = written(tmp_path, "time (s),a (inch),b (g)\n" + "\n".join(f"{k / 10},{k},{k}" for k in range(9)))
    recording = import_recording([path])
    assert (recording.channels["a"].unit, recording.channels["b"].unit) == ("0.0254 m", "9.80665 m s-2")
    path = written(tmp_path, "time (s),a (blips)\n" + "\n".join(f"{k / 10},{k}" for k in range(9)))
    assert "the unit 'blips' is not known" in remarks(path)


def test_text_that_is_not_utf_8_is_read_and_told(tmp_path: Path) -> None:
    path = tmp_path / "latin.csv"
    path.write_bytes(
        "time,Kraft_für\n".encode("latin-1") + b"\n".join(b"%g,%d" % (k / 10, k) for k in range(9))
    )
    assert "not UTF-8" in remarks(path)


def test_utf_16_and_byte_order_marks_are_understood(tmp_path: Path) -> None:
    text = "time;Kraft\n" + "\n".join(f"{k / 10};{k}" for k in range(9))
    for encoding in ("utf-16", "utf-8-sig"):
        path = tmp_path / f"{encoding}.csv"
        path.write_bytes(text.encode(encoding))
        assert list(import_recording([path]).channels) == ["kraft"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,force\n", "expected rows of numbers, got none"),
        ("just a letter\nto a friend\n", "expected rows of numbers, got none"),
        ("\n\n\n", "expected rows of numbers, got none"),
        ("force\n1\n2\n4\n3\n", "Give rate (samples per second), or time_column"),
        ("0.0,1\n", "expected channels of two samples or more"),
        ("time,a\n" + "0.1,2\nrubbish here\n" * 8, "expected a row of numbers as before, got 'rubbish here'"),
    ],
)
def test_a_text_without_a_record_is_refused_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(DatasetError) as caught:
        import_recording([path])
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_cell_of_a_million_digits_and_a_letter_is_no_number(tmp_path: Path) -> None:
    rows = [f"{k / 10},{'7' * 10**6 + 'x' if k == 5 else k}" for k in range(40)]
    recording = import_recording([written(tmp_path, "time,force\n" + "\n".join(rows) + "\n")])
    assert np.isnan(recording.channels["force"].values[5])


def test_a_heading_of_a_million_letters_makes_no_long_remark(tmp_path: Path) -> None:
    rows = [f"{k / 10},{'x' if k == 5 else k}" for k in range(40)]
    recording = import_recording([written(tmp_path, f"time,{'f' * 10**6}\n" + "\n".join(rows) + "\n")])
    assert recording.remarks
    assert max(map(len, recording.remarks)) <= 500
    assert max(map(len, recording.channels)) < 200


def test_columns_that_begin_later_leave_the_others_their_headings_and_units(tmp_path: Path) -> None:
    rows = [f"{k / 100:.2f},{k % 7},{-k}" + (",8,9" if k > 19 else "") for k in range(40)]
    path = tmp_path / "ragged.csv"
    path.write_text("time [s],acc [m/s^2],force [N]\n" + "\n".join(rows) + "\n")
    recording = import_recording([path])
    assert list(recording.channels) == ["acc", "force", "column_4", "column_5"]
    assert (recording.channels["acc"].unit, recording.channels["force"].unit) == ("m s-2", "N")
    assert recording.channels["acc"].axis.rate == pytest.approx(100.0)
    assert np.isnan(recording.channels["column_5"].values[:20]).all()
    assert "columns 4 to 5 begin in row 21 of the table, and have no heading (name)" in recording.remarks


@pytest.mark.parametrize(
    ("rows", "values"),
    [
        (["Zeit;Kraft", "0,0;30.000,00", "0,1;29.990,96", "0,2;850,25"], [30000.0, 29990.96, 850.25]),
        (["Zeit;Druck", "0,0;101.325", "0,1;101.326", "0,2;1.101.327"], [101325.0, 101326.0, 1101327.0]),
        (["t\tF", "0.0\t1,234.5", "0.1\t2,345.5", "0.2\t3.5"], [1234.5, 2345.5, 3.5]),
        (['t,F,"a"', '0.0,"1,234.5",3', '0.1,"-2,345.5",3', '0.2,"7.5",3'], [1234.5, -2345.5, 7.5]),
        (["Temps;F", "0,0;3\u202f549,48", "0,1;\u22121\u00a0200,5", "0,2;2 000"], [3549.48, -1200.5, 2000.0]),
        (['"Zeit","F"', '"0,0","1,5"', '"0,1","-2,5"', '"0,2","1.000,5"'], [1.5, -2.5, 1000.5]),
    ],
)
def test_numbers_with_separators_of_thousands_are_read(
    tmp_path: Path, rows: list[str], values: list[float]
) -> None:
    path = tmp_path / "thousands.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    recording = import_recording([path])
    channel = next(iter(recording.channels.values()))
    np.testing.assert_array_equal(channel.values, values)
    assert channel.axis.interval == pytest.approx(0.1)
    is_doubtful = "separators of thousands, since commas are decimal" in "\n".join(recording.remarks)
    assert is_doubtful == any(
        row.count(".") and "," in row and not row.startswith(("0.", "t")) for row in rows
    )


def test_separators_of_thousands_beside_another_decimal_sign_are_named_in_the_refusal(tmp_path: Path) -> None:
    path = tmp_path / "thousands.csv"
    path.write_text("\n".join(["t;F", *[f"{k}.5;{k}.5" for k in range(300)], "300.5;1.234,5"]) + "\n")
    with pytest.raises(DatasetError, match=r"without separators of thousands, got '1\.234,5'"):
        import_recording([path])


def test_numbers_that_only_look_like_thousands_are_read(tmp_path: Path) -> None:
    path = tmp_path / "plain.csv"
    path.write_text("t,a,b\n" + "".join(f"{k}.125,{k}.250,{k}\n" for k in range(30)))
    np.testing.assert_array_equal(import_recording([path]).channels["a"].values, np.arange(30) + 0.25)


@pytest.mark.parametrize(
    ("heading", "form", "parts"),
    [
        ("timestamp", "{:.6f}", 1.0),
        ("time (s)", "{:.9f}", 1.0),
        ("timestamp", "{:.0f}", 1e3),
        ("timestamp", "{:.0f}", 1e6),
        ("t (ms)", "{:.3f}", 1e3),
    ],
)
def test_instants_since_1970_count_from_the_first(
    tmp_path: Path, heading: str, form: str, parts: float
) -> None:
    path, step = tmp_path / "unix.csv", 2e-3 if form == "{:.0f}" else 1.0 / 5120.0
    rows = [f"{form.format((1795255200.0 + k * step) * parts)},{k % 5}\n" for k in range(500)]
    path.write_text(f"{heading},acc\n" + "".join(rows))
    recording = import_recording([path])
    axis = recording.channels["acc"].axis
    assert axis.time[0] == pytest.approx(0.0, abs=1e-6)
    assert axis.interval == pytest.approx(step, rel=1e-5)
    assert recording.attrs["source_date"] == "2026-11-21T10:00:00.000000"
    assert "since 1970: they are counted from 2026-11-21T10:00:00.000000 (UTC)" in "\n".join(
        recording.remarks
    )


def test_a_gap_in_instants_since_1970_is_told_from_the_start(tmp_path: Path) -> None:
    path = tmp_path / "unix.csv"
    kept = [k for k in range(400) if not 100 <= k < 140]
    path.write_text("timestamp,acc\n" + "".join(f"{1795255200.0 + k / 5120.0:.6f},{k % 5}\n" for k in kept))
    recording = import_recording([path])
    assert len(recording.channels["acc"].values) == 400
    assert (
        "40 samples are missing in 1 gap of 0.008008 s at 0.019336 s: they are there as NaN"
        in recording.remarks
    )


def test_one_value_beyond_the_range_is_kept_as_such(tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    rows = ["0.0,1.5,9.900000E+37", *[f"{k / 10},{k % 3}," for k in range(1, 30)]]
    path.write_text("t,acc,trigger\n" + "\n".join(rows) + "\n")
    recording = import_recording([path])
    write_recording(recording, tmp_path / "one.nc")
    for found in (recording, open_recording(tmp_path / "one.nc")):
        assert found.scalars["trigger"].overrange
        assert np.isnan(found.scalars["trigger"].value)
    told = "trigger: one value only, which the file marks as overrange: kept beside the channels"
    assert told in recording.remarks


def test_a_row_of_many_cells_costs_its_own_cells_alone() -> None:
    started = time.process_time()
    (table,) = read_text("t,a\n" + "0.5,\n0.5,1.5\n" * 3000 + "1," * 1000 + "2\n").tables
    assert time.process_time() - started < 1.0
    assert len(table.columns) == 1000
    assert len(table.columns[-1].values) == 6001
    assert np.isfinite(table.columns[-1].values).sum() == 1


def test_short_rows_beside_wide_ones_that_fill_the_memory_are_refused() -> None:
    started = time.process_time()
    with pytest.raises(DatasetError, match=r"at most 50000000 cells .* got 60001 rows of up to 1001"):
        read_text("t,a\n" + "0.5,x\n" * 60_000 + "1," * 1000 + "2\n")
    with pytest.raises(DatasetError, match="at most 1024 columns, got 100001"):
        read_text("t,a\n" + "0.5,x\n" * 100 + "1," * 100_000 + "2\n")
    assert time.process_time() - started < 4.0


def test_columns_that_begin_late_or_skip_rows_keep_their_rows() -> None:
    rows = ["0,1", "1,2", "2,3,OL", "3,4,,10:00:01", "4,5,7.5,10:00:02", "5,6,x,10:00:03.5", "6,7"]
    cells = read_cells(rows, ",", ".")
    np.testing.assert_array_equal(cells[1].values, [1, 2, 3, 4, 5, 6, 7])
    np.testing.assert_array_equal(cells[2].values, [np.nan] * 4 + [7.5, np.nan])
    assert list(np.flatnonzero(cells[2].overrange)) == [2]
    assert cells[2].strange == [(5, "x")]
    np.testing.assert_array_equal(cells[3].values, [np.nan] * 3 + [0.0, 1.0, 2.5])
    assert cells[3].dated


def test_days_beside_clocks_give_them_their_dates_where_rows_differ_in_width() -> None:
    rows = ["2026-07-30,23:59:59,1", "2026-07-31,00:00:01,2,note", "2026-07-31,00:00:03,3"]
    days, clock, values, _ = read_cells(rows, ",", ".")
    assert not len(days.values)
    np.testing.assert_array_equal(clock.values, [0.0, 2.0, 4.0])
    np.testing.assert_array_equal(values.values, [1, 2, 3])


@pytest.mark.parametrize("mark", ["\t", ";", ","])
@pytest.mark.parametrize("bom", ["", "\ufeff"])
def test_one_column_whose_lines_end_in_a_delimiter_keeps_its_unit(
    tmp_path: Path, mark: str, bom: str
) -> None:
    """After a tab the heading counted as two: the unit of the only channel was lost."""
    path = tmp_path / "record.txt"
    rows = "".join(f"{value}{mark}\n" for value in (2.5, -1.25, 0.6, 0.8, 0.9))
    path.write_text(f"{bom}base (m/s^2){mark}\n{rows}", encoding="utf-8")
    channels = import_recording([path], ImportSettings(rate=2.0, decimal=".")).channels
    assert {name: channel.unit for name, channel in channels.items()} == {"base": "m s-2"}


def test_a_title_above_two_columns_is_no_heading_of_one() -> None:
    assert headings(["My title"], 2, "\t") == (["My", "title"], ["", ""])
