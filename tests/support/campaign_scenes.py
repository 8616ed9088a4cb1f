"""Scenes for tests of campaigns; with `busy_runner` the mass is the cost of a point in milliseconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import open_dataset, read_flat
from vibroimpact.orchestrator.scene import Scene, parse_scene

SCENE = """
[scene]
title = "{title}"
units = "nondimensional"
[body]
mass = {milliseconds}
stiffness = 1.0
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = {restitution}
[record]
transient_periods = 10
recorded_periods = 2
[sweep]
{sweep}
"""
FREQUENCIES = """
"forcing.angular_frequency" = {{ start = 0.6, stop = 1.6, points = {points}, path = "{path}" }}
"""
AMPLITUDES = '"forcing.amplitude" = {{ start = {start}, stop = 0.9, points = {points} }}'

TIMING = ("point_seconds",)
"""Variables that measure the computer, not the scene."""


def frequency_text(
    points: int,
    path: str = "independent",
    milliseconds: float = 1.0,
    restitution: float = 0.7,
    title: str = "busy",
) -> str:
    """Return a scene that sweeps the angular frequency."""
    sweep = FREQUENCIES.format(points=points, path=path)
    return SCENE.format(milliseconds=milliseconds, restitution=restitution, title=title, sweep=sweep)


def amplitude_text(points: int, start: float, milliseconds: float = 0.1) -> str:
    """Return a scene that sweeps the forcing amplitude; a runner can be made to fail where it is negative."""
    sweep = AMPLITUDES.format(points=points, start=start)
    return SCENE.format(milliseconds=milliseconds, restitution=0.7, title="amplitudes", sweep=sweep)


def plane_text(frequencies: int, amplitudes: int, path: str = "up-down", milliseconds: float = 0.1) -> str:
    """Return a scene that sweeps the angular frequency along branches, one pair for each amplitude."""
    sweep = FREQUENCIES.format(points=frequencies, path=path) + "\n"
    sweep += AMPLITUDES.format(points=amplitudes, start=0.1)
    return SCENE.format(milliseconds=milliseconds, restitution=0.7, title="plane", sweep=sweep)


def scene_of(text: str) -> Scene:
    """Return a parsed scene."""
    return parse_scene(text, "test.toml")


def assert_same_rows(first: Path, second: Path) -> None:
    """Assert that two datasets are bit-identical except for their timing."""
    one, other = read_flat(first).drop_vars(TIMING), read_flat(second).drop_vars(TIMING)
    for dataset in (one, other):
        dataset.attrs = {}
        for variable in dataset.variables.values():
            variable.attrs = {}
    xr.testing.assert_identical(one, other)
    for name, variable in one.variables.items():
        if variable.dtype.kind == "f":
            # assert_identical does not distinguish -0.0 from 0.0.
            assert np.array_equal(variable.values.view(np.int64), other[name].values.view(np.int64)), name


def assert_same_datasets(first: str | Path, second: str | Path) -> None:
    """Assert that two campaigns have the same datasets once opened, up to timing and the order of ragged rows."""
    one, other = (_comparable(open_dataset(place)) for place in (first, second))
    xr.testing.assert_identical(one, other)
    for name, variable in one.variables.items():
        assert variable.dtype == other[name].dtype, name
        if variable.dtype.kind == "f":
            assert variable.values.tobytes() == other[name].values.tobytes(), name


def _comparable(opened: xr.Dataset) -> xr.Dataset:
    order = {
        str(owner)[: -len("_run")]: np.argsort(values.values, kind="stable")
        for owner, values in opened.data_vars.items()
        if str(owner).endswith("_run")
    }
    return opened.load().isel(order).drop_vars(TIMING)
