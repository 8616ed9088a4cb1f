"""Recorded channels come out of the Replay FMU as they were recorded, and drive bodies exactly."""

from __future__ import annotations

import math
import shutil
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from support.component_fmu import VERSIONS
from support.fmpy_checks import validate
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
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.replay_fmu import FOLDER, ReplaySignal, build_replay
from vibroimpact.orchestrator.commands.cli import main


@pytest.fixture(scope="module", params=VERSIONS)
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_replay(SIGNALS, tmp_path_factory.mktemp("replay") / "record.fmu", fmi=request.param)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def opened(fmu: Path) -> Iterator[Callable[..., Player]]:
    players: list[Player] = []

    def start(path: Path = fmu, start: float = 0.0, **parameters: float) -> Player:
        players.append(Player(path, start, **parameters))
        return players[-1]

    yield start
    for player in players:
        player.free()


# Playback.


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
    # summed times lie a little before and after the instants of the samples
    player, values = opened(start=start), np.asarray(SIGNALS[name].values)
    before = 0
    for index in range(COUNT - 1):
        value, rate, valid = player.now(name)
        # the sum of the steps drifts from the samples by about 1e-5 of a step
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
    player, signal = opened(start=-1.0), SIGNALS[name]
    times = np.arange(COUNT) * INTERVAL if signal.time is None else np.asarray(signal.time)
    for time in np.random.default_rng(8).uniform(times[0], times[-1], 300):
        value = player.at(name, time)[0]
        assert value == pytest.approx(np.interp(player.time, times, np.asarray(signal.values)), abs=1e-10)


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
    assert player.at(name, last * INTERVAL) == (pytest.approx(values[last]), 0.0, True)
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


def test_a_state_is_its_time_and_its_parameters_and_another_instance_goes_on_from_it(opened) -> None:  # type: ignore[no-untyped-def]
    one = opened(base_gain=3.0)
    kept = one.at("base", 20.25 * INTERVAL)
    state = one.serialized()
    assert len(state) < 400  # for 4 channels of 600 samples
    assert one.at("base", 90.5 * INTERVAL) != kept
    one.restore(state)
    assert one.now("base") == kept
    other = opened()
    other.restore(state)
    assert other.now("base") == kept
    other.time = 20.25 * INTERVAL
    other.step(INTERVAL)
    one.time = 20.25 * INTERVAL
    one.step(INTERVAL)
    assert other.now("base") == one.now("base") != kept


