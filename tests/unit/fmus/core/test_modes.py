"""Refusals of `beam_modes` and `residual_vectors`, and their messages."""

import numpy as np
import pytest
from support.modes import collocation

from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.core.modes import residual_vectors
from vibroimpact.fmus.errors import UsageError


def test_a_beam_of_unknown_ends_or_without_modes_is_refused() -> None:
    with pytest.raises(UsageError, match=r"clamped_free, .* got 'free_free'"):
        beam_modes("free_free", 3)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="count >= 1"):
        beam_modes("clamped_free", 0)


@pytest.mark.parametrize("point", [-1e-9, 1.0 + 1e-9, np.nan])
def test_a_point_outside_of_the_beam_is_refused(point: float) -> None:
    modes = beam_modes("clamped_free", 2)
    with pytest.raises(UsageError, match="expected points 0 <= s <= 1"):
        modes.shapes([0.5, point])


@pytest.mark.parametrize("derivative", [-1, 4])
def test_a_derivative_of_another_order_is_refused(derivative: int) -> None:
    with pytest.raises(UsageError, match="derivative: expected 0 to 3"):
        beam_modes("clamped_free", 2).shapes(1.0, derivative)


@pytest.mark.parametrize("grid", [[0.5, 0.5, 1.0], [0.0, 0.5, 1.0]])
def test_a_collocation_grid_with_a_point_twice_or_on_a_support_is_refused(grid: list[float]) -> None:
    with pytest.raises(ValueError, match="no combination of the modes is 1 at point 2"):
        collocation(beam_modes("clamped_free", 3), grid, 2)


def test_modes_cannot_be_overwritten() -> None:
    with pytest.raises(ValueError, match="read-only"):
        beam_modes("clamped_free", 1).eigenvalues[0] = 2.0


@pytest.mark.parametrize(
    "points", [[0.5, 0.5], [0.0], [1.0], [0.5, 0.5 + 1e-9], [], [0.1] * 9, [np.nan], [1.5]]
)
def test_residual_vectors_of_points_that_cannot_be_told_apart_are_refused(points: list[float]) -> None:
    with pytest.raises(UsageError, match="1 to 8 points that move and can be told apart"):
        residual_vectors("pinned_pinned", 3, points)


def test_residual_vectors_off_the_beam_are_refused() -> None:
    with pytest.raises(UsageError, match="expected points 0 <= s <= 1"):
        residual_vectors("clamped_free", 3, 1.0).shapes([0.5, -0.1])
