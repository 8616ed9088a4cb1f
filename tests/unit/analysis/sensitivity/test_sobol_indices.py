"""Sobol indices from arrays: closed forms, scipy's estimator, intervals, and missing values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import qmc
from scipy.stats import sobol_indices as scipy_indices

from vibroimpact.analysis.sensitivity import Indices, sobol_indices
from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]


def ishigami(x: Floats) -> Floats:
    angles = math.pi * (2.0 * x - 1.0)
    bent = 0.1 * angles[:, 2] ** 4
    value: Floats = np.sin(angles[:, 0]) * (1.0 + bent) + 7.0 * np.sin(angles[:, 1]) ** 2
    return value


def exact_ishigami() -> tuple[Floats, Floats]:
    """Return first-order and total indices (T. Ishigami and T. Homma, ISUMA 1990)."""
    a, b = 7.0, 0.1
    alone = np.array([0.5 * (1.0 + b * math.pi**4 / 5.0) ** 2, a * a / 8.0, 0.0])
    together = b * b * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    variance = alone.sum() + together
    return alone / variance, (alone + np.array([together, 0.0, together])) / variance


SPREADS = np.array([0.0, 1.0, 4.5, 9.0])


def g_function(x: Floats) -> Floats:
    value: Floats = np.prod((np.abs(4.0 * x - 2.0) + SPREADS) / (1.0 + SPREADS), axis=1)
    return value


def exact_g_function() -> tuple[Floats, Floats]:
    """Return first-order and total indices (A. Saltelli and I. M. Sobol, 1995)."""
    parts = 1.0 / (3.0 * (1.0 + SPREADS) ** 2)
    variance = np.prod(1.0 + parts) - 1.0
    return parts / variance, parts * np.prod(1.0 + parts) / (1.0 + parts) / variance


def points(power: int, keys: int, seed: int) -> tuple[Floats, Floats, Floats]:
    both = qmc.Sobol(2 * keys, seed=seed).random_base2(power)
    a, b = both[:, :keys], both[:, keys:]
    swapped = np.eye(keys, dtype=bool)
    return a, b, np.where(swapped, b[:, None], a[:, None])


def values_of(function, power: int, keys: int, seed: int = 1) -> tuple[Floats, Floats, Floats]:  # type: ignore[no-untyped-def]
    a, b, mixed = points(power, keys, seed)
    return function(a)[:, None], function(b)[:, None], np.stack([function(x) for x in mixed])[..., None]


def estimated(a: Floats, b: Floats, mixed: Floats, **options: float) -> Indices:
    return sobol_indices(a, b, mixed, **{"resamples": 200, **options})  # type: ignore[arg-type]


FUNCTIONS = [(ishigami, 3, exact_ishigami()), (g_function, 4, exact_g_function())]


@pytest.mark.parametrize(("function", "keys", "exact"), FUNCTIONS, ids=["ishigami", "g"])
def test_indices_come_to_their_closed_forms_with_more_points(function, keys, exact):  # type: ignore[no-untyped-def]
    errors = []
    for power in (8, 12):
        found = estimated(*values_of(function, power, keys))
        errors.append(
            [abs(found.first_order[0] - exact[0]).max(), abs(found.total_order[0] - exact[1]).max()]
        )
    assert np.max(errors[1]) < 0.02
    assert (np.array(errors[1]) < np.array(errors[0])).all()


@pytest.mark.parametrize(("function", "keys", "exact"), FUNCTIONS, ids=["ishigami", "g"])
def test_intervals_hold_the_closed_forms(function, keys, exact):  # type: ignore[no-untyped-def]
    held = []
    for seed in range(10):
        found = estimated(*values_of(function, 8, keys, seed))
        for interval, truth in zip((found.first_interval[0], found.total_interval[0]), exact, strict=True):
            # the total index of a key without effect is 0 to rounding, and so is its interval
            held.append((interval[:, 0] <= truth + 1e-12) & (truth - 1e-12 <= interval[:, 1]))
    # 95 %, and more for points that are more even than random points
    assert np.mean(held) > 0.9


def test_indices_are_those_of_scipy():
    a, b, mixed = values_of(ishigami, 9, 3)
    other = scipy_indices(func={"f_A": a.T, "f_B": b.T, "f_AB": np.moveaxis(mixed, 0, -1)}, n=512)
    found = estimated(a, b, mixed)
    np.testing.assert_allclose(found.first_order[0], other.first_order, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found.total_order[0], other.total_order, rtol=1e-12)


def test_neither_unit_nor_offset_nor_other_quantities_change_indices():
    a, b, mixed = values_of(ishigami, 6, 3)
    alone = estimated(a, b, mixed)
    many = estimated(*(np.concatenate([x, 1e-200 * x, 1e200 * x, 5.0 + x], axis=-1) for x in (a, b, mixed)))
    for name in ("first_order", "total_order", "first_interval", "total_interval"):
        np.testing.assert_allclose(getattr(many, name), np.repeat(getattr(alone, name), 4, axis=0), rtol=1e-9)


def test_the_same_seed_gives_the_same_intervals_and_another_one_others():
    values = values_of(g_function, 6, 4)
    one, same, other = (estimated(*values, seed=seed) for seed in (3, 3, 4))
    assert np.array_equal(one.first_interval, same.first_interval)
    assert not np.array_equal(one.first_interval, other.first_interval)
    assert np.array_equal(one.first_order, other.first_order)


def test_a_higher_level_has_wider_intervals():
    values = values_of(g_function, 6, 4)
    narrow, wide = (np.ptp(estimated(*values, level=level).total_interval) for level in (0.5, 0.99))
    assert narrow < wide


@pytest.mark.parametrize("missing", [np.nan, np.inf])
def test_blocks_with_a_value_that_is_not_finite_are_left_out_of_their_quantity(missing: float):
    a, b, mixed = (np.concatenate([x, x], axis=-1) for x in values_of(ishigami, 7, 3))
    mixed[5, 1, 0], a[7, 0], b[7, 0] = missing, missing, missing
    found = estimated(a, b, mixed)
    kept = np.delete(np.arange(128), [5, 7])
    fewer = estimated(a[kept], b[kept], mixed[kept])
    assert found.blocks.tolist() == [126, 128]
    assert found.total_order[0] == pytest.approx(fewer.total_order[0])
    assert found.total_order[1] == pytest.approx(estimated(*values_of(ishigami, 7, 3)).total_order[0])


def test_a_constant_quantity_has_no_indices():
    a, b, mixed = values_of(ishigami, 6, 3)
    for constant in (0.0, 3.0, 1e-320):
        found = estimated(constant + 1e-12 * constant * a, 0 * b + constant, 0 * mixed + constant)
        assert np.isnan(found.total_order).all()
        assert np.isnan(found.first_interval).all()


def test_fewer_than_eight_blocks_have_no_indices():
    a, b, mixed = values_of(ishigami, 3, 3)
    assert np.isfinite(estimated(a, b, mixed).total_order).all()
    a[0] = np.nan
    found = estimated(a, b, mixed)
    assert found.blocks.tolist() == [7]
    assert np.isnan(found.total_order).all()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"level": 1.0}, "level: expected a number between 0 and 1, got 1.0"),
        ({"level": math.nan}, "level: expected a number between 0 and 1, got nan"),
        ({"resamples": 1}, "resamples: expected a whole number from 2 to 1000000, got 1"),
        ({"level": "high"}, "level: expected a number between 0 and 1, got 'high'"),
        ({"resamples": 10.5}, "resamples: expected a whole number from 2 to 1000000, got 10.5"),
        ({"seed": None}, "seed: expected a whole number >= 0, got None"),
        ({"seed": -1}, "seed: expected a whole number >= 0, got -1"),
    ],
)
def test_a_bootstrap_that_makes_no_sense_is_refused(options: dict[str, float], text: str):
    with pytest.raises(UsageError, match=text):
        estimated(*values_of(ishigami, 3, 3), **options)
