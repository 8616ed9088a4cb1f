"""Replays of recordings that the tests make themselves, so that the truth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.replay_scenes import BOARD, Floats, G, channel, pulse, written
from support.structure import Modes, Structure
from support.tolerance import PARTITION

from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.recording import Quality, open_signals
from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.errors import DatasetError, EstimationError, SceneError, UsageError
from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.replay import (
    Replayer,
    ReplayFit,
    compare_motion,
    fit_replay,
    opened_replays,
    scores_of,
)
from vibroimpact.orchestrator.replay.covariance import covariance_of, drawn_noise
from vibroimpact.orchestrator.replay.drive import drive_of, quiet_level, step_instants
from vibroimpact.orchestrator.replay.fit import fit_keys
from vibroimpact.orchestrator.replay.output import Replayed, replay_dataset
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, parse_scene

TIME = 2e-5 * np.arange(1500)


def scene(text: str = BOARD) -> Scene:
    return parse_scene(text, "board.toml")


def simulated(values: dict[str, float], folder: Path, base: Floats | None = None) -> Floats:
    """Return the readings of the scene's board, m/s^2."""
    drive = pulse(TIME) if base is None else base
    path = written(folder / "drive.nc", channel("base", TIME, drive), channel("board", TIME, pulse(TIME)))
    with opened_replays(scene(BOARD + "drive_offset = 0.0"), [path]) as (replayer,):
        return replayer.simulate(values).readings[0]


def recorded(folder: Path, lag: float = 0.0031, noise: float = 2.0) -> Path:
    """Write a recording of the board: inverted, later, noisy, in g, with another trigger, with an offset."""
    truth = {"body.frequency": 823.0, "body.damping_ratio": 0.017, "sensor.gain": 1.1}
    reading = simulated(truth, folder)
    random = np.random.default_rng(5)
    shifted = np.interp(TIME - lag, TIME, reading, left=0.0)
    board = (-shifted + random.normal(0.0, noise, len(TIME)) + 11.0) / G
    base = pulse(TIME) / G + 0.4
    return written(
        folder / "board.nc",
        channel("base", TIME, base, "9.80665 m s-2", "base"),
        channel("board", TIME, board, "9.80665 m s-2", "board"),
    )


def test_a_replayed_simulation_gives_back_the_simulation(tmp_path: Path) -> None:
    reading = simulated({}, tmp_path)
    path = written(
        tmp_path / "own.nc",
        channel("base", TIME, pulse(TIME), trigger="one"),
        channel("board", TIME, reading, trigger="one"),
    )
    with opened_replays(scene(), [path]) as (replayer,):
        (comparison,) = compare_motion(replayer, replayer.simulate())
    assert comparison.variance >= 99.9999
    assert comparison.alignment.lag == 0.0


def test_the_drive_is_followed_exactly_between_its_samples(tmp_path: Path) -> None:
    # reference: the mode alone, through the C interface, with value and slope of every sample
    base = pulse(TIME)
    reading = simulated({"sensor.gain": 1.0}, tmp_path, base)
    natural = 2.0 * np.pi * 800.0
    modes = beam_modes("clamped_clamped", 1)
    share = float(modes.participation[0] * modes.shapes([0.5])[0, 0])
    slopes = np.append(np.diff(base) / np.diff(TIME), 0.0)
    motion = [0.0]
    with Structure(Modes([natural], 0.01)) as body:
        for i in range(len(TIME) - 1):
            body.advance(TIME[i + 1] - TIME[i], held=-base[i], held_rate=-slopes[i])
            relative = -base[i + 1] - natural**2 * body.displacement[0] - 0.02 * natural * body.velocity[0]
            motion.append(base[i + 1] + share * relative)
    np.testing.assert_allclose(reading[1:], motion[1:], atol=PARTITION * np.abs(reading).max())


