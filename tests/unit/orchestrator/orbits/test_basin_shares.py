"""Shares of basins over a parameter, against single planes and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError

SCENE = EXAMPLES / "basins.toml"
FREQUENCY = "forcing.angular_frequency"
ONE_TO_TWO = ["--parameter", FREQUENCY, "--from", "1", "--to", "2"]


def test_shares_over_the_frequency_are_those_of_single_planes(tmp_path: Path) -> None:
    files = ["-o", str(tmp_path / "s.nc"), "--figure", str(tmp_path / "s.png")]
    over = ["--parameter", FREQUENCY, "--from", "1.3", "--to", "1.6", "--values", "4"]
    plane = ["--x=-2:0.9", "--y=-2:2", "--points", "12"]
    done = in_this_process("basins", str(SCENE), *over, *plane, *files)
    assert done.returncode == 0, done.stderr
    assert "P(1,1)" in done.stdout
    assert (tmp_path / "s.png").read_bytes()[:4] == b"\x89PNG"
    with xr.open_dataset(tmp_path / "s.nc") as found:
        assert found.parameter.values == pytest.approx([1.3, 1.4, 1.5, 1.6])
        names = found.attractor_name.values.tolist()
        assert sorted(names) == ["P(1,1)", "no impacts"]
        at = vi.Scene.from_file(SCENE).unswept().with_values({FREQUENCY: 1.4})
        one = vi.basins(at, (-2.0, 0.9), (-2.0, 2.0), (12, 12))
        shares = dict(zip(one.attractor_name.values, one.basin_fraction.values, strict=True))
        for place, name in enumerate(names):
            assert float(found.basin_fraction[1, place]) == pytest.approx(shares[name])
        # P(1,1) ends in the fold at 1.5166110861
        ended = found.basin_fraction.values[3, names.index("P(1,1)")]
        assert (ended, found.attractor_class.values[3, names.index("P(1,1)")]) == (0.0, "")
        assert found.basin_fraction.sum("attractor").values == pytest.approx(np.ones(4))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["--parameter", FREQUENCY],
            "--parameter: expected --parameter, --from and --to together, got some of them.",
        ),
        (["--from", "1"], "--parameter: expected --parameter, --from and --to together, got some of them."),
        (
            ["--parameter", FREQUENCY, "--from", "1", "--to", "1"],
            "expected a range of two finite numbers, got 1 to 1.",
        ),
        (
            [*ONE_TO_TWO, "--values", "1"],
            "values: expected 2 to 10000, got 1.",
        ),
        (["--parameter", "forcing.colour", "--from", "1", "--to", "2"], "forcing.colour"),
        (
            [*ONE_TO_TWO, "--edges"],
            "--edges: expected no --parameter beside it",
        ),
    ],
)
def test_what_has_no_shares_is_one_line(arguments: list[str], said: str) -> None:
    done = in_this_process("basins", str(SCENE), *arguments)
    assert done.returncode == 2, done.stdout
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_parameter_without_a_range_is_refused() -> None:
    with pytest.raises(UsageError, match="parameter_range: expected two ends"):
        vi.basins(SCENE, parameter=FREQUENCY)
