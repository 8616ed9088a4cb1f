"""The command `vibroimpact spikes`, in this process: its prints, its files, its refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
import xarray as xr
from support.spike_signals import channel, pulses
from typer.testing import CliRunner

from vibroimpact.analysis.intervals import dimension
from vibroimpact.analysis.operations import spikes as declared
from vibroimpact.analysis.recording import EventTrain, Recording, open_recording, write_recording
from vibroimpact.fmus.errors import DatasetError, EstimationError, UsageError
from vibroimpact.orchestrator.commands.typer_form import as_function

RATE = 20_000.0
#: 40 half-sines of 1 ms and peak 2 N, .05 s apart.
IMPULSE = 2.0 * 2.0 * 1e-3 / np.pi


@pytest.fixture
def record(tmp_path: Path) -> Path:
    time = np.arange(int(2.1 * RATE)) / RATE
    starts = 0.03 + 0.05 * np.arange(40)
    force = pulses(time, starts, np.full(40, 2.0), 1e-3)
    force += 0.01 * np.random.default_rng(30).standard_normal(len(time))
    cell = channel(force, 1.0 / RATE)
    train = EventTrain("neuron", np.cumsum(np.random.default_rng(31).exponential(0.04, 300)))
    write_recording(Recording({"cell": cell}, {"neuron": train}), tmp_path / "record.nc")
    return tmp_path / "record.nc"


def spikes(*arguments: str | Path) -> str:
    app = typer.Typer()
    app.command("spikes")(as_function(declared.Spikes))
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return str(done.output)


def test_remarks_of_the_import_are_counted_not_repeated(record: Path, tmp_path: Path) -> None:
    whole = open_recording(record)
    remarks = [f"cell: remark number {place}" for place in range(40)]
    told = replace(whole, attrs={**whole.attrs, "remarks": "\n".join(remarks)})
    write_recording(told, tmp_path / "told.nc")
    said = spikes(tmp_path / "told.nc", "--events", "neuron").replace("\n", " ")
    assert "told.nc: 40 remarks of its import" in said
    assert "remark number" not in said
    assert open_recording(tmp_path / "told.nc").remarks == tuple(remarks)


def test_masked_parts_of_an_observation_are_not_looked_at(tmp_path: Path) -> None:
    # a beat each second, none from 40 to 60 s because that span was masked: no gap
    beats = np.array([float(n) for n in range(1, 100) if not 40 < n < 60])
    for name, attrs in (("seen", {}), ("masked", {"masked": np.array([40.0, 60.0])})):
        train = EventTrain("beats", beats, (0.0, 100.0), attrs=attrs)
        write_recording(Recording({}, {"beats": train}), tmp_path / f"{name}.nc")
        spikes(tmp_path / f"{name}.nc", "-o", tmp_path / f"{name}_spikes.nc")
    with (
        xr.open_dataset(tmp_path / "seen_spikes.nc") as seen,
        xr.open_dataset(tmp_path / "masked_spikes.nc") as masked,
    ):
        assert seen.attrs["masked_spans"] == 0
        assert masked.attrs["masked_spans"] == 1
        assert masked["duration"].item() == pytest.approx(seen["duration"].item() - 20.0)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--events", "neuron", "--count-bin", "1e-9"), r"count_bin: expected at most 1e\+07 bins"),
        (("--events", "neuron", "--seams", "1e-9"), "seams: expected at most 10000 of them"),
        (
            ("--channel", "cell", "--period", "1e9"),
            "period: expected two samples at least and half the record",
        ),
    ],
)
def test_spans_of_another_scale_are_refused_before_they_fill_the_memory(
    record: Path, arguments: tuple[str, ...], told: str
) -> None:
    with pytest.raises(UsageError, match=told):
        spikes(record, *arguments)


def test_too_few_events_are_refused_with_the_file(tmp_path: Path) -> None:
    write_recording(Recording({}, {"beats": EventTrain("beats", np.array([1.0]))}), tmp_path / "few.nc")
    with pytest.raises(EstimationError, match=r"few\.nc: intervals: expected at least 3 events"):
        spikes(tmp_path / "few.nc")


def test_the_command_prints_writes_and_draws_what_the_spikes_are(record: Path, tmp_path: Path) -> None:
    output, figure = tmp_path / "spikes.nc", tmp_path / "spikes.png"
    told = spikes(
        record,
        "-o",
        output,
        "--figure",
        figure,
        "--mass",
        "0.02",
        "--restitution",
        "0.6",
        "--polarity",
        "positive",
    )
    assert "cell: 40 spikes; sure." in told
    assert "half-sine" in told
    assert "rigid impacts are an adequate model" in told
    assert figure.read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(output) as data:
        assert data.attrs["results_kind"] == "spikes"
        assert data.attrs["method"] == "threshold"
        assert data.attrs["source"] == "record.nc"
        assert data["spike_impulse"].values.mean() == pytest.approx(IMPULSE, rel=0.01)
        # V = J / (m (1 + r))
        assert data["spike_velocity"].values.mean() == pytest.approx(IMPULSE / 0.032, rel=0.01)
        assert float(data["contact_time_measure_feet"]) == pytest.approx(1e-3 / 0.05, rel=0.05)
        assert float(data["coefficient_of_variation"]) < 0.01
        assert all(variable.attrs["long_name"] for variable in data.variables.values())


def test_contact_time_and_the_sum_above_the_threshold_are_printed_for_each_spike(
    record: Path, tmp_path: Path
) -> None:
    told = spikes(record, "-o", tmp_path / "spikes.nc", "--threshold", "50%")
    lines = told[told.index("foot to foot (ms)") :].splitlines()
    rows = [line.split() for line in lines[2:]]  # behind the headings and their rule
    with xr.open_dataset(tmp_path / "spikes.nc") as data:
        for name, column, size in (("length", 1, 1e3), ("duration", 2, 1e3), ("impulse_above", 3, 1.0)):
            shown = [float(row[column]) for row in rows[:12]]
            assert shown == pytest.approx(size * data[f"spike_{name}"].values[:12], rel=1e-3)
    # a half-sine of 1 ms is above half of its peak for 2/3 ms, with cos(pi/6) of its impulse
    assert float(rows[0][2]) == pytest.approx(2.0 / 3.0, rel=0.03)
    assert float(rows[0][3]) == pytest.approx(IMPULSE * np.cos(np.pi / 6.0), rel=0.02)


def test_a_threshold_may_be_a_number_or_a_part_and_the_method_is_said(record: Path, tmp_path: Path) -> None:
    spikes(record, "-o", tmp_path / "part.nc", "--threshold", "25%")
    spikes(record, "-o", tmp_path / "number.nc", "--threshold", "0.5", "--hysteresis", "0.4")
    with xr.open_dataset(tmp_path / "part.nc") as part, xr.open_dataset(tmp_path / "number.nc") as number:
        assert float(part["threshold"]) == pytest.approx(0.5, rel=0.03)
        assert float(number["threshold"]) == 0.5
        assert float(number["lower_threshold"]) == 0.2
        assert part["spike_impulse"].values == pytest.approx(number["spike_impulse"].values, rel=1e-6)


def test_an_event_train_has_its_intervals_only(record: Path, tmp_path: Path) -> None:
    spikes(record, "--events", "neuron", "-o", tmp_path / "neuron.nc", "--figure", tmp_path / "neuron.png")
    with xr.open_dataset(tmp_path / "neuron.nc") as data:
        assert "spike_time" not in data
        assert float(data["rate"]) == pytest.approx(25.0, rel=0.2)
    assert (tmp_path / "neuron.png").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--threshold", "high"], "--threshold: expected a number, got 'high'"),
        (["--threshold", "150%"], "a part between 0 and 100 %"),
        (["--method", "cycle"], "method: expected one of auto"),
        (["--known-impulses", "1,x"], "--known-impulses: expected a number, got 'x'"),
        (["--sensitivity", "0.02"], "expected a channel in volts"),
        (["--mass", "0.1"], "Give --restitution too"),
        (["--waveform", "square"], "waveform: expected one of auto"),
    ],
)
def test_misuse_is_said_and_leaves_no_file(
    record: Path, tmp_path: Path, arguments: list[str], words: str
) -> None:
    with pytest.raises(UsageError) as refused:
        spikes(record, "-o", tmp_path / "spikes.nc", *arguments)
    assert words in refused.value.typed
    assert not (tmp_path / "spikes.nc").exists()


def test_an_unknown_channel_is_answered_with_the_names_there_are(record: Path) -> None:
    with pytest.raises(DatasetError, match="expected one of cell"):
        spikes(record, "--channel", "cel")


def test_the_defaults_of_the_dimension_are_those_of_the_report() -> None:
    assert (declared.EMBEDDING, declared.THEILER) == (dimension.EMBEDDING, dimension.THEILER)


def test_embedding_and_theiler_window_reach_the_dimension(record: Path, tmp_path: Path) -> None:
    spikes(record, "--events", "neuron", "--theiler", "5", "--embedding", "3", "-o", tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as found:
        assert found.attrs["theiler"] == 5
        assert found.sizes["embedding"] == 3
