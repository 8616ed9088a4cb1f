"""Fits of a replay that begin at, or end beside, a bound of a number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from replay_scenes import BOARD, channel, pulse, written

from vibroimpact.analysis.recording_files import open_signals
from vibroimpact.orchestrator.replay import Replayer
from vibroimpact.orchestrator.replay_fit import fit_replay
from vibroimpact.orchestrator.scene import parse_scene

TIME = np.arange(2000) * 1e-5


def test_a_fit_may_begin_at_a_damping_ratio_of_zero(tmp_path: Path) -> None:
    # The reference is the scene itself: what it simulates with a damping ratio of .01, and noise.
    base = channel("base", TIME, pulse(TIME), trigger="one")
    still = channel("board", TIME, np.zeros_like(TIME), trigger="one")
    path = written(tmp_path / "a0.nc", base, still)
    with Replayer(parse_scene(BOARD, "board.toml"), open_signals(path)) as replayer:
        motion = replayer.simulate()
    noise = np.random.default_rng(0).normal(0.0, 0.5, len(TIME))
    response = np.interp(TIME, motion.time, motion.readings[0]) + noise
    path = written(tmp_path / "a1.nc", base, channel("board", TIME, response, trigger="one"))
    undamped = parse_scene(BOARD.replace("damping_ratio = 0.01", "damping_ratio = 0.0"), "board.toml")
    with Replayer(undamped, open_signals(path)) as replayer:
        found = fit_replay([replayer], ["body.damping_ratio"])
    assert found.values[0] == pytest.approx(0.01, abs=4.0 * found.standard_error[0])
    assert found.standard_error[0] < 1e-5
    assert found.remarks == ()
