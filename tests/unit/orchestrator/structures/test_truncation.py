"""Fewer modes of given ones: those that matrices would give, and the flexibility that residual vectors keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csc_array

from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.reduction import reduce
from vibroimpact.orchestrator.structures.truncation import truncated

POINTS = {"tip": {"12": 1.0}, "gap": {"5": 1.0, "9": -1.0}}


def chain(free: bool) -> Matrices:
    """Return the matrices of twelve unlike masses in a row, the first of which is held or free."""
    masses = np.linspace(1.0, 2.0, 12)
    springs = np.linspace(3.0, 5.0, 12) * 1e3
    stiffness = np.zeros((12, 12))
    for place, spring in enumerate(springs[1:], start=1):
        stiffness[np.ix_([place - 1, place], [place - 1, place])] += spring * np.array([[1, -1], [-1, 1]])
    stiffness[0, 0] += 0.0 if free else springs[0]
    names = tuple(str(number) for number in range(1, 13))
    return Matrices(csc_array(stiffness), csc_array(np.diag(masses)), None, names)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("residual", [False, True])
@pytest.mark.parametrize("count", [4, 7, 10])
def test_modes_of_modes_are_those_of_the_matrices(free: bool, residual: bool, count: int) -> None:
    rayleigh = (0.3, 1e-4)
    most = reduce(chain(free), POINTS, modes=12, base={"1": 1.0}, rayleigh=rayleigh)
    expected = reduce(chain(free), POINTS, modes=count, residual=residual, base={"1": 1.0}, rayleigh=rayleigh)
    found = truncated(most, POINTS, count, residual=residual)
    assert found is not None
    np.testing.assert_allclose(found.modes.natural, expected.natural, rtol=1e-8, atol=1e-9)
    for name in POINTS:
        np.testing.assert_allclose(np.abs(found.modes.shapes[name]), np.abs(expected.shapes[name]), rtol=1e-6)
    assert found.modes.participation is not None
    assert expected.participation is not None
    np.testing.assert_allclose(np.abs(found.modes.participation), np.abs(expected.participation), rtol=1e-6)
    assert found.modes.residual_vectors == expected.residual_vectors
    damping = 2.0 * expected.damping_ratios * expected.natural
    damping += 0.0 if expected.damping is None else np.diag(expected.damping)
    assert found.modes.damping is not None
    np.testing.assert_allclose(found.modes.damping, np.diag(damping), atol=1e-7)


def test_a_count_without_room_has_no_modes() -> None:
    most = reduce(chain(True), POINTS, modes=12)
    assert truncated(most, POINTS, 2, residual=True) is None  # 1 of a rigid body and 2 residual vectors
    assert truncated(most, POINTS, 3, residual=True) is not None


@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(1, 12), st.booleans())
def test_residual_vectors_keep_the_flexibility_of_any_modes(
    seed: int, size: int, count: int, free: bool
) -> None:
    random = np.random.default_rng(seed)
    natural = np.sort(10.0 ** random.uniform(0.0, 5.0, size))
    natural[0] *= not free
    shapes = {"one": random.normal(size=size), "two": random.normal(size=size)}
    shapes["node"] = shapes["two"] * (np.arange(size) < 2)
    modes = Modes(natural, random.uniform(0.0, 0.1, size), None, shapes, participation=shapes["one"])
    found = truncated(modes, shapes, count, residual=True)
    if found is None:
        assert count < size
        return
    weights, kept = found.weights, found.modes
    assert len(kept.natural) <= max(count, 1)
    np.testing.assert_allclose(weights.T @ weights, np.eye(len(kept.natural)), atol=1e-6)
    for one in shapes.values():
        elastic, own = natural > 0.0, kept.natural > 0.0
        whole = ((one[elastic] / natural[elastic]) ** 2).sum()
        part = (((one @ weights)[own] / kept.natural[own]) ** 2).sum()
        assert part == pytest.approx(whole, rel=1e-6)
