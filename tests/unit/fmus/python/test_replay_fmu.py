"""Recorded channels come out of the Replay FMU as they were recorded, and drive bodies exactly."""

from __future__ import annotations

import importlib.util
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from fmpy import extract, simulate_fmu
from support.replay_records import (
    COUNT,
    DAY,
    GAP,
    INTERVAL,
    JUMP,
    SIGNALS,
    STEEPEST,
    Player,
    base_values,
    gappy_values,
    noise,
    uneven_times,
)
from support.tolerance import ROUNDING

from vibroimpact.analysis.recording import Channel, EventTrain, Quality, Recording, TimeAxis, write_recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description, validate
from vibroimpact.fmus.packaging.replay_fmu import REPLAY, ReplaySignal, build_replay
from vibroimpact.orchestrator.commands.cli import main

pytest.importorskip("pythonfmu")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_replay(SIGNALS, tmp_path_factory.mktemp("replay") / "record.fmu")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def opened(fmu: Path, tmp_path: Path) -> Iterator[Callable[..., Player]]:
    players: list[Player] = []

    def start(path: Path = fmu, start: float = 0.0, **parameters: float) -> Player:
        players.append(Player(path, tmp_path / f"unpacked{len(players)}", start, **parameters))
        return players[-1]

    yield start
    for player in players:
        player.fmu.freeInstance()


