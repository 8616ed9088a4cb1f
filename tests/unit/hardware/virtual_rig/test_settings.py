"""The file of a rig: all of its problems at once, each with what to do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.places import ROOT

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.hardware.virtual_rig.plant import Plant
from vibroimpact.hardware.virtual_rig.settings import read_rig

WHOLE = (ROOT / "examples" / "rig" / "oscillator.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["oscillator", "beam"])
def test_the_examples_are_plants(name: str) -> None:
    plant = Plant(read_rig(ROOT / "examples" / "rig" / f"{name}.toml"))
    assert plant.state == {"displacement": 0.0, "velocity": 0.0, "contact_force": 0.0}
    plant.close()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('device = "xseries"', 'device = "x"', 'rig.device: expected "labpc\\+" or "xseries", got "x"'),
        ("output = 0\n", "output = 2\n", "exciter.output: expected 0 to 1, those of xseries, got 2"),
        ("input = 1\n", "input = 8\n", r"sensor\[2\].input: expected 0 to 7, those of xseries, got 8"),
        ("input = 1\n", "input = 0\n", r"sensor\[2\].input: expected an input of its own, got 0 again"),
        ("gain = 0.1 ", "gain = nan ", "exciter.gain: expected a finite number"),
        ("[exciter]", "[exiter]", "exiter: expected a known key"),
        ("[rig]\n", "[rig]\nspeed = 0.0\n", "rig.speed: expected seconds of the rig in a second"),
        ("[rig]\n", "[rig\n", "line 3"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in WHOLE
    file = tmp_path / "rig.toml"
    file.write_text(WHOLE.replace(old, new), encoding="utf-8")
    with pytest.raises(UsageError, match=said):
        read_rig(file)


def test_ticks_that_round_to_one_time_are_one_instant() -> None:
    # after a year a nanosecond is below the rounding of a double
    plant = Plant(read_rig(ROOT / "examples" / "rig" / "oscillator.toml"))
    year, ones = 31_536_000 * 10**9, np.ones(4)
    plant.advance(np.array([year]), np.zeros(1))
    close = plant.advance(year + np.array([1, 2, 3, 1_000_000]), ones)["displacement"]
    assert close[0] == close[1] == 0.0
    assert close[3] > 0.0
    assert plant.now == year + 1_000_000
    plant.close()


@pytest.mark.parametrize("scene", ["two_oscillators.toml", "newtons_cradle.toml"])
def test_a_scene_of_components_is_no_plant(tmp_path: Path, scene: str) -> None:
    file = tmp_path / "rig.toml"
    there = (ROOT / "examples" / scene).as_posix()
    file.write_text(WHOLE.replace("oscillator_scene.toml", there), encoding="utf-8")
    with pytest.raises(UsageError, match=r"rig.scene: expected an oscillator or a beam"):
        Plant(read_rig(file))


def test_a_scene_that_is_not_there_is_said(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(WHOLE, encoding="utf-8")
    with pytest.raises(SceneError, match=r"oscillator_scene.toml"):
        Plant(read_rig(file))
    with pytest.raises(UsageError, match="expected the file of a rig"):
        read_rig(tmp_path / "none.toml")
