"""Classes of runs from impacts alone."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.analysis.orbits.classify import class_of
from vibroimpact.analysis.orbits.impact_classes import own_period, states_of_periods


def table(time: np.ndarray, velocity: np.ndarray, contact: np.ndarray, rests: bool = False) -> xr.Dataset:
    """Return impacts in the form of a dataset."""
    restitution = np.full(time.size, 0.5)
    if rests:
        restitution[-1] = 0.0
    names = ("impact_time", "impact_velocity", "impact_contact", "impact_restitution")
    columns = (time, velocity, contact, restitution)
    return xr.Dataset({name: ("impact", column) for name, column in zip(names, columns, strict=True)})


@given(
    places=st.lists(st.integers(0, 99), min_size=1, max_size=4, unique=True),
    periods=st.integers(1, 3),
    frequency=st.floats(0.1, 10.0),
    start=st.floats(0.0, 1e4),
)
def test_impacts_at_the_same_places_of_q_periods_are_p_of_q(
    places: list[int], periods: int, frequency: float, start: float
) -> None:
    phases = np.sort(places) / 100.0 * periods
    turns = (phases + periods * np.arange(16)[:, None]).ravel()
    speed = 1.0 + np.tile(np.arange(len(places)), 16)
    time = start + 2.0 * np.pi / frequency * turns
    states, counts = states_of_periods(table(time, speed, np.ones(time.size)), frequency)
    assert class_of(states, counts).name == f"P({len(places)},{periods})"


@given(count=st.integers(1, 6), scale=st.floats(1e-6, 1e6))
def test_a_motion_without_forcing_repeats_where_its_impacts_do(count: int, scale: float) -> None:
    gaps = 1.0 + np.arange(count) ** 2
    time = scale * np.cumsum(np.tile(gaps, 12))
    impacts = table(time, np.tile(2.0 + np.arange(count), 12), np.tile(1 + np.arange(count) % 2, 12))
    assert own_period(impacts, 1e-6) == (count, "")


def test_impacts_without_a_period_are_none() -> None:
    draw = np.random.default_rng(3)
    impacts = table(np.cumsum(draw.uniform(0.5, 1.0, 40)), draw.uniform(0.5, 1.0, 40), np.ones(40))
    assert own_period(impacts, 1e-6) == (0, "no forcing, and no period up to 19 impacts")


@pytest.mark.parametrize("rests", [False, True])
def test_impacts_that_end_have_no_period(rests: bool) -> None:
    speed = np.ones(20) if rests else 0.5 ** np.arange(20)
    impacts = table(np.arange(20.0), speed, np.ones(20), rests)
    assert own_period(impacts, 1e-6) == (0, "no forcing, and its impacts die away")
