"""What `vibroimpact.fmus.modes` refuses, and in which words."""

from typing import Any

import numpy as np
import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.modes import beam_modes, chain_modes

CHAINS: list[tuple[dict[str, Any], str]] = [
    ({"masses": [], "stiffnesses": [], "dampings": []}, "expected 1 to 64 masses"),
    ({"masses": [1.0] * 65, "stiffnesses": [1.0] * 65, "dampings": [0.0] * 65}, "got 65, 65 and 65"),
    ({"masses": [1.0], "stiffnesses": [1.0, 2.0], "dampings": [0.0]}, "got 1, 2 and 1"),
    ({"masses": [0.0], "stiffnesses": [1.0], "dampings": [0.0]}, "masses: expected finite numbers > 0"),
    ({"masses": [np.inf], "stiffnesses": [1.0], "dampings": [0.0]}, "masses: expected finite numbers > 0"),
    (
        {"masses": [1.0], "stiffnesses": [-1.0], "dampings": [0.0]},
        "stiffnesses: expected finite numbers >= 0",
    ),
    ({"masses": [1.0], "stiffnesses": [1.0], "dampings": [np.nan]}, "dampings: expected finite numbers >= 0"),
    ({"masses": [1.0], "stiffnesses": [1.0], "dampings": [0.0], "far_stiffness": -1.0}, "stiffnesses"),
    ({"masses": [[1.0]], "stiffnesses": [1.0], "dampings": [0.0]}, "a row of numbers"),
    ({"masses": [1e-300, 1.0], "stiffnesses": [1e300, 1.0], "dampings": [0.0, 0.0]}, "range of doubles"),
]


@pytest.mark.parametrize(("arguments", "message"), CHAINS)
def test_a_chain_of_impossible_numbers_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        chain_modes(**arguments)


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
    with pytest.raises(UsageError, match="expected points 0 <= s <= 1"):
        modes.static_stiffness(point)
    with pytest.raises(UsageError, match="expected points 0 <= s <= 1"):
        modes.collocation([0.5, point], 0)


@pytest.mark.parametrize("derivative", [-1, 4])
def test_a_derivative_of_another_order_is_refused(derivative: int) -> None:
    with pytest.raises(UsageError, match="derivative: expected 0 to 3"):
        beam_modes("clamped_free", 2).shapes(1.0, derivative)


@pytest.mark.parametrize("grid", [[0.5, 0.5, 1.0], [0.0, 0.5, 1.0]])
def test_a_collocation_grid_with_a_point_twice_or_on_a_support_is_refused(grid: list[float]) -> None:
    with pytest.raises(UsageError, match="Take each point once, and none on a support"):
        beam_modes("clamped_free", 3).collocation(grid, 2)


@pytest.mark.parametrize(("grid", "at"), [([0.5, 1.0], 1), ([0.3, 0.6, 1.0], 3), ([0.3, 0.6, 1.0], -1)])
def test_a_collocation_grid_needs_as_many_points_as_modes(grid: list[float], at: int) -> None:
    with pytest.raises(UsageError, match="as many points as modes"):
        beam_modes("clamped_free", 3).collocation(grid, at)


def test_a_material_that_cannot_be_is_refused() -> None:
    with pytest.raises(UsageError, match="slenderness >= 0"):
        beam_modes("clamped_free", 3).frequency_error(-0.1)


def test_modes_cannot_be_overwritten() -> None:
    with pytest.raises(ValueError, match="read-only"):
        beam_modes("clamped_free", 1).eigenvalues[0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        chain_modes([1], [1], [0]).shapes[0, 0] = 2.0