def test_coupled_by_a_replay_fmu_and_fused_are_one_motion(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    with (
        Replayer(scene(), open_signals(path)) as fused,
        Replayer(scene(), open_signals(path), execution="coupled") as coupled,
    ):
        alone, together = fused.simulate().readings[0], coupled.simulate().readings[0]
        assert set(coupled.hashes) == {"body", "replay"}
    np.testing.assert_allclose(together, alone, atol=1e-9 * np.abs(alone).max())


def test_a_fit_finds_the_truth_within_its_errors_through_lag_polarity_and_offset(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    keys = fit_keys(scene(), "body.frequency, body.damping_ratio, sensor.gain")
    with opened_replays(scene(), [path]) as replayers:
        fit = fit_replay(replayers, keys)
    (comparison,) = fit.comparisons[0]
    assert comparison.alignment.polarity == -1
    assert comparison.alignment.lag == pytest.approx(0.0031, abs=4.0 * comparison.alignment.lag_error)
    assert comparison.offset == pytest.approx(11.0, abs=0.5)
    np.testing.assert_array_less(np.abs(fit.values - [823.0, 0.017, 1.1]), 4.0 * fit.standard_error)
    np.testing.assert_array_less(fit.standard_error, [0.1, 1e-4, 0.01])
    assert comparison.variance > 99.9


def test_a_fit_far_off_begins_at_the_measured_frequency(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    far = scene(BOARD.replace("frequency = 800.0", "frequency = 300.0"))
    with opened_replays(far, [path]) as replayers:
        fit = fit_replay(replayers, ["body.frequency", "body.damping_ratio", "sensor.gain"])
    assert fit.numbers["body.frequency"] == pytest.approx(823.0, abs=0.5)


def test_numbers_that_change_the_motion_alike_are_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    # for a board that its base moves, stiffness changes nothing but the frequency
    stiff = scene(BOARD.replace("frequency = 800.0", "flexural_rigidity = 60.0"))
    with opened_replays(stiff, [path]) as replayers, pytest.raises(EstimationError, match="tell apart"):
        fit_replay(replayers, ["body.flexural_rigidity", "body.mass_per_length"])


def test_the_gain_of_amplitude_dependence_shows_where_there_is_one(tmp_path: Path) -> None:
    truth = {"body.frequency": 823.0, "body.frequency_slope": -200.0}
    curved = scene(BOARD + "drive_offset = 0.0").at(truth)
    plain = written(
        tmp_path / "drive.nc", channel("base", TIME, pulse(TIME)), channel("board", TIME, pulse(TIME))
    )
    with opened_replays(curved, [plain]) as (replayer,):
        reading = replayer.simulate().readings[0]
    path = written(
        tmp_path / "own.nc",
        channel("base", TIME, pulse(TIME), trigger="one"),
        channel("board", TIME, reading, trigger="one"),
    )
    linear, bent = ["body.frequency", "body.damping_ratio"], ["body.frequency", "body.frequency_slope"]
    found = []
    for keys in (linear, bent):
        start = scene().at({key: scene().value(key) for key in keys})
        with opened_replays(start, [path]) as replayers:
            fit = fit_replay(replayers, keys)
        found.append(fit.comparisons[0][0].variance)
    assert found[0] < 99.0 < 99.999 < found[1]
    assert fit.numbers["body.frequency_slope"] == pytest.approx(-200.0, rel=1e-3)


def test_gaps_are_bridged_clipped_samples_not_scored_and_both_are_said(tmp_path: Path) -> None:
    reading = simulated({}, tmp_path)
    base, board = (
        channel("base", TIME, pulse(TIME), trigger="one"),
        channel("board", TIME, reading, trigger="one"),
    )
    base.values[900:910] = np.nan
    base.quality[900:910] = Quality.missing
    limit = 0.8 * np.abs(reading).max()
    clipped = np.abs(reading) > limit
    board.values[:] = np.clip(reading, -limit, limit)
    board.quality[clipped] = Quality.clipped
    path = written(tmp_path / "holes.nc", base, board)
    with opened_replays(scene(), [path]) as (replayer,):
        (comparison,) = compare_motion(replayer, replayer.simulate())
        remarks = replayer.remarks
    assert comparison.counts["clipped"] == np.count_nonzero(clipped) > 5
    assert "base: 10 missing samples were bridged by straight lines" in remarks
    assert comparison.variance > 99.999


def test_a_record_without_an_event_is_not_scored(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    quiet = written(
        tmp_path / "quiet.nc",
        channel("base", TIME, np.random.default_rng(1).normal(0.0, 1.0, len(TIME))),
        channel("board", TIME, np.random.default_rng(2).normal(0.0, 1.0, len(TIME))),
    )
    with opened_replays(scene(), [path, quiet]) as replayers:
        comparisons = [compare_motion(replayer, replayer.simulate()) for replayer in replayers]
        scores = scores_of(replayers, comparisons, 1)
    assert np.isnan(scores.others["quiet.nc"])
    assert any("there is nothing to be scored" in remark for remark in scores.remarks)


def test_a_channel_of_another_kind_cannot_drive_or_be_compared(tmp_path: Path) -> None:
    volts = channel("base", TIME, pulse(TIME), "V")
    with pytest.raises(
        DatasetError, match=r"base: expected a channel in m s-2 to drive base_acceleration, got V"
    ):
        drive_of(volts, "base_acceleration")
    path = written(
        tmp_path / "v.nc", channel("base", TIME, pulse(TIME)), channel("board", TIME, pulse(TIME), "V")
    )
    plain = scene(BOARD.replace("sensor.acceleration", "acceleration"))
    with pytest.raises(
        DatasetError, match=r"board: expected a channel in m s-2 to compare with beam.acceleration"
    ):
        Replayer(plain, open_signals(path))
    with Replayer(scene(), open_signals(path)) as replayer:  # a sensor's gain may be in V per m/s^2
        assert replayer.readings[0].same_kind is False


def test_a_scene_without_replay_is_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    text = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 1\n"
    with pytest.raises(SceneError, match=r"replay: expected a \[replay\] table"):
        Replayer(parse_scene(text, "free.toml"), open_signals(path))


def test_the_level_of_rest_is_found_wherever_the_event_is() -> None:
    time = np.linspace(0.0, 1.0, 2001)
    for centre in (0.0, 0.5, 1.0):
        record = 3.0 + 100.0 * np.exp(-(((time - centre) / 0.05) ** 2))
        assert quiet_level(record) == pytest.approx(3.0, abs=1e-6)
    assert quiet_level(5.0 + np.sin(2.0 * np.pi * 20.0 * time[:-1])) == pytest.approx(5.0, abs=1e-9)


def test_steps_stop_at_every_sample_of_the_drive_and_are_never_too_long() -> None:
    drive = np.array([0.0, 0.1, 0.35, 0.5])
    instants = step_instants(drive, 0.04, 0.7)
    assert set(drive) <= set(instants)
    assert np.diff(instants).max() <= 0.04 * (1.0 + 1e-9)
    assert instants[-1] == pytest.approx(0.7, abs=0.04)


def test_the_dataset_of_a_replay_holds_signals_scores_and_the_fit(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    with opened_replays(scene(), [path]) as replayers:
        fit = fit_replay(replayers, ["sensor.gain"])
        motion = replayers[0].simulate(fit.numbers)
        replays = [Replayed(replayers[0], motion, compare_motion(replayers[0], motion), "fitted")]
        write_results(replay_dataset(replays, fit), tmp_path / "out.nc", kind="replay")
    with xr.open_dataset(tmp_path / "out.nc") as found:
        assert found.attrs["results_kind"] == "replay"
        assert found.fitted_value.sel(parameter="sensor.gain").item() == fit.numbers["sensor.gain"]
        measured, residual = found.board_measured.values, found.board_residual.values
        known = np.isfinite(residual)
        np.testing.assert_allclose((measured - found.board_simulated.values)[known], residual[known])
        assert {"drive_1", "recording", "use"} <= set(found.variables)


def test_noise_of_the_drive_is_in_the_standard_errors(tmp_path: Path) -> None:
    # the response to noise rings on for hundreds of samples: without it the errors were 16 times too small
    reading = simulated({"body.frequency": 823.0}, tmp_path)
    random = np.random.default_rng(9)
    path = written(
        tmp_path / "noisy.nc",
        channel("base", TIME, pulse(TIME) + random.normal(0.0, 40.0, len(TIME)), trigger="one"),
        channel("board", TIME, reading + random.normal(0.0, 2.0, len(TIME)), trigger="one"),
    )
    with opened_replays(scene(), [path]) as replayers:
        noise = replayers[0].drive_noise
        fit = fit_replay(replayers, ["body.frequency"])
        quiet = covariance_of(*_linear(replayers[0], fit), [])
    assert noise is not None
    assert np.std(noise) == pytest.approx(40.0, rel=0.2)
    assert fit.standard_error[0] > 4.0 * np.sqrt(quiet[0, 0])
    assert abs(fit.values[0] - 823.0) < 3.0 * fit.standard_error[0]


def _linear(replayer: Replayer, fit: ReplayFit) -> tuple[list[Floats], list[None], list[Floats]]:
    """Return slope and residual of the one channel by the one number that was fitted."""
    (comparison,) = fit.comparisons[0]
    size, step = np.std(comparison.values), 0.1
    ahead, behind = (
        replayer.simulate({fit.keys[0]: float(fit.values[0]) + sign * step}).readings[0] for sign in (1, -1)
    )
    return [((behind - ahead) / (2.0 * step * size))[:, None]], [None], [comparison.residual / size]


def test_few_samples_with_all_the_weight_have_honest_errors() -> None:
    # the mean of 20 of 2,000 white samples: its standard error is 1/sqrt(20), and the Newey-West error about 0
    weight = np.zeros((2000, 1))
    weight[:20] = 1.0
    found = []
    for seed in range(20):
        values = np.random.default_rng(seed).normal(0.0, 1.0, 2000)
        values[:20] -= np.mean(values[:20])
        found.append(float(covariance_of([weight], [None], [values], [])[0, 0]))
    assert np.mean(found) == pytest.approx(1.0 / 20.0, rel=0.1)


def test_drawn_noise_has_the_spectrum_of_its_sample() -> None:
    random = np.random.default_rng(4)
    sample = np.convolve(
        random.normal(0.0, 1.0, 400), np.ones(4) / 2.0, mode="valid"
    )  # rolls off, variance 1
    drawn = drawn_noise(sample, 50_000, random)
    assert np.std(drawn) == pytest.approx(np.std(sample), rel=0.1)
    assert np.corrcoef(drawn[1:], drawn[:-1])[0, 1] == pytest.approx(0.75, abs=0.05)


def test_clocks_that_are_far_apart_are_refused_before_anything_is_simulated() -> None:
    with pytest.raises(DatasetError, match=r"expected at most 1e\+07 steps, got 5e\+10"):
        step_instants(TIME, 2e-5, 1e6)
    with pytest.raises(DatasetError, match="Look at the instants of the channels"):
        step_instants(np.array([0.0, 2e-5, 1e9]), 2e-5, 0.0)


def test_a_channel_that_cannot_drive_is_told_with_its_file(tmp_path: Path) -> None:
    path = written(tmp_path / "v.nc", channel("base", TIME, pulse(TIME), "V"), channel("board", TIME, TIME))
    with (
        pytest.raises(DatasetError, match=r"v\.nc: base: expected a channel in"),
        opened_replays(scene(), [path]),
    ):
        pass


def test_a_problem_with_its_file_is_a_new_error(tmp_path: Path) -> None:
    # raised from itself it would be its own cause, and a worker of a campaign could never pickle it
    path = tmp_path / "absent.nc"
    with pytest.raises(DatasetError) as raised, opened_replays(scene(), [path]):
        pass
    assert str(raised.value).startswith(f"{path}: expected")
    assert raised.value.__cause__ is not None
    assert raised.value.__cause__ is not raised.value


def test_a_number_that_changes_nothing_is_refused(tmp_path: Path) -> None:
    # at a given frequency, an accelerometer cannot see the length of a board on a moving base
    path = recorded(tmp_path)
    with (
        opened_replays(scene(), [path]) as replayers,
        pytest.raises(EstimationError, match=r"body\.length: expected"),
    ):
        fit_replay(replayers, ["body.frequency", "body.length"])


def test_a_lag_larger_than_the_records_is_as_large_as_they_are(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    found = []
    for more in ("", "most_lag = 1e12"):
        with opened_replays(scene(BOARD + more), [path]) as (replayer,):
            found.append(compare_motion(replayer, replayer.simulate())[0].alignment.lag)
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_spans_that_end_before_they_start_are_problems_of_the_scene() -> None:
    with pytest.raises(SceneError) as told:
        scene(BOARD + "peaks = [3.0, 1.0]\nwindows = [[0.0, 1.0], [0.2, 0.1]]\n")
    assert [line.split(": ")[1] for line in told.value.problems] == ["replay.peaks", "replay.windows[2]"]


def test_a_replay_that_compared_nothing_has_no_figure_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with opened_replays(scene(BOARD[: BOARD.index("compare")]), [recorded(tmp_path)]) as (replayer,):
        dataset = replay_dataset([Replayed(replayer, replayer.simulate(), [], "replayed")])
    write_results(dataset, tmp_path / "alone.nc", kind="replay")
    with pytest.raises(SystemExit) as left:
        main(["plot", str(tmp_path / "alone.nc"), "-o", str(tmp_path / "x.png")])
    assert left.value.code == 2
    assert "expected one at least, got none" in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()


def test_a_fit_of_nothing_that_is_compared_is_misuse(tmp_path: Path) -> None:
    alone = scene(BOARD[: BOARD.index("compare")])
    with (
        opened_replays(alone, [recorded(tmp_path)]) as replayers,
        pytest.raises(UsageError, match="Add compare"),
    ):
        fit_replay(replayers, ["sensor.gain"])


FORCED = """
[body]
mass = 1.0
stiffness = 400.0
damping_ratio = 0.05
{forcing}

[[stop]]
position = 0.002
restitution = 0.7
{rest}
"""
FORCE = "[forcing]\namplitude = 1.0\nangular_frequency = 18.0"
RECORD = (
    '[record]\nrecorded_periods = 30\ntime_series = { rate = 1000, variables = ["displacement", "forcing"] }'
)
REPLAY = """[replay]
drive = "force"
from = "forcing"
compare = [{ simulated = "displacement", measured = "displacement" }]"""


def test_a_simulated_run_with_impacts_replayed_through_its_own_force_is_the_same_run(tmp_path: Path) -> None:
    # the force is linear between 350 samples a period: an error of (2 pi / 350)^2 / 12 of its size at most
    run_scene(parse_scene(FORCED.format(forcing=FORCE, rest=RECORD), "run.toml"), tmp_path / "run.nc")
    replayed = parse_scene(FORCED.format(forcing="", rest=REPLAY), "replay.toml")
    with opened_replays(replayed, [tmp_path / "run.nc"]) as (replayer,):
        motion = replayer.simulate()
        (comparison,) = compare_motion(replayer, motion)
        recorded_impacts = replayer.recording.event_train("impacts").times
    assert comparison.variance >= 99.9999
    assert len(recorded_impacts) > 20
    assert comparison.events is not None
    assert len(comparison.events.measured) == len(recorded_impacts)
    assert len(comparison.events.extra) == len(comparison.events.missed) == 0
    assert np.abs(comparison.events.delay).max() < 1e-5


def test_simulated_impacts_are_not_called_extra_where_none_were_measured(tmp_path: Path) -> None:
    stopped = BOARD + "[[stop]]\nposition = 1e-6\nlocation = 0.5\nrestitution = 0.5\n"
    path = written(
        tmp_path / "own.nc",
        channel("base", TIME, pulse(TIME), trigger="one"),
        channel("board", TIME, pulse(TIME), trigger="one"),
    )
    with opened_replays(scene(stopped), [path]) as (replayer,):
        motion = replayer.simulate()
        (comparison,) = compare_motion(replayer, motion)
    assert len(motion.impacts) > 0
    assert comparison.events is None


def test_a_designed_force_keeps_its_mean_and_a_measured_one_does_not(tmp_path: Path) -> None:
    # a sine on a constant force: the mean of the motion is that force over the stiffness
    time = 1e-3 * np.arange(8001)
    path = written(
        tmp_path / "designed.nc",
        channel("forcing", time, 1.0 + 0.5 * np.sin(12.0 * time), "N"),
        channel("displacement", time, np.sin(time), "m"),
    )
    compared = parse_scene(FORCED.format(forcing="", rest=REPLAY), "compared.toml")
    designed = parse_scene(FORCED.format(forcing="", rest=REPLAY[: REPLAY.index("compare")]), "designed.toml")
    with opened_replays(compared, [path]) as (measured,), opened_replays(designed, [path]) as (replayer,):
        assert measured.drive is not None
        assert replayer.drive is not None
        assert measured.drive.values.mean() == pytest.approx(0.0, abs=1e-12)
        assert replayer.drive.values.mean() == pytest.approx(1.0, abs=0.01)
        assert "its level of" in replayer.drive.remarks[0]
        assert "is kept: nothing is compared" in replayer.drive.remarks[0]
    given = parse_scene(designed.text + "drive_offset = 0.25\n", "given.toml")
    with opened_replays(given, [path]) as (replayer,):
        assert replayer.drive is not None
        assert replayer.drive.offset == 0.25


@pytest.mark.parametrize(
    "record",
    [
        'time_series = { rate = 500, variables = ["displacement"] }',
        "impacts = true",
        "recorded_periods = 4",
        "recorded_time = 1.0",
        "",
    ],
)
def test_a_replay_is_never_asked_for_a_duration_that_it_is_refused(record: str) -> None:
    text = FORCED.format(forcing="", rest=f"{REPLAY}\n[record]\n{record}\n")
    key = record.partition(" ")[0]
    if key in ("impacts", ""):
        assert parse_scene(text, "replay.toml").replay is not None
        return
    with pytest.raises(SceneError) as told:
        parse_scene(text, "replay.toml")
    (line,) = told.value.problems
    assert line.startswith(f"replay.toml: record.{key}: expected none beside [replay], got one.")
