"""Assemblies with negative springs and dashpots: equations.md 1.9, 6.12."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp

from vibroimpact.fmus.bodies.assembly import Assembly, Joint, MassesPart


def chain(masses: list[float], springs: list[float], dashpots: list[float] | None = None) -> MassesPart:
    count = len(masses)
    return MassesPart(
        masses, [*springs, 0.0], [*(dashpots or [0.0] * count), 0.0], [0.0] * count, [0.0] * count
    )


def exact_squares(masses: list[float], springs: list[float]) -> list[float]:
    """Return the eigenvalues of a chain in 40 digits, ascending."""
    with mp.workdps(40):
        count = len(masses)
        matrix = mp.zeros(count)
        for i, k in enumerate(springs):
            matrix[i, i] += mp.mpf(k)
            if i:
                matrix[i - 1, i - 1] += mp.mpf(k)
                matrix[i, i - 1] = matrix[i - 1, i] = -mp.mpf(k)
        root = [mp.sqrt(mp.mpf(m)) for m in masses]
        scaled = mp.matrix(count)
        for i in range(count):
            for j in range(count):
                scaled[i, j] = matrix[i, j] / root[i] / root[j]
        return sorted(float(value) for value in mp.eigsy(scaled, eigvals_only=True))


@pytest.mark.parametrize("seed", range(12))
def test_modes_of_a_chain_with_negative_springs_are_those_of_40_digits(seed: int) -> None:
    draw = np.random.default_rng(seed)
    count = int(draw.integers(1, 9))
    masses, springs = 10.0 ** draw.uniform(-2, 2, count), 10.0 ** draw.uniform(-2, 2, count)
    springs[draw.integers(count)] *= -1.0
    found = Assembly([chain(masses.tolist(), springs.tolist())], [])
    squares = np.array(exact_squares(masses.tolist(), springs.tolist()))
    signed = found.frequencies * np.abs(found.frequencies)
    assert np.abs(signed - squares).max() <= 1e-14 * np.abs(squares).max()
    assert (np.diff(found.frequencies) >= 0.0).all()
    unit = found.shapes.T @ (masses[:, None] * found.shapes)
    assert np.abs(unit - np.eye(count)).max() <= 1e-13


def test_a_chain_that_nothing_ties_keeps_its_motion_without_a_spring() -> None:
    parts = [chain([1.0], [0.0]), chain([2.0], [0.0]), chain([0.5], [-3.0])]
    found = Assembly(parts, [Joint((0, 1.0), (1, 1.0), -4.0, 0.0)])
    assert found.frequencies[:2] == pytest.approx([-np.sqrt(6.0)] * 2, rel=1e-15)
    assert found.frequencies[2] == 0.0
    assert found.shapes[:2, 2].tolist() == pytest.approx([1.0 / np.sqrt(3.0)] * 2, rel=1e-15)
    assert found.shapes[2, 2] == 0.0


def test_a_negative_dashpot_has_a_negative_ratio_and_couples_as_others() -> None:
    found = Assembly([chain([1.0], [4.0], [-0.4])], [])
    assert found.damping_ratios.tolist() == [-0.1]
    assert not found.is_coupled
    two = Assembly([chain([1.0, 1.0], [1.0, 2.0], [0.1, -0.3])], [])
    assert two.is_coupled
    assert two.damping == pytest.approx(two.damping.T, rel=1e-15)


def test_positive_numbers_take_the_way_of_singular_values() -> None:
    # the bits of scenes without negative springs stay
    one = Assembly([chain([1.0, 2.0], [1.0, 3.0])], [])
    signed = one._signed_modes(one._rigid(), np.sqrt(one.masses))
    assert signed[0] == pytest.approx(one.frequencies, rel=1e-14)
    assert signed[1] == pytest.approx(one.shapes, rel=1e-13)
