"""The file of a rig: all of its errors at once, each with a remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.places import ROOT

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.hardware.virtual_rig.scene_plant import opened_plant
from vibroimpact.hardware.virtual_rig.settings import read_rig

WHOLE = (ROOT / "examples" / "rig" / "oscillator.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["oscillator", "beam", "flexible_beam_1", "flexible_beam_2"])
def test_the_examples_are_plants(name: str) -> None:
    plant = opened_plant(read_rig(ROOT / "examples" / "rig" / f"{name}.toml"))
    plant.advance(np.array([10**9]), np.ones(1))
    assert abs(plant.truth(0.0)["displacement"]) > 1e-6
    assert set(plant.state) <= {"sensor.displacement", "sensor.velocity", "load_cell"}
    plant.close()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('device = "xseries"', 'device = "x"', 'rig.device: expected "labpc\\+" or "xseries", got "x"'),
        ("ao0 = ", "ao2 = ", 'wiring: expected ai0 to ai7, ao0 to ao1 of xseries, got "ao2"'),
        ("ai1 = ", "ai8 = ", 'wiring: expected ai0 to ai7, ao0 to ao1 of xseries, got "ai8"'),
        ("ai1 = ", "ai0 = ", "line 1[0-9]"),
        ("ai1 = ", "ai01 = ", 'wiring: expected ai0 to ai7, .*, got "ai01"'),
        (
            "ai1 = ",
            'ao1 = "exciter"\nai1 = ',
            "wiring.ao1: expected one output at the exciter, ao0, got another",
        ),
        ('"exciter"', '"ai0"', 'wiring.ao0: expected "exciter", got "ai0"'),
        (
            '"sensor.displacement"',
            '"sensor.displacment"',
            "wiring.ai0: expected a channel of the scene, .*sensor.disp",
        ),
        ('"sensor.displacement"', "7", "wiring.ai0: expected a signal, or a table, got 7"),
        ("amplification = 0.01", "amplification = nan", "wiring.ai1.amplification: expected a finite number"),
        ('ao0 = "exciter"', 'ai3 = "drive"', "wiring.ai3: expected an output at the exciter for the drive"),
        ("[wiring]", "[wirings]", "wirings: expected a known key"),
        ("[wiring]", "[exciter]", r"exciter: expected \[rig\] and \[wiring\], got \[exciter\]"),
        ("[rig]\n", "[rig]\nrecording = 'a.nc'\n", "rig: expected scene or recording, got both"),
        ("[rig]\n", "[rig]\nrun = 1\n", "rig.run: expected none beside scene, got 1"),
        ("[rig]\n", "[rig]\nclock_error = 1e6\n", "rig.clock_error: expected ppm"),
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
    plant = opened_plant(read_rig(ROOT / "examples" / "rig" / "oscillator.toml"))
    year, ones = 31_536_000 * 10**9, np.ones(4)
    plant.advance(np.array([year]), np.zeros(1))
    close = plant.advance(year + np.array([1, 2, 3, 1_000_000]), ones)["sensor.displacement"]
    assert close[0] == close[1] == 0.0
    assert close[3] > 0.0
    assert plant.now == year + 1_000_000
    plant.close()


@pytest.mark.parametrize("scene", ["two_oscillators.toml", "newtons_cradle.toml"])
def test_a_scene_of_components_is_no_plant(tmp_path: Path, scene: str) -> None:
    file = tmp_path / "rig.toml"
    there = (ROOT / "examples" / scene).as_posix()
    file.write_text(WHOLE.replace("oscillator_scene.toml", there), encoding="utf-8")
    with pytest.raises(UsageError, match=r"rig.scene: .*expected an oscillator or a beam"):
        opened_plant(read_rig(file))


def test_a_scene_that_is_not_there_is_said(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(WHOLE, encoding="utf-8")
    with pytest.raises(SceneError, match=r"oscillator_scene.toml"):
        opened_plant(read_rig(file))
    with pytest.raises(UsageError, match="expected the file of a rig"):
        read_rig(tmp_path / "none.toml")
