"""Scenes for tests of campaigns; with `busy_runner` the mass is the cost of a point in milliseconds."""

from __future__ import annotations

from collections.abc import Iterable
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
mass = {mass}
stiffness = 1.0
damping_ratio = {damping_ratio}
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = {position}
restitution = {restitution}
[record]
transient_periods = {transient_periods}
recorded_periods = {recorded_periods}
[sweep]
"""
AMPLITUDES = '"forcing.amplitude" = {{ start = {start}, stop = 0.9, points = {points} }}'

TIMING = ("point_seconds",)
"""Variables that measure the computer, not the scene."""


def swept_text(
    *axes: str,
    title: str = "a sweep",
    mass: float = 1.0,
    damping_ratio: float = 0.05,
    position: float = 1.0,
    restitution: float = 0.7,
    transient_periods: int = 10,
    recorded_periods: int = 2,
) -> str:
    """Return a scene of the impact oscillator with the lines of a sweep; without any, more lines may follow."""
    numbers = {"mass": mass, "damping_ratio": damping_ratio, "position": position, "restitution": restitution}
    periods = {"transient_periods": transient_periods, "recorded_periods": recorded_periods}
    return SCENE.format(title=title, **numbers, **periods) + "\n".join(axes)


def axis(key: str, values: Iterable[float], path: str = "independent") -> str:
    """Return the line of a swept key."""
    return f'"{key}" = {{ values = {list(values)}, path = "{path}" }}'


def frequency(points: int, path: str = "independent") -> str:
    """Return the line of a swept angular frequency."""
    return f'"forcing.angular_frequency" = {{ start = 0.6, stop = 1.6, points = {points}, path = "{path}" }}'


def frequency_text(
    points: int,
    path: str = "independent",
    milliseconds: float = 1.0,
    restitution: float = 0.7,
    title: str = "busy",
) -> str:
    """Return a scene that sweeps the angular frequency."""
    axes = frequency(points, path)
    return swept_text(axes, title=title, mass=milliseconds, damping_ratio=0.0, restitution=restitution)


def amplitude_text(points: int, start: float, milliseconds: float = 0.1) -> str:
    """Return a scene that sweeps the forcing amplitude; a runner can be made to fail where it is negative."""
    amplitudes = AMPLITUDES.format(points=points, start=start)
    return swept_text(amplitudes, title="amplitudes", mass=milliseconds, damping_ratio=0.0)


def plane_text(columns: int, amplitudes: int, path: str = "up-down", milliseconds: float = 0.1) -> str:
    """Return a scene that sweeps the angular frequency along branches, one pair for each amplitude."""
    axes = frequency(columns, path), AMPLITUDES.format(points=amplitudes, start=0.1)
    return swept_text(*axes, title="plane", mass=milliseconds, damping_ratio=0.0)


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
