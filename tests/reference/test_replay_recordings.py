"""Replays of recordings made in laboratories. References: the recordings' own published facts, and the other trials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.places import EXAMPLES
from support.real_data import recording_folder

from vibroimpact.analysis.recording import write_recording
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.trust import trust
from vibroimpact.hardware.recordings import import_recording, read_settings
from vibroimpact.hardware.recordings.settings import checked
from vibroimpact.orchestrator.replay import ReplayFit, compare_motion, fit_replay, opened_replays, scores_of
from vibroimpact.orchestrator.scene import load_scene

EXAMPLES = EXAMPLES / "recordings"


def board_recording(trial: str, folder: Path) -> Path:
    source = recording_folder("pcb_repeated_shock")
    files = [source / f"acc_{part}_{trial}.txt" for part in ("base", "pcb")]
    recording = import_recording(files, checked({"name": ["base", "board"], "unit": ["g"]}, "test"))
    write_recording(recording, folder / f"{trial}.nc")
    return folder / f"{trial}.nc"


KEYS = ["body.frequency", "body.damping_ratio", "sensor.gain"]
SLOPES = ["body.frequency_slope", "body.damping_slope"]


def fitted_and_scored(start: dict[str, float], paths: list[Path]) -> tuple[ReplayFit, Comparison, Comparison]:
    scene = load_scene(EXAMPLES / "board.toml").at(start)
    with opened_replays(scene, paths) as (own, other):
        fit = fit_replay([own], list(start))
        return fit, fit.comparisons[0][0], compare_motion(other, other.simulate(fit.numbers))[0]


def test_one_mode_fitted_on_a_trial_predicts_another_better_if_it_follows_the_amplitude(
    tmp_path: Path,
) -> None:
    paths = [board_recording(trial, tmp_path) for trial in ("a0", "a1")]
    linear, own, other = fitted_and_scored(dict(zip(KEYS, (790.0, 0.015, 1.0), strict=True)), paths)
    assert linear.numbers["body.frequency"] == pytest.approx(803.0, abs=1.5)
    assert linear.numbers["body.damping_ratio"] == pytest.approx(0.010, abs=0.0005)
    assert other.variance >= 98.5
    assert other.window_variance[0] >= 98.8
    assert other.peaks is not None
    assert other.peaks.worst <= 0.04
    assert len(other.peaks.time) >= 4
    assert other.alignment.lag == pytest.approx(0.0083, abs=0.00008)
    assert other.alignment.polarity == -1
    assert own.counts["clipped"] + other.counts["clipped"] >= 26
    assert trust({"a0": own.variance}, {"a1": other.variance}).trusted
    bent, _, better = fitted_and_scored(linear.numbers | dict.fromkeys(SLOPES, 0.0), paths)
    # the board's frequency falls with its amplitude: 800 Hz at 350 g, 807 below 26 g
    assert bent.numbers["body.frequency_slope"] < -5.0 * bent.standard_error[3]
    assert better.variance >= 99.5


def test_a_linear_replay_of_the_package_says_that_it_is_not_to_be_trusted(tmp_path: Path) -> None:
    source = recording_folder("smd_repeated_5kg")
    paths = []
    for name in ("05", "00"):
        recording = import_recording(
            [source / f"board3.4_{name}.lvm"], checked({"name": ["base", "board"], "unit": ["g"]}, "test")
        )
        paths.append(tmp_path / f"{name}.nc")
        write_recording(recording, paths[-1])
    keys = ["body.frequency", "body.damping_ratio", "sensor.gain"]
    with opened_replays(load_scene(EXAMPLES / "package.toml"), paths) as replayers:
        fit = fit_replay(replayers[:1], keys)
        scores = scores_of(
            replayers, [compare_motion(one, one.simulate(fit.numbers)) for one in replayers], 1
        )
    verdict = trust(scores.fitted, scores.others, scores.without_dynamics)
    assert not verdict.trusted
    assert "Do not trust this linear replay" in verdict.words
    assert scores.fitted["05.nc"] < 80.0
    assert np.isnan(scores.others["00.nc"])  # no impact, so there is no score


def test_an_oscillator_replays_the_pendulum_with_the_published_numbers(tmp_path: Path) -> None:
    # reference: the published fit of 40 to 80 s: omega 4.43478, lambda .02469, offset 438.66
    source = recording_folder("damped_pendulum")
    path = tmp_path / "pendulum.nc"
    write_recording(import_recording([source / "pendolo_smorzato.txt"]), path)
    keys = [
        "body.stiffness",
        "body.damping",
        "body.displacement_start",
        "body.velocity_start",
        "sensor.offset",
    ]
    with opened_replays(load_scene(EXAMPLES / "pendulum.toml"), [path]) as replayers:
        fit = fit_replay(replayers, keys)
    stiffness, decay = fit.numbers["body.stiffness"], 0.5 * fit.numbers["body.damping"]
    assert np.sqrt(stiffness - decay**2) == pytest.approx(4.4348, abs=0.0002)
    assert decay == pytest.approx(0.0247, abs=0.0001)
    assert fit.numbers["sensor.offset"] == pytest.approx(438.7, abs=0.1)
    assert fit.comparisons[0][0].variance > 99.9


@pytest.mark.parametrize(
    ("scene", "folder", "file", "settings", "least"),
    [
        # the vibration moves the board with its base: any stiff beam reaches this, as the page says
        ("shaker", "shaker_vibration_plus_shock", "amp7_impact0.0_vib0.5.lvm", "shaker.toml", 98.0),
        # with the start values of the scene, without a fit
        ("pendulum_whole", "damped_pendulum", "pendolo_smorzato.txt", None, 80.0),
    ],
)
def test_the_other_example_scenes_replay_their_recordings(
    scene: str, folder: str, file: str, settings: str | None, least: float, tmp_path: Path
) -> None:
    source = recording_folder(folder)
    given = None if settings is None else read_settings(EXAMPLES / "import" / settings)
    path = tmp_path / "recording.nc"
    write_recording(import_recording([source / file], given), path)
    with opened_replays(load_scene(EXAMPLES / f"{scene}.toml"), [path]) as (replayer,):
        (comparison,) = compare_motion(replayer, replayer.simulate())
    assert comparison.variance >= least