@pytest.fixture(scope="module")
def slave() -> ModuleType:
    """The slave's own module, as pythonfmu loads it."""
    spec = importlib.util.spec_from_file_location("replay_under_test", REPLAY / "replay.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# What it plays.


@pytest.mark.parametrize(
    ("name", "step"), [("base", 0.3697531 * INTERVAL), ("force", 7.3e-5), ("force", 4.1e-3)]
)
def test_between_samples_value_and_slope_are_those_of_the_straight_line(opened, name, step) -> None:  # type: ignore[no-untyped-def]
    player, signal = opened(), SIGNALS[name]
    times = np.arange(COUNT) * INTERVAL if signal.time is None else np.asarray(signal.time)
    values = np.asarray(signal.values)
    slopes = np.diff(values) / np.diff(times)
    while player.time + step < times[-1]:
        player.step(step)
        value, rate, valid = player.now(name)
        segment = int(np.searchsorted(times, player.time, "right")) - 1
        # the instants of the samples are rounded too
        room = ROUNDING * (1.0 + abs(slopes[segment]))
        assert value == pytest.approx(np.interp(player.time, times, values), abs=room)
        assert rate == pytest.approx(slopes[segment], rel=1e-9)
        assert valid


@pytest.mark.parametrize(("name", "start"), [("base", 0.0), ("late", DAY)])
def test_steps_of_the_sampling_interval_find_every_sample_and_the_slope_that_begins_there(  # type: ignore[no-untyped-def]
    opened, name, start
) -> None:
    # times are summed, so that they come to lie a little before and after the samples' own
    player, values = opened(start=start), np.asarray(SIGNALS[name].values)
    before = 0
    for index in range(COUNT - 1):
        value, rate, valid = player.now(name)
        # the sum of the steps drifts away from the samples by some 1e-5 of a step
        assert value == pytest.approx(
            values[index], abs=abs(player.time - start - index * INTERVAL) * STEEPEST + 1e-14
        )
        assert valid
        assert rate == pytest.approx((values[index + 1] - values[index]) / INTERVAL, rel=1e-9)
        before += player.time < start + index * INTERVAL
        player.step(INTERVAL)
    assert before > 10


def test_a_jump_is_as_steep_as_its_samples_are_close(opened) -> None:  # type: ignore[no-untyped-def]
    player, values = opened(), base_values()
    rates = [player.at("base", (JUMP + k) * INTERVAL)[1] for k in (-2, -1, 0)]
    assert rates[1] == pytest.approx((values[JUMP] - values[JUMP - 1]) / INTERVAL, rel=1e-9)
    assert rates[1] > 5.0 * max(abs(rates[0]), abs(rates[2]))


def test_just_before_a_sample_the_value_is_of_what_was_and_the_slope_of_what_comes(opened) -> None:  # type: ignore[no-untyped-def]
    player, values = opened(), base_values()
    value, rate, valid = player.at("base", (JUMP - 2e-5) * INTERVAL)
    assert value == pytest.approx(values[JUMP] - 2e-5 * (values[JUMP] - values[JUMP - 1]), abs=1e-12)
    assert rate == pytest.approx((values[JUMP + 1] - values[JUMP]) / INTERVAL)
    assert valid


@pytest.mark.parametrize("name", ["base", "force"])
def test_times_may_come_in_any_order(opened, name) -> None:  # type: ignore[no-untyped-def]
    player, signal = opened(), SIGNALS[name]
    times = np.arange(COUNT) * INTERVAL if signal.time is None else np.asarray(signal.time)
    for time in np.random.default_rng(8).uniform(times[0], times[-1], 300):
        assert player.at(name, time)[0] == pytest.approx(
            np.interp(time, times, np.asarray(signal.values)), rel=1e-9
        )


def test_a_gap_is_bridged_and_not_valid(opened) -> None:  # type: ignore[no-untyped-def]
    player, values = opened(), gappy_values()
    left, right = GAP
    slope = (values[right] - values[left]) / ((right - left) * INTERVAL)
    assert player.at("gappy", left * INTERVAL) == (values[left], pytest.approx(slope), True)
    for place in (left + 0.5, left + 1.0, left + 17.25, right - 0.01):
        value, rate, valid = player.at("gappy", place * INTERVAL)
        assert value == pytest.approx(values[left] + slope * (place - left) * INTERVAL)
        assert (rate, valid) == (pytest.approx(slope), False)
    value, rate, valid = player.at("gappy", right * INTERVAL)
    assert (value, valid) == (pytest.approx(values[right]), True)
    assert rate == pytest.approx((values[right + 1] - values[right]) / INTERVAL)


@pytest.mark.parametrize(("name", "first", "last"), [("base", 0, COUNT - 1), ("gappy", 2, COUNT - 4)])
def test_outside_the_record_the_last_value_is_held_without_slope_and_not_valid(
    opened, name, first, last
) -> None:  # type: ignore[no-untyped-def]
    player, values = opened(start=-1.0), np.asarray(SIGNALS[name].values)
    assert player.now(name) == (values[first], 0.0, False)
    assert player.at(name, (first - 0.5) * INTERVAL) == (values[first], 0.0, False)
    assert player.at(name, last * INTERVAL) == (values[last], 0.0, True)
    assert player.at(name, (last + 0.5) * INTERVAL) == (values[last], 0.0, False)
    assert player.at(name, 1e9) == (values[last], 0.0, False)


def test_gain_offset_and_shift_are_applied(opened) -> None:  # type: ignore[no-untyped-def]
    shift = 0.0125
    plain, changed = opened(), opened(base_gain=-2.0, base_offset=3.0, time_shift=shift, gappy_gain=1.0)
    for time in (0.02, 0.05, 0.0901):
        value, rate, valid = plain.at("base", time)
        expected = (pytest.approx(3.0 - 2.0 * value), pytest.approx(-2.0 * rate), valid)
        assert changed.at("base", time + shift) == expected


def test_a_step_may_be_repeated_to_another_end(opened) -> None:  # type: ignore[no-untyped-def]
    once, again = opened(), opened()
    again.fmu.doStep(0.0, 0.15)
    again.now("force")
    again.fmu.doStep(0.0, 0.03)
    once.fmu.doStep(0.0, 0.03)
    assert again.now("force") == once.now("force")


def test_fmpy_simulates_it_alone(fmu: Path) -> None:
    result = simulate_fmu(
        str(fmu), start_time=0.0, stop_time=0.1, step_size=INTERVAL, output_interval=INTERVAL, validate=True
    )
    assert np.array_equal(result["base"][:300], base_values()[:300])
    assert result["base_valid"][:300].all()


# One process, several of them.


def test_two_records_in_one_process_keep_apart(opened, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    other = build_replay({"base": ReplaySignal.evenly([5.0, 5.5, 4.0], "m/s2", 0.1)}, tmp_path / "other.fmu")
    one, two, again = opened(), opened(other), opened()
    values = base_values()
    assert one.at("base", 30 * INTERVAL)[0] == pytest.approx(values[30])
    assert two.at("base", 0.05) == (pytest.approx(5.25), pytest.approx(5.0), True)
    assert again.at("base", 40 * INTERVAL)[0] == pytest.approx(values[40])
    # what one instance is asked leaves the others where they are
    assert one.now("base")[0] == pytest.approx(values[30])
    assert two.now("base")[0] == pytest.approx(5.25)


def test_exchanged_signal_files_are_played(opened, fmu: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder = Path(extract(str(fmu), str(tmp_path / "unpacked0")))
    values = np.arange(COUNT, dtype="<f8")
    values.tofile(folder / "resources" / "signals" / "channel_base.f64")
    player = opened(fmu)
    assert player.at("base", 10.5 * INTERVAL) == (pytest.approx(10.5), pytest.approx(1.0 / INTERVAL), True)


def test_equal_signals_make_equal_files(fmu: Path, tmp_path: Path) -> None:
    reordered = dict(reversed(SIGNALS.items()))
    assert build_replay(reordered, tmp_path / "again.fmu").read_bytes() == fmu.read_bytes()


def test_instances_share_one_copy_of_the_samples_until_a_file_changes(
    slave, fmu: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    # pythonfmu keeps every instance's object for good: data of their own would be a leak
    folder = Path(extract(str(fmu), str(tmp_path / "shared"))) / "resources" / "signals"
    first = slave.load_signals(folder)
    assert slave.load_signals(folder) is first
    (folder / "times_1.f64").touch()
    assert slave.load_signals(folder) is not first


# What it says of itself.


@pytest.mark.slow
def test_the_description_is_valid_and_says_what_importers_need(fmu: Path) -> None:
    assert validate(fmu) == ()
    assert check_fmu(fmu) == ()
    description = read_description(fmu)
    assert not description.coSimulation.canGetAndSetFMUstate
    assert all(unknown.dependencies == [] for unknown in description.outputs)
    variables = {v.name: v for v in description.modelVariables}
    kinds = {
        name: (v.causality, v.type, v.start)
        for name, v in variables.items()
        if name.startswith(("base", "time"))
    }
    assert kinds == {
        "base": ("output", "Real", None),
        "base_rate": ("output", "Real", None),
        "base_valid": ("output", "Boolean", None),
        "base_gain": ("parameter", "Real", "1"),
        "base_offset": ("parameter", "Real", "0"),
        "time_shift": ("parameter", "Real", "0"),
    }
    units = {name: variables[name].unit for name in ("base", "base_rate", "gappy", "force_rate", "late")}
    assert units == {
        "base": "m/s2",
        "base_rate": "m/s3",
        "gappy": "9.80665 m/s2",
        "force_rate": "N/s",
        "late": None,
    }
    gravity = next(u.baseUnit for u in description.unitDefinitions if u.name == "9.80665 m/s2")
    assert (gravity.factor, gravity.m, gravity.s) == (9.80665, 1, -2)
    experiment = description.defaultExperiment
    assert float(experiment.stepSize) == pytest.approx(INTERVAL)
    assert float(experiment.stopTime) == pytest.approx(DAY + (COUNT - 1) * INTERVAL)


# What it refuses.

GOOD = [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ({}, "expected 1 to 256 channels, got 0"),
        ({"a b": ReplaySignal.evenly(GOOD, "m", 1.0)}, "'a b': expected a name"),
        ({"a": ReplaySignal.evenly([1.0], "m", 1.0)}, "a: values: expected an array of 2 samples or more"),
        ({"a": ReplaySignal.evenly([math.nan] * 3, "m", 1.0)}, "no number at all"),
        ({"a": ReplaySignal.evenly([0.0, math.inf], "m", 1.0)}, "got infinity"),
        ({"a": ReplaySignal.evenly(GOOD, "furlong", 1.0)}, "a: unit: expected a product of kg, m"),
        ({"a": ReplaySignal.evenly(GOOD, "m", 0.0)}, "a: interval: expected an interval > 0"),
        ({"a": ReplaySignal.evenly(GOOD, "m", 1e-9, start=1e12)}, "a: interval: expected an interval > 0"),
        ({"a": ReplaySignal([0.0, 1.0, 1.0], GOOD)}, "a: time: expected a finite instant for each value"),
        ({"a": ReplaySignal([0.0, 1.0], GOOD)}, "a: time: expected a finite instant for each value"),
        ({"a": ReplaySignal(None, GOOD)}, "expected either time or interval, got both or none"),
        (dict.fromkeys(("a", "a_rate"), ReplaySignal(GOOD, GOOD)), "a_rate is taken by a"),
        (dict.fromkeys(("a", "A"), ReplaySignal(GOOD, GOOD)), "is taken by"),
        ({"time_shift": ReplaySignal(GOOD, GOOD)}, "taken by all channels"),
    ],
)
def test_signals_that_contradict_themselves_are_refused(
    signals: dict[str, ReplaySignal], message: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="replay: ") as caught:
        build_replay(signals, tmp_path / "x.fmu")
    assert message in str(caught.value)
    assert not (tmp_path / "x.fmu").exists()


def damaged_header(text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "signals.json").write_text(text)


HEADER = {
    "format": "vibroimpact signals 1",
    "axes": {"1": {"count": 3, "start": 0.0, "interval": 0.1}},
    "channels": {"a": {"axis": "1"}},
}


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda folder: (folder / "channel_a.f64").write_bytes(b"\0" * 20),
            "expected 24 bytes, 3 little-endian",
        ),
        (lambda folder: (folder / "channel_a.f64").unlink(), "got no file"),
        (lambda folder: np.full(3, np.nan).tofile(folder / "channel_a.f64"), "no number at all"),
        (lambda folder: np.full(3, np.inf).tofile(folder / "channel_a.f64"), "got infinity"),
        (damaged_header("{"), "expected JSON"),
        (damaged_header("[1]"), 'expected "vibroimpact signals 1"'),
        (damaged_header(json.dumps(HEADER | {"format": "2"})), 'expected "vibroimpact signals 1"'),
        (damaged_header(json.dumps(HEADER | {"channels": {}})), "expected tables"),
        (damaged_header(json.dumps(HEADER | {"channels": {"a": {"axis": "2"}}})), "axis: expected one of 1"),
        (damaged_header(json.dumps(HEADER | {"axes": {"1": {"count": 1e9}}})), "count: expected 2 to"),
        (
            damaged_header(json.dumps(HEADER | {"axes": {"1": {"count": 3}}})),
            "times_1.f64: expected 24 bytes",
        ),
        (
            damaged_header(json.dumps(HEADER | {"axes": {"1": {"count": 3, "start": 0, "interval": 0}}})),
            "an interval > 0",
        ),
    ],
)
def test_damaged_signal_files_are_refused_by_name(  # type: ignore[no-untyped-def]
    slave, damage: Callable[[Path], object], message: str, tmp_path: Path
) -> None:
    (tmp_path / "signals.json").write_text(json.dumps(HEADER))
    np.array([1.0, 2.0, 3.0]).tofile(tmp_path / "channel_a.f64")
    slave.load_signals(tmp_path)
    damage(tmp_path)
    with pytest.raises(ValueError, match="expected") as caught:
        slave.load_signals(tmp_path)
    assert message in str(caught.value)


