"""Recordings come back from a file unchanged, and contradictions of the schema are refused."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import dataset_of, record

from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.analysis.recording import (
    Channel,
    EventTrain,
    Recording,
    SingleValue,
    TimeAxis,
    is_recording,
    open_recording,
    open_signals,
    write_recording,
)
from vibroimpact.analysis.recording.rules import problems_of
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import DatasetError


def example() -> Recording:
    """Return a recording of two axes with different triggers, one of them uneven, an event train, and a value."""
    even = TimeAxis(0.1 * np.arange(6), 0.1, 0.033, "wf_increment", "one.lvm")
    uneven = TimeAxis(np.array([0.0, 0.2, 0.25]), None, source="column 1", trigger="two.lvm")
    quality = np.array([0, 1, 0, 2, 8, 0], np.uint8)
    values = np.array([1.0, 5.0, 2.0, np.nan, 3.0, 4.0])
    channels = [
        Channel("board", values, "9.80665 m s-2", even, quality, "Acceleration_0", {"role": "measured"}),
        Channel("base", 2.0 * values, "9.80665 m s-2", even, 0 * quality, "Acceleration_1"),
        Channel("gap", np.array([1.0, 2.0, 3.0]), "V", uneven, np.zeros(3, np.uint8)),
    ]
    train = EventTrain("bounces", np.array([0.1, 0.5, 0.5]), (0.0, 1.0), 1e-3, "bounces of a ball")
    return Recording(
        {channel.name: channel for channel in channels},
        {"bounces": train},
        {"column_4": SingleValue(0.295, "V", "Column 4")},
        {"source_file": "one.lvm", "remarks": "board: 1 sample is clipped\nboard: 1 sample is missing"},
    )


def test_a_recording_comes_back_as_it_was_written(tmp_path: Path) -> None:
    write_recording(example(), tmp_path / "r.nc")
    found, given = open_recording(tmp_path / "r.nc"), example()
    assert list(found.channels) == ["board", "base", "gap"]
    for name, channel in found.channels.items():
        wanted = given.channels[name]
        np.testing.assert_array_equal(channel.values, wanted.values)
        np.testing.assert_array_equal(channel.quality, wanted.quality)
        np.testing.assert_array_equal(channel.time, wanted.time)
        assert (channel.unit, channel.axis.interval) == (wanted.unit, wanted.axis.interval)
        assert (channel.axis.trigger, channel.axis.source) == (wanted.axis.trigger, wanted.axis.source)
    assert found.channels["board"].axis is found.channels["base"].axis
    assert found.channels["board"].axis.interval_uncertainty == 0.033
    assert found.channels["board"].label == "Acceleration_0"
    train = found.event_train()
    np.testing.assert_array_equal(train.times, [0.1, 0.5, 0.5])
    assert (train.window, train.resolution) == ((0.0, 1.0), 1e-3)
    assert found.scalars["column_4"].value == 0.295
    assert found.remarks == given.remarks


def test_good_samples_are_those_that_are_there_and_within_range() -> None:
    board = example().channels["board"]
    # a doubtful time does not make a value bad; a clipped or missing value is bad
    assert board.good.tolist() == [True, False, True, False, True, True]
    np.testing.assert_allclose(board.si()[:3], 9.80665 * np.array([1.0, 5.0, 2.0]))


def test_the_file_is_one_that_xarray_reads(tmp_path: Path) -> None:
    write_recording(example(), tmp_path / "r.nc")
    with xr.open_dataset(tmp_path / "r.nc") as dataset:
        assert dataset.board.dims == ("time",)
        assert dataset.gap.dims == ("time_2",)
        assert dataset.board_quality.attrs["flag_meanings"] == "clipped missing overrange suspect"
        assert dataset.time.dtype == np.float64
        assert "base_quality" not in dataset


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"time": np.array([0.0, 1.0, 1.0])}, "expected finite instants that ascend strictly"),
        ({"values": np.zeros(2)}, r"values: expected the shape \(3,\) of its time axis, got \(2,\)"),
        ({"name": "2nd"}, "expected letters, digits and underscores"),
        ({"name": "time_left"}, "and not `time`"),
        ({"interval": 0.0}, "time: sampling_interval: expected a number > 0, got 0"),
        ({"interval": np.nan}, "time: sampling_interval: expected a number > 0, got nan"),
        ({"interval": 17.0}, "expected about the mean distance of the instants, 1 s, got 17"),
        ({"doubt": -1.0}, "interval_uncertainty: expected a number >= 0, got -1"),
        ({"values": np.full(3, 1e200)}, r"values: expected a largest magnitude .* got 1e\+200"),
        ({"values": np.array([np.nan, 1e-200, 0.0])}, "values: expected a largest magnitude .* got 1e-200"),
    ],
)
def test_what_contradicts_the_schema_is_refused_and_no_file_is_left(
    change: dict[str, object], told: str, tmp_path: Path
) -> None:
    parts: dict[str, object] = {"time": np.array([0.0, 1.0, 2.0]), "values": np.zeros(3), "name": "gap"}
    parts |= change
    axis = TimeAxis(np.asarray(parts["time"]), parts.get("interval"), parts.get("doubt", 0.0))  # type: ignore[arg-type]
    channel = Channel(str(parts["name"]), np.asarray(parts["values"]), "V", axis, np.zeros(3, np.uint8))
    recording = Recording({channel.name: channel}, attrs={"source_file": "tip.lvm"})
    with pytest.raises(DatasetError, match=told) as refused:
        write_recording(recording, tmp_path / "r.nc")
    assert str(refused.value).startswith("tip.lvm: "), "the file that was read"
    assert list(tmp_path.iterdir()) == []


def test_what_channels_of_one_axis_share_is_told_once() -> None:
    axis = TimeAxis(np.array([0.0, 1.0]), -1.0)
    both = {name: Channel(name, np.zeros(2), "V", axis, np.zeros(2, np.uint8)) for name in ("a", "b")}
    assert len(list(problems_of(Recording(both)))) == 1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"window": (10.0, 2.0)}, "beats: window: expected a start before an end, got 10 to 2 s"),
        ({"attrs": {"masked": [1.0, 2.0, 3.0]}}, "beats: masked: expected start, end, start, end"),
        ({"attrs": {"masked": "abc"}}, "beats: masked: expected start, end, start, end"),
        ({"attrs": {"masked": [2.0, 1.0]}}, "beats: masked: expected spans with a start before an end"),
        ({"resolution": np.nan}, "beats: resolution: expected a number >= 0, got nan"),
        ({"times": np.zeros((2, 2))}, "beats: times: expected one dimension, got 2"),
    ],
)
def test_an_event_train_that_contradicts_itself_is_refused(change: dict[str, Any], told: str) -> None:
    train = replace(EventTrain("beats", np.array([1.0, 2.0])), **change)
    (problem,) = problems_of(Recording({}, {"beats": train}))
    assert problem.startswith(told)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (
            lambda file: file["gap"].attrs.pop("long_name"),
            r"spoilt\.nc: gap: expected the attribute long_name",
        ),
        (
            lambda file: file["gap"].attrs.update(units="elephants"),
            r"spoilt\.nc: gap: unit: expected a unit",
        ),
        (
            lambda file: file["time"].attrs.update(sampling_interval="fast"),
            r"spoilt\.nc: time: expected numbers",
        ),
        (
            lambda file: file.attrs.update(recording_schema="9"),
            r"spoilt\.nc: recording_schema: expected 1, got '9'",
        ),
        (
            lambda file: file["board_quality"].values.fill(77),
            "board: quality: expected whole numbers",
        ),
    ],
)
def test_a_spoilt_recording_is_refused_with_file_and_variable(
    spoil: Callable[[xr.Dataset], None], told: str, tmp_path: Path
) -> None:
    write_recording(example(), tmp_path / "r.nc")
    with xr.open_dataset(tmp_path / "r.nc", decode_cf=False) as whole:
        file = whole.load()
    spoil(file)
    file.to_netcdf(tmp_path / "spoilt.nc")
    with pytest.raises(DatasetError, match=told):
        open_recording(tmp_path / "spoilt.nc")


def test_a_file_of_an_instrument_is_sent_to_import(tmp_path: Path) -> None:
    (tmp_path / "acc.txt").write_text("0.0 1.0\n0.1 2.0\n")
    with pytest.raises(DatasetError, match="`vibroimpact import` makes a recording"):
        open_signals(tmp_path / "acc.txt")


def test_channels_are_asked_for_by_name_with_a_hint() -> None:
    recording = example()
    assert recording.channel("base").name == "base"
    with pytest.raises(DatasetError, match=r'got "bored". Did you mean "board"\?'):
        recording.channel("bored")
    with pytest.raises(DatasetError, match="expected one to be named, got 3: board, base, gap"):
        recording.channel()


def test_a_run_of_a_simulated_dataset_is_a_recording_too(tmp_path: Path) -> None:
    runs = [record(1.0, impacts=2, samples=3), record(2.0, impacts=1, samples=4)]
    write_dataset(dataset_of(runs), tmp_path / "runs.nc")
    assert not is_recording(tmp_path / "runs.nc")
    with pytest.raises(DatasetError, match="expected one run to be named, got 2"):
        open_signals(tmp_path / "runs.nc")
    second = open_signals(tmp_path / "runs.nc", 1)
    channel = second.channel("displacement")
    np.testing.assert_array_equal(channel.time, runs[1].samples[:, 0])  # type: ignore[index]
    np.testing.assert_array_equal(channel.values, runs[1].samples[:, 1])  # type: ignore[index]
    np.testing.assert_array_equal(second.event_train("impacts").times, runs[1].impacts[:, 0])  # type: ignore[index]
    write_recording(example(), tmp_path / "r.nc")
    with pytest.raises(DatasetError, match=r"r\.nc: run: expected none of a recording, got 7"):
        open_signals(tmp_path / "r.nc", 7)
    with pytest.raises(DatasetError, match="expected a run_index from 0 to 1, got 7"):
        open_signals(tmp_path / "runs.nc", 7)


def test_a_file_of_another_kind_or_a_damaged_one_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("no NetCDF")
    with pytest.raises(DatasetError, match=r"text\.nc: expected a readable NetCDF dataset"):
        open_recording(tmp_path / "text.nc")
    write_recording(example(), tmp_path / "r.nc")
    (tmp_path / "cut.nc").write_bytes((tmp_path / "r.nc").read_bytes()[:3000])
    with pytest.raises(DatasetError, match=r"cut\.nc"):
        open_recording(tmp_path / "cut.nc")
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(DatasetError, match=r"expected a recording, got other NetCDF contents"):
        open_recording(tmp_path / "other.nc")


def test_results_say_what_they_are_and_every_variable_has_a_unit(tmp_path: Path) -> None:
    good = xr.Dataset({"peak": ("spike", [1.0], {"units": "N", "long_name": "peak force"})})
    write_results(good, tmp_path / "r.nc", kind="spikes")
    assert file_attributes(tmp_path / "r.nc")["results_kind"] == "spikes"
    assert file_attributes(tmp_path / "absent.nc") == {}
    with pytest.raises(DatasetError, match="spikes: peak: expected the attribute units, got none"):
        write_results(xr.Dataset({"peak": ("spike", [1.0])}), tmp_path / "x.nc", kind="spikes")
    assert not (tmp_path / "x.nc").exists()


@pytest.mark.parametrize(
    ("label", "cf", "factor"),
    [
        ("g", "9.80665 m s-2", 9.80665),
        ("m/s^2", "m s-2", 1.0),
        ("m/s²", "m s-2", 1.0),
        ("9.80665 m s-2", "9.80665 m s-2", 9.80665),
        ("mV", "0.001 V", 1e-3),
        ("lbf", "4.4482216152605 N", 4.4482216152605),
        ("mV/N", "0.001 V N-1", 1e-3),
        ("", "1", 1.0),
        ("degC", "degree_Celsius", 1.0),
    ],
)
def test_units_are_read_as_instruments_write_them(label: str, cf: str, factor: float) -> None:
    found = measured_unit(label)
    assert found.cf == cf
    assert found.factor == pytest.approx(factor, rel=1e-14)
    assert measured_unit(cf).factor == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize("label", ["furlongs per", "1/0", "exec('x')", "2**9**9**9", "m" * 100, "9" * 60])
def test_what_is_no_unit_is_refused_and_never_evaluated(label: str) -> None:
    with pytest.raises(DatasetError, match="unit: expected a unit such as"):
        measured_unit(label)


def test_people_read_g() -> None:
    assert unit_label("9.80665 m s-2") == "g"
    assert unit_label("V") == "V"


@pytest.mark.parametrize(
    "label",
    [
        "mm",
        "mN",
        "mV",
        "µm",
        "kN",
        "cm",
        "mm/s",
        "mm/s²",
        "lbf",
        "in",
        "psi",
        "bar",
        "deg",
        "deg/s",
        "ms",
        "kHz",
    ],
)
def test_a_unit_is_shown_as_the_user_gave_it(label: str) -> None:
    assert unit_label(measured_unit(label).cf) == label


@pytest.mark.parametrize(
    "cf", ["0.37 m", "0.001 kg", "0.01 N", "(m s-2) (N)-1", "0.001 m2", "", "3", "x y z w!"]
)
def test_a_unit_that_nobody_has_a_name_for_is_shown_as_it_is_stored(cf: str) -> None:
    assert unit_label(cf) == cf


def test_remarks_of_an_import_are_counted_in_one_line(tmp_path: Path) -> None:
    one = Recording({}, attrs={"source_file": "a.csv", "remarks": "a gap\nclipped"})
    (line,) = one.remarks_counted
    assert line.startswith("a.csv: 2 remarks of its import are in its attribute `remarks`")
    assert Recording({}, attrs={"source_file": "a.csv"}).remarks_counted == ()


def test_a_text_of_thousands_of_factors_is_no_unit() -> None:
    started = time.process_time()
    with pytest.raises(DatasetError, match="expected a unit such as"):
        measured_unit("m " * 100_000)
    assert time.process_time() - started < 0.1


@pytest.mark.parametrize(
    "label", ["GHz", "GPa", "TPa", "MN/m^2", "PHz", "eV", "nF", "rpm", "°/s", "l/min", "m5 s-9", "byte"]
)
def test_a_unit_that_is_written_is_read_again(label: str) -> None:
    unit = measured_unit(label)
    again = measured_unit(unit.cf)
    assert (again.cf, again.si) == (unit.cf, unit.si)
    assert again.factor == pytest.approx(unit.factor, rel=1e-14)


@pytest.mark.parametrize("label", ["m m m m m m m m m m", "gauss", "s-5 s-5"])
def test_a_unit_that_could_not_be_read_again_is_refused(label: str) -> None:
    with pytest.raises(DatasetError, match="expected a unit such as"):
        measured_unit(label)
