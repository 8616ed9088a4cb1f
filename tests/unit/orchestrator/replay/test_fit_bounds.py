"""Fits of a replay that start at, or end near, a bound of a number, or where a number has no effect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.replay_scenes import BOARD, channel, pulse, written

from vibroimpact.analysis.recording import open_signals
from vibroimpact.fmus.errors import EstimationError
from vibroimpact.orchestrator.replay import Replayer, ReplayFit, fit_replay
from vibroimpact.orchestrator.scene import parse_scene

TIME = np.arange(2000) * 1e-5
NO_GAIN = BOARD.replace("gain = 0.9", "gain = 0.0")


def recorded(folder: Path, truth: dict[str, float]) -> Path:
    """Write readings of the scene's board with other numbers, and noise: the reference is the scene itself."""
    base = channel("base", TIME, pulse(TIME), trigger="one")
    still = channel("board", TIME, np.zeros_like(TIME), trigger="one")
    path = written(folder / "a0.nc", base, still)
    with Replayer(parse_scene(BOARD, "board.toml"), open_signals(path)) as replayer:
        motion = replayer.simulate(truth)
    noise = np.random.default_rng(0).normal(0.0, 0.5, len(TIME))
    response = np.interp(TIME, motion.time, motion.readings[0]) + noise
    return written(folder / "a1.nc", base, channel("board", TIME, response, trigger="one"))


def fitted(path: Path, keys: list[str], scene: str = BOARD) -> ReplayFit:
    with Replayer(parse_scene(scene, "board.toml"), open_signals(path)) as replayer:
        return fit_replay([replayer], keys)


def test_a_fit_may_begin_at_a_damping_ratio_of_zero(tmp_path: Path) -> None:
    undamped = BOARD.replace("damping_ratio = 0.01", "damping_ratio = 0.0")
    found = fitted(recorded(tmp_path, {}), ["body.damping_ratio"], undamped)
    assert found.values[0] == pytest.approx(0.01, abs=4.0 * found.standard_error[0])
    assert found.standard_error[0] < 1e-5
    assert found.remarks == ()


def test_a_sensor_whose_place_is_looked_for_from_the_top_of_the_mode_is_found_beside_it(
    tmp_path: Path,
) -> None:
    # in the middle of a clamped beam the shape is flat: to first order the place of the sensor has no effect there
    keys = ["sensor.location", "body.frequency"]
    found = fitted(recorded(tmp_path, {"sensor.location": 0.42, "body.frequency": 806.0}), keys)
    place = min(found.values[0], 1.0 - found.values[0])
    assert place == pytest.approx(0.42, abs=4.0 * found.standard_error[0])
    assert found.numbers["body.frequency"] == pytest.approx(806.0, abs=4.0 * found.standard_error[1])
    assert found.start[0] == 0.5
    assert found.remarks == ("sensor.location has no effect at 0.5: the search began beside it, at 0.45",)


def test_a_number_that_ends_where_it_has_no_effect_is_not_given_an_error_to_rely_on(tmp_path: Path) -> None:
    found = fitted(recorded(tmp_path, {}), ["sensor.location"])
    assert found.values[0] == pytest.approx(0.5, abs=0.005)
    assert "sensor.location is not told from 0.5, where it has no effect" in found.remarks[1]


def test_a_fit_may_begin_with_a_sensor_that_reads_nothing(tmp_path: Path) -> None:
    # with a gain of 0 no other number has an effect
    path = recorded(tmp_path, {"body.frequency": 806.0})
    found = fitted(path, ["body.frequency", "sensor.gain"], NO_GAIN)
    np.testing.assert_array_less(np.abs(found.values - [806.0, 0.9]), 4.0 * found.standard_error)
    assert found.remarks == (
        "body.frequency: without effect where the search began; the other numbers were found first",
    )
    with pytest.raises(
        EstimationError, match=r"body\.frequency: expected a number that changes what is compared"
    ):
        fitted(path, ["body.frequency"], NO_GAIN)
