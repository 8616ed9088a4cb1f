"""Exports of instruments, written by `support.instrument_files` with drawn content, are recognized and read."""

from __future__ import annotations

import re
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from support.instrument_files import EXPORTS

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.instruments import forms, instrument_of
from vibroimpact.hardware.recordings import import_recording


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", sorted(EXPORTS))
def test_an_export_gives_names_units_rate_and_values(kind: str, seed: int, tmp_path: Path) -> None:
    maker, write = EXPORTS[kind]
    export = write(seed)
    path = tmp_path / "export.csv"
    path.write_text("\n".join(export.lines) + "\n", encoding=export.encoding)
    recording = import_recording(path)
    assert recording.attrs["source_format"].startswith(f"{maker}, text")
    assert list(recording.channels) == list(export.names)
    for channel, unit, values, interval in zip(
        recording.channels.values(), export.units, export.values, export.intervals, strict=True
    ):
        assert channel.unit == unit
        assert channel.axis.interval == pytest.approx(interval, rel=1e-6)
        np.testing.assert_array_equal(channel.values, values)
        if export.start is not None:
            assert channel.time[0] == pytest.approx(export.start, abs=1e-3 * interval)
    assert not recording.events
    assert not recording.scalars


def test_every_form_has_a_signature_and_expressions_that_compile() -> None:
    assert {form.maker for form in forms()} == {maker for maker, _ in EXPORTS.values()}
    for form in forms():
        assert form.signature, form.maker
        texts = [
            getattr(form, key)
            for key in ("headings", "names", "units", "time_unit", "interval", "rate", "start")
        ]
        for text in filter(None, texts):
            assert re.compile(text).groups >= 1, text
        for text in (*form.signature, form.time, form.left_out, *(pair[0] for pair in form.replaced)):
            re.compile(text)


@pytest.mark.parametrize("kind", sorted(EXPORTS))
def test_each_export_is_recognised_by_one_form_alone(kind: str) -> None:
    content = "\n".join(EXPORTS[kind][1](4).lines) + "\n"
    matching = [form for form in forms() if all(re.search(line, content, re.M) for line in form.signature)]
    assert len(matching) == 1


@pytest.mark.parametrize(
    "text",
    [
        "Time (s),Force (N)\n0,1\n",
        "Date;Time;force\n2019-01-01;10:00:00;1\n",
        "X,Y\n0,1\n1,2\n",
        "",
        "\n" * 9000,
        "Header Size:\t12\nX-Axis unit:\tHz\n1\t0\t1\n",
    ],
)
def test_a_text_of_another_maker_is_left_to_the_general_reader(text: str) -> None:
    assert instrument_of(text) is None


@pytest.mark.parametrize("kind", sorted(EXPORTS))
def test_an_export_that_is_cut_anywhere_in_its_head_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    text = "\n".join(EXPORTS[kind][1](5).lines) + "\n"
    for cut in range(1, min(len(text), 700), 97):
        path = tmp_path / "cut.csv"
        path.write_text(text[:cut], encoding="utf-8")
        with suppress(DatasetError):
            assert import_recording(path).attrs["source_sha256"]


def test_no_signature_takes_long_on_a_text_that_nearly_has_it() -> None:
    hostile = [
        "a_X;" + "b_Y_Y_Yc_X;" * 700 + "!",
        "X," + "A," * 4000,
        "Sequence," + "e," * 4000,
        "HBM" * 2700,
    ]
    started = time.process_time()
    for text in hostile:
        assert instrument_of(text + "\n") is None
    assert time.process_time() - started < 2.0


def test_a_last_value_that_was_cut_off_counts_as_missing_in_an_export_too(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv"
    path.write_text("\n".join(EXPORTS["Tektronix TDS"][1](6).lines)[:-4])
    recording = import_recording(path)
    assert np.isnan(recording.channels["ch2"].values[-1])
    assert "the text ends within a row" in "\n".join(recording.remarks)


def test_a_clock_too_coarse_for_its_samples_gives_way_to_the_interval_of_the_header(tmp_path: Path) -> None:
    lines = ["waveform\t[0]", "t0\t12.03.2019 10:11:12,000", "delta t\t0,000100", "", "time\tY[0]"]
    values = [f"{0.5 * at:.1f}".replace(".", ",") for at in range(90)]
    rows = [f"12.03.2019 10:11:12,{at // 10:03d}\t{value}" for at, value in enumerate(values)]
    path = tmp_path / "fast.txt"
    path.write_text("\n".join([*lines, *rows]) + "\n")
    channel = import_recording(path).channels["y_0"]
    assert channel.axis.interval == pytest.approx(1e-4)
    np.testing.assert_array_equal(channel.values, 0.5 * np.arange(90))


def test_a_scope_that_skips_counts_keeps_its_instants(tmp_path: Path) -> None:
    lines = ["X,CH1,Start,Increment,", "Sequence,Volt,0.5,1e-3", *(f"{3 * at},{at}.5,," for at in range(50))]
    path = tmp_path / "skipped.csv"
    path.write_text("\n".join(lines) + "\n")
    axis = import_recording(path).channels["ch1"].axis
    assert (axis.time[0], axis.interval) == (pytest.approx(0.5), pytest.approx(3e-3))
