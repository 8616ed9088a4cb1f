"""A run in memory equals its file: names, order, types, attributes and bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.campaign_scenes import frequency_text, scene_of
from support.in_memory import assert_memory_is_file
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.files import atomic

FOREIGN = ("bouncing_ball.toml", "user_contact_law.toml")
"""Examples whose FMUs must be built first."""
MANY = "tolerances.toml"
"""An example of 1,536 points."""
NAMES = sorted(path.name for path in EXAMPLES.glob("*.toml") if path.name not in (*FOREIGN, MANY))


@pytest.mark.parametrize("name", NAMES)
def test_an_example_in_memory_is_what_its_file_gives(name: str) -> None:
    assert_memory_is_file(vi.Scene.from_file(EXAMPLES / name))


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_runs_of_a_sweep_in_any_order_are_what_their_file_gives(path: str) -> None:
    text = frequency_text(4, path).replace("start = 0.6, stop = 1.6, points = 4", "values = [0.6, 0.8, 0.7]")
    assert_memory_is_file(scene_of(text))


def test_a_run_that_fails_is_what_its_file_gives() -> None:
    found = assert_memory_is_file(
        scene_of(frequency_text(3)).with_sweep({"forcing.angular_frequency": [1.0, 1e-308]})
    )
    assert "expected a period" in str(found.message.values[0]) + str(found.message.values[1])


def test_a_run_in_memory_writes_no_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("nothing is written")

    monkeypatch.setattr(atomic, "write_atomically", refused)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "absent"))
    found = vi.run(scene_of(frequency_text(3)), progress=False)
    assert found.sizes["angular_frequency"] == 3


def test_what_a_caller_does_to_a_dataset_is_not_seen_by_the_next_one() -> None:
    scene = scene_of(frequency_text(3))
    first = vi.run(scene, progress=False)
    for variable in first.variables.values():
        if variable.dtype.kind == "f" and not isinstance(variable, xr.IndexVariable):
            variable.values = np.full(variable.shape, -1.0)
            if variable.values.ndim == 0:
                variable.values[...] = -2.0
        variable.attrs["long_name"] = "changed"
    first.attrs["title"] = "changed"
    second, third = (vi.run(scene, progress=False).drop_vars("point_seconds") for _ in range(2))
    xr.testing.assert_identical(second, third)
    assert second.attrs["title"] == "busy"
    assert float(second.mass) == 1.0
    assert second.mass.attrs["long_name"] == "mass"
