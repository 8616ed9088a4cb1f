"""The file of a sweep: its valid settings, and one line for each error in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.sweep_files import CELL, DRIVE, sweep_of, sweep_text

from vibroimpact.analysis.dataset import Direction
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.sweep.settings import parse_sweep, read_sweep


def refusal(text: str) -> str:
    """Return the error message for a text."""
    with pytest.raises(UsageError) as refused:
        parse_sweep(text, "sweep.toml")
    assert refused.value.exit_code == 2
    return str(refused.value)


def test_a_sweep_goes_up_and_then_down() -> None:
    up = [(Direction.up, f) for f in (18.0, 18.1, 18.2)]
    down = [(Direction.down, f) for f in (18.2, 18.1, 18.0)]
    step = {"start": 18.0, "stop": 18.2, "step": 0.1}
    assert sweep_of(step).steps == (*up, *down)
    assert sweep_of(step, path="down").steps == tuple(down)
    assert sweep_of({"start": 18.0, "stop": 20.0, "points": 3}, path="up").steps[1] == (Direction.up, 19.0)


def test_what_does_not_change_the_measurement_does_not_change_the_digest() -> None:
    plain = sweep_of(inputs=(DRIVE, CELL))
    commented = parse_sweep("# hers\n" + plain.text, "other.toml")
    assert commented.digest == plain.digest
    assert parse_sweep('rig = "local"\n' + plain.text, "s.toml").digest == plain.digest
    assert sweep_of(inputs=(DRIVE,)).digest != plain.digest


@pytest.mark.parametrize(
    ("frequency", "said"),
    [
        ([18.0, 20.0, 19.0], "sweep.frequency[3]: expected ascending frequencies, got 19 after 20."),
        ([18.0, 18.0], "sweep.frequency[2]: expected ascending frequencies, got 18 after 18."),
        ([18.0, -1.0], "sweep.frequency: expected frequencies (Hz) > 0, got -1.0."),
        ([], "sweep.frequency: expected frequencies (Hz) > 0, got an empty array."),
        ("18", 'sweep.frequency: expected a range or a list of frequencies (Hz), got "18".'),
        ({"start": 20.0, "stop": 18.0, "step": 1.0}, "sweep.frequency.stop: expected a number > start, 20, got 18."),
        ({"start": 18.0, "stop": 19.0}, "sweep.frequency: expected either step or points, got neither."),
        ({"start": 18.0, "stop": 19.0, "step": 0.3}, "sweep.frequency.step: expected whole steps up to stop, 19,"),
        ({"start": 18.0, "stop": 19.0, "step": 1e-6}, "sweep.frequency.step: expected at most 10000 steps, got 1e+06."),
        ({"start": 18.0, "stop": 19.0, "points": 10**9}, "sweep.frequency: expected at most 10000 steps"),
        ({"start": 1.0, "stop": 300.0, "points": 3}, "output.rate: expected 20 samples of a period at least"),
    ],
)  # fmt: skip
def test_steps_that_are_none_are_one_line(frequency: object, said: str) -> None:
    line = refusal(sweep_text(frequency))
    assert line.startswith(f"sweep.toml: {said}")
    assert "\n" not in line


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("highest = 1.0", "highest = 0.4", "output.amplitude: expected at most output.highest, 0.4 V, got 0.5."),
        ("slew = 1e6", "slew = 60.0", "sweep.frequency: expected a drive within output.slew, 60 V/s, got 67.62"),
        ("amplitude = 0.5", "amplitude = nan", "output.amplitude: expected a number > 0, got nan."),
        ("Dev1/ao0", "ao0", 'output.terminal: expected an analog output such as Dev1/ao0, got "ao0".'),
        ('role = "displacement"', "", "input: expected one that measures the displacement, got none."),
        ('role = "displacement"', 'role = "load_cell"', "input[1].threshold: expected the threshold (V) of"),
        ("highest = 1.0", "higest = 1.0", "output.higest: expected a known key, got the unknown key"),
        ("transient_periods = 8", "transient_periods = 10000000", "sweep.transient_periods: expected a whole number"),
        ("transient_periods = 8", "average_periods = 10000\ntransient_periods = 1000000", "sweep: expected a sweep of"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_said_in_a_line(old: str, new: str, said: str) -> None:
    text = sweep_text()
    assert old in text
    text = text.replace("recorded_periods = 4", "recorded_periods = 500")
    assert f"sweep.toml: {said}" in refusal(text.replace(old, new))


def test_two_inputs_share_nothing() -> None:
    twice = refusal(
        sweep_text(inputs=({**DRIVE, "name": "tip", "terminal": "Dev1/ai0", "role": "displacement"},))
    )
    assert [line.split(": ")[1] for line in twice.splitlines()] == [
        "input[2].name",
        "input[2].terminal",
        "input[2].role",
    ]


def test_a_file_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"expected the file of a sweep \(TOML\), got none: No such file"):
        read_sweep(tmp_path / "none.toml")
    assert "expected valid TOML" in refusal("[sweep\n")
    assert [line.split(": ")[1] for line in refusal("x = 1").splitlines()] == [
        "x",
        "output",
        "sweep",
        "input",
    ]
