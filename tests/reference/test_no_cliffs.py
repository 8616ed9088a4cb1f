"""No cliffs: neighbours among bodies, stops, laws, restitutions and excitations cost at most ten times each other."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from support.neighbours import LADDERS, Cost, Shape, cliffs, shapes, work

MOST = 10.0


@pytest.fixture(scope="module")
def works() -> Mapping[Shape, Cost]:
    return {shape: work(shape) for shape in shapes()}


@pytest.mark.parametrize("ladder", LADDERS)
def test_a_step_on_a_ladder_takes_at_most_ten_times_the_work(
    works: Mapping[Shape, Cost], ladder: str
) -> None:
    assert "\n".join(cliffs(works, ladder, MOST)) == ""


def test_every_ladder_has_neighbours(works: Mapping[Shape, Cost]) -> None:
    for ladder in LADDERS:
        assert len(cliffs(works, ladder, 0.0)) >= 16, ladder


def test_the_work_of_a_motion_is_the_same_each_time(works: Mapping[Shape, Cost]) -> None:
    shape = Shape("beam", 16, 4, "kelvin_voigt")
    assert work(shape) == works[shape]