def test_a_state_of_a_recording_with_other_channels_is_refused(opened, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    other = opened(build_replay({"base": SIGNALS["base"]}, tmp_path / "other.fmu"))
    for one, another in ((opened(), other), (other, opened())):
        state = another.serialized()
        with pytest.raises(FMICallException):
            one.restore(state)
    assert any("a state that fits the FMU's resources" in message for message in other.messages)


def test_steps_that_do_not_go_forward_are_refused(opened) -> None:  # type: ignore[no-untyped-def]
    player = opened()
    for size in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(FMICallException):
            player.step(size)
        player.time = 0.0
    assert "expected a finite number > 0" in player.messages[0]


@pytest.mark.parametrize("name", ["base_gain", "gappy_offset", "time_shift"])
def test_a_parameter_that_is_no_number_is_refused(opened, name) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(FMICallException):
        opened(**{name: math.nan})


def test_fmpy_simulates_it_alone(fmu: Path) -> None:
    result = simulate_fmu(
        str(fmu), start_time=0.0, stop_time=0.1, step_size=INTERVAL, output_interval=INTERVAL, validate=True
    )
    assert np.array_equal(result["base"][:300], base_values()[:300])
    assert result["base_valid"][:300].all()


# Several instances in one process.


def test_two_records_in_one_process_keep_apart(opened, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    other = build_replay({"base": ReplaySignal.evenly([5.0, 5.5, 4.0], "m/s2", 0.1)}, tmp_path / "other.fmu")
    one, two, again = opened(), opened(other), opened()
    values = base_values()
    assert one.at("base", 30 * INTERVAL)[0] == pytest.approx(values[30])
    assert two.at("base", 0.05) == (pytest.approx(5.25), pytest.approx(5.0), True)
    assert again.at("base", 40 * INTERVAL)[0] == pytest.approx(values[40])
    # requests to one instance leave the others unchanged
    assert one.now("base")[0] == pytest.approx(values[30])
    assert two.now("base")[0] == pytest.approx(5.25)


def changed(fmu: Path, target: Path, files: dict[str, bytes | None]) -> Path:
    """Write an FMU with other signal files; None removes a file."""
    with zipfile.ZipFile(fmu) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for name, content in files.items():
        members.pop(f"{FOLDER}/{name}", None)
        if content is not None:
            members[f"{FOLDER}/{name}"] = content
    write_fmu(target, members)
    return target


def test_exchanged_signal_files_are_played(opened, fmu: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    values = np.arange(COUNT, dtype="<f8").tobytes()
    player = opened(changed(fmu, tmp_path / "x.fmu", {"channel_base.f64": values}))
    assert player.at("base", 10.5 * INTERVAL) == (pytest.approx(10.5), pytest.approx(1.0 / INTERVAL), True)


def test_equal_signals_make_equal_files_and_others_another_token(tmp_path: Path) -> None:
    first, again = (
        build_replay(s, tmp_path / n) for s, n in ((SIGNALS, "1"), (dict(reversed(SIGNALS.items())), "2"))
    )
    assert first.read_bytes() == again.read_bytes()
    louder = build_replay(
        SIGNALS | {"base": ReplaySignal.evenly(2.0 * base_values(), "m s-2", INTERVAL)}, tmp_path / "3"
    )
    tokens = {read_description(path).instantiationToken for path in (first, louder)}
    assert len(tokens) == 2


# Description of the FMU.


def test_the_description_is_valid_and_says_what_importers_need(fmu: Path) -> None:
    assert validate(fmu) == ()
    assert check_fmu(fmu) == ()
    description = read_description(fmu)
    assert description.coSimulation.canGetAndSetFMUstate
    assert all(unknown.dependencies == [] for unknown in description.outputs)
    variables = {v.name: v for v in description.modelVariables}
    kinds = {
        name: (v.causality, v.type.replace("Real", "Float64"), v.start)
        for name, v in variables.items()
        if name.startswith(("base", "time_"))
    }
    assert kinds == {
        "base": ("output", "Float64", None),
        "base_rate": ("output", "Float64", None),
        "base_valid": ("output", "Boolean", None),
        "base_gain": ("parameter", "Float64", "1.0"),
        "base_offset": ("parameter", "Float64", "0.0"),
        "time_shift": ("parameter", "Float64", "0.0"),
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


# Refusals.

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
        ({"Time": ReplaySignal(GOOD, GOOD)}, "taken by all channels"),
    ],
)
def test_signals_that_contradict_themselves_are_refused(
    signals: dict[str, ReplaySignal], message: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="replay: ") as caught:
        build_replay(signals, tmp_path / "x.fmu")
    assert message in str(caught.value)
    assert not (tmp_path / "x.fmu").exists()


LIST = "vibroimpact signals 2\naxis even 3\naxis listed 3\nchannel a 1\nchannel b 2\n"
TWO = {
    "a": ReplaySignal.evenly([1.0, 2.0, 4.0], "m", 0.5),
    "b": ReplaySignal([0.0, 0.1, 1.0], [1.0, 2.0, 4.0], "N"),
}


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = build_replay(TWO, tmp_path_factory.mktemp("pair") / "pair.fmu")
    with zipfile.ZipFile(path) as archive:
        assert archive.read(f"{FOLDER}/signals.txt").decode() == LIST
    return path


def numbers(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)


def listed(old: str, new: str) -> dict[str, bytes | None]:
    assert old in LIST
    return {"signals.txt": LIST.replace(old, new).encode()}


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ({"channel_a.f64": numbers(1.0, 2.0)}, "channel_a.f64: expected 24 bytes, 3 little-endian float64"),
        ({"channel_a.f64": numbers(1.0, 2.0, 3.0) + b"x"}, "channel_a.f64: expected 24 bytes"),
        ({"channel_a.f64": None}, "channel_a.f64: expected 24 bytes, 3 little-endian float64, got no file"),
        ({"channel_a.f64": numbers(*[math.nan] * 3)}, "no number at all"),
        ({"channel_a.f64": numbers(1.0, math.inf, 2.0)}, "got infinity"),
        ({"axis_1.f64": numbers(0.0, 0.0)}, "axis_1.f64: expected a finite start and an interval > 0 s"),
        ({"axis_1.f64": numbers(math.nan, 0.5)}, "axis_1.f64: expected a finite start"),
        ({"axis_1.f64": numbers(0.0, 1e308)}, "axis_1.f64: expected a finite start"),
        ({"axis_2.f64": numbers(0.0, 1.0, 1.0)}, "axis_2.f64: expected finite times that ascend strictly"),
        ({"axis_2.f64": numbers(0.0, math.nan, 1.0)}, "axis_2.f64: expected finite times"),
        ({"axis_2.f64": numbers(-math.inf, 0.0, 1.0)}, "axis_2.f64: expected finite times"),
        (listed("signals 2", "signals 1"), "line 1: expected `vibroimpact signals 2`"),
        (listed("even 3", "even 1"), "line 2: expected `axis even COUNT`"),
        (listed("even 3", "even 999999999"), "channel_a.f64: expected at most 100000000 numbers in all"),
        (listed("listed 3", "listed 999999999"), "axis_2.f64: expected at most 100000000 numbers in all"),
        (listed("listed 3", "listed 99999000"), "axis_2.f64: expected 799992000 bytes"),
        (listed("listed 3", "listed 99999999999999999999"), "line 3: expected"),
        (listed("a 1", "../a 1"), "line 4: expected"),
        (listed("a 1", "a 3"), "line 4: expected `axis even COUNT`"),
        (listed("a 1", "a 1 x"), "line 4: expected"),
        (listed("b 2\n", "b 2\n\n"), "line 6: expected"),
        (listed("channel b 2\n", ""), "expected the 2 channels of the model description, got 1"),
        (listed("channel a 1\nchannel b 2\n", ""), "expected at least one channel, got none"),
        (listed("b 2\n", "b 2\n" + "axis even 3\n" * 300), "axis_3.f64: expected 16 bytes"),
        (listed("b 2\n", "b 2\n" + "channel a 1\n" * 300), "expected at most 256 of these"),
        (listed("a 1", "a" * 5000), "line 4: expected"),
        ({"signals.txt": b"\xff\x00" * 500}, "line 1: expected"),
        ({"signals.txt": None}, "expected the signal files of a recording, got none"),
    ],
)
def test_damaged_signal_files_are_refused_by_name(
    pair: Path, damage: dict[str, bytes | None], message: str, tmp_path: Path
) -> None:
    messages: list[str] = []

    class Failing(Player):
        def _log3(self, *arguments: Any) -> None:
            messages.append(arguments[-1].decode())

    with pytest.raises(Exception, match=r"nstanti|fmi3ExitInitializationMode"):
        Failing(changed(pair, tmp_path / "x.fmu", damage)).free()
    (text,) = messages
    assert message in text


def test_the_component_without_a_recording_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="vibroimpact fmu replay"):
        export_fmu("replay", tmp_path / "x.fmu")
    shutil.copy(fmu_path("Replay"), tmp_path / "bare.fmu")
    with pytest.raises(FMICallException):
        Player(tmp_path / "bare.fmu")


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
    assert "base: 50 samples in m s-2" in (text := capsys.readouterr().out)
    assert "2 missing" in text
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
