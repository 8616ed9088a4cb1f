"""Calibrations: volts become units and back; a calibration of another channel is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.calibration import read_calibrations
from vibroimpact.hardware.rig.inputs import Input

INPUTS = [Input("tip", "Dev1/ai0", 5.0), Input("cell", "Dev1/ai1", 5.0)]
CELL = """
[cell]
terminal = "Dev1/ai1"
unit = "N"
sensitivity = -0.0218
offset = 0.1
drift = 1e-3
how = "dead weights, 0 to 2 kg"
when = 2026-03-01
"""


def read(tmp_path: Path, text: str) -> object:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return read_calibrations([path], INPUTS)


def test_volts_become_units(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL)
    (cell,) = read_calibrations([path], INPUTS).values()
    volts, time = np.array([0.1, -2.07, 1.1]), np.array([0.0, 10.0, 1000.0])
    np.testing.assert_allclose(cell.to_units(volts, time), [0.0, 100.0, 0.0], atol=1e-9)
    assert cell.attributes()["calibration_when"] == "2026-03-01"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "[cell]",
            "[sell]",
            "cell.toml: sell: expected a channel that is measured: tip, cell, got another channel",
        ),
        ("Dev1/ai1", "Dev1/ai0", "cell.terminal: expected Dev1/ai1, where cell is measured, got Dev1/ai0"),
        ('"N"', '"furlong per"', "cell.unit: expected a unit such as N, m, mm, m/s, got"),
        ("-0.0218", "0.0", "cell.sensitivity: expected a finite number, not 0"),
        ("-0.0218", "nan", "cell.sensitivity: expected a finite number, not 0"),
        ("0.1", "inf", "cell.offset: expected a finite number"),
        ("how =", "why =", "cell.why: expected"),
        ("[cell]", "[cell", "cell.toml: line 2"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        read(tmp_path, CELL.replace(old, new, 1))


def test_a_channel_is_calibrated_once(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL)
    with pytest.raises(UsageError, match="expected one calibration of each channel, got another"):
        read_calibrations([path, path], INPUTS)
    with pytest.raises(UsageError, match=r"expected a calibration \(TOML\), got none"):
        read_calibrations([tmp_path / "none.toml"], INPUTS)
