"""Studies of replays: fewer samples and other numbers of modes, against a recording that the tests simulate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.replay_scenes import BOARD, channel, pulse, written
from support.still_clock import NEVER_LATE, stop_the_clock

from vibroimpact.analysis.recording import Recording
from vibroimpact.analysis.study import whole
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.replay import opened_replays
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.study.accuracy import AccuracyOfScene, Comparison, advice, dataset_of
from vibroimpact.orchestrator.study.effects import effects_of, shares_of
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial, rates_of, thinned

TIME = 2e-5 * np.arange(1500)
TRUTH = {"body.modes": 4}
"""Changes of the scene for its recording: four modes, where the scene itself has one."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Return a board whose recording has been simulated with four modes."""
    folder = tmp_path_factory.mktemp("board")
    channels = (channel("base", TIME, pulse(TIME), trigger="one"), channel("board", TIME, pulse(TIME)))
    driven = written(folder / "drive.nc", *channels)
    truth = parse_scene(BOARD, "board.toml").with_values(TRUTH)
    with opened_replays(truth, [driven]) as (replayer,):
        (reading,) = replayer.simulate().readings
    channels = (channels[0], channel("board", TIME, reading, trigger="one"))
    written(folder / "own.nc", *channels)
    text = BOARD.replace("[replay]", '[replay]\nrecordings = ["own.nc"]')
    return parse_scene(text, str(folder / "board.toml"))


@pytest.fixture(scope="module")
def study(scene: Scene) -> Comparison:
    with pytest.MonkeyPatch.context() as patch:
        stop_the_clock(patch)
        return whole(AccuracyOfScene(scene, budget=NEVER_LATE)).comparison


def test_the_modes_that_the_truth_has_account_for_all_of_the_recording(study: Comparison) -> None:
    scores = {one.way.setting: one.variance for one in study.measured if one.way.knob == "modes"}
    assert scores[4] == pytest.approx(100.0, abs=1e-6)
    assert scores[1] < scores[4] - 1e-3  # the pulse is slow, so higher modes matter little
    assert all(one.way.model for one in study.measured if one.way.knob == "modes")


def test_fewer_samples_err_by_more_and_cost_less(study: Comparison) -> None:
    fewer = [one for one in study.measured if one.way.name == "fewer samples"]
    rates = [one.way.setting for one in fewer]
    assert rates == pytest.approx([25000.0, 12500.0, 6250.0, 3125.0])
    errors = [one.error("samples") for one in fewer]
    assert errors == sorted(errors)
    assert errors[0] > 0.0
    assert np.isnan([one.error("final_state") for one in fewer]).all()


def test_coupled_by_a_replay_fmu_is_the_same_motion(study: Comparison) -> None:
    (coupled,) = (one for one in study.measured if one.way.name.startswith("coupled"))
    assert coupled.error("all") < 1e-9


def test_the_dataset_and_the_sentence_have_the_score(study: Comparison) -> None:
    dataset = dataset_of(study)
    scores = dataset["variance_accounted_for"]
    assert scores.attrs["units"] == "percent"
    assert float(scores.max()) == pytest.approx(100.0, abs=1e-6)
    assert "What was measured is accounted for to" in advice(study)


def test_a_thinned_recording_keeps_first_samples_and_shared_clocks() -> None:
    one = channel("a", TIME, np.arange(1500.0))

    other = replace(one, name="b")
    half = thinned(Recording({"a": one, "b": other}), 2)
    np.testing.assert_array_equal(half.channels["a"].values, np.arange(0.0, 1500.0, 2.0))
    assert half.channels["a"].axis is half.channels["b"].axis
    assert half.channels["a"].axis.rate == pytest.approx(25000.0)


def test_a_recording_is_not_thinned_to_nothing(scene: Scene) -> None:
    assert max(rates_of(scene)) == 16  # 1500 samples: one in 32 leaves 46


def test_a_replay_without_a_recording_is_one_error() -> None:
    with pytest.raises(UsageError, match=r"replay\.recordings: expected a recording, got none"):
        whole(AccuracyOfScene(parse_scene(BOARD, "board.toml")))


def test_damping_drive_and_sensor_of_a_replay_are_effects(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_the_clock(monkeypatch)
    effects = effects_of(scene)
    assert [effect.asked_by for effect in effects] == ["body.damping_ratio", "replay.drive", "sensor.gain"]
    changes = {share.effect.asked_by: share.change for share in shares_of(scene, effects)}
    assert all(0.0 < change < 10.0 for change in changes.values())
    assert changes["sensor.gain"] == pytest.approx(0.1 / 0.9 * changes["replay.drive"], rel=1e-3)


def test_a_replay_that_is_given_up_is_a_way_that_did_not_finish(scene: Scene) -> None:
    trial = ReplayTrial(scene.with_values({"execution.deadline": 1e-9}))
    found = trial.run()
    trial.close()
    assert found.failure == "did not finish"


def test_a_trial_is_the_same_each_time(scene: Scene) -> None:
    trial = ReplayTrial(scene)
    first, second = trial.run(), trial.run()
    trial.close()
    assert first.samples is not None
    assert second.samples is not None
    np.testing.assert_array_equal(first.samples, second.samples)
    assert first.variance == second.variance