# The command.


def recording(folder: Path) -> Path:
    """Write a recording: `base` in units of gravity with two samples missing, `board` on its own uneven axis."""
    values, quality = noise(6, 50), np.zeros(50, np.uint8)
    values[10:12], quality[10:12] = np.nan, int(Quality.missing)
    even = TimeAxis(np.arange(50) * INTERVAL, INTERVAL)
    uneven = TimeAxis(uneven_times()[:50] + 1.0, None)
    channels = {
        "base": Channel("base", values, "9.80665 m s-2", even, quality),
        "board": Channel("board", noise(7, 50), "0.001 V", uneven, np.zeros(50, np.uint8)),
    }
    write_recording(Recording(channels), folder / "recording.nc")
    return folder / "recording.nc"


def exit_code(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as caught:
        main([*map(str, arguments)])
    return int(caught.value.code or 0)


def test_the_command_does_not_write_over_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = recording(tmp_path)
    before = source.read_bytes()
    assert exit_code("fmu", "replay", source, "-o", source) == 2
    assert "expected a new file, got one that is read" in capsys.readouterr().err
    assert source.read_bytes() == before


def test_the_command_makes_an_fmu_in_si_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], opened: Callable[..., Player]
) -> None:
    source = recording(tmp_path)
    assert exit_code("fmu", "replay", source, "--channel", "base", "--si", "-o", tmp_path / "a.fmu") == 0
    assert "base: 50 samples in m s-2" in (told := capsys.readouterr().out)
    assert "2 missing" in told
    variables = {v.name: v.unit for v in read_description(tmp_path / "a.fmu").modelVariables}
    assert variables["base"] == "m/s2"
    assert not [name for name in variables if name.startswith("board")]
    value = opened(tmp_path / "a.fmu").at("base", 20 * INTERVAL)[0]
    assert value == pytest.approx(9.80665 * noise(6, 50)[20])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("recording.nc", "--channel", "bsae", "-o", "a.fmu"), 'Did you mean "base"?'),
        (("events.nc", "-o", "a.fmu"), "events.nc: expected a channel to play, got none"),
        (("absent.nc", "-o", "a.fmu"), "absent.nc: expected a dataset file"),
        (
            ("recording.nc", "-o", "recording.nc/a.fmu"),
            "recording.nc/a.fmu: expected a place where a file can be written",
        ),
    ],
)
def test_the_command_refuses_with_one_line(
    arguments: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    recording(tmp_path)
    write_recording(
        Recording({}, {"beats": EventTrain("beats", np.array([0.0, 1.0]))}), tmp_path / "events.nc"
    )
    monkeypatch.chdir(tmp_path)
    assert exit_code("fmu", "replay", *arguments) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line


def test_without_pythonfmu_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "pythonfmu" else find_spec(name)
    )
    with pytest.raises(UsageError, match=r"pip install 'vibroimpact\[python-fmus\]'"):
        build_replay(SIGNALS, tmp_path / "x.fmu")
