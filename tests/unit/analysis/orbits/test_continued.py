"""Attractors continued over a parameter, matched by their features."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basins import Attractor, Basins, Features
from vibroimpact.analysis.orbits.attractors.continued import Continued, features_apart
from vibroimpact.analysis.orbits.classify import RunClass


def attractor(impacts: float, speed: float, size: float = 1.0, name: tuple[int, int] = (1, 1)) -> Attractor:
    kind = RunClass(OrbitClass.periodic, *name) if impacts else RunClass(OrbitClass.no_impacts)
    rows = np.array([[impacts, impacts * speed, impacts * speed, 0.0, speed]])
    return Attractor(kind, np.zeros((1, 2)), 0.01, Features(rows, np.array([-size, size])))


def basins(attractors: list[Attractor]) -> Basins:
    labels = np.arange(10, dtype=np.int16) % max(len(attractors), 1)
    return Basins(np.zeros((10, 2)), labels, np.ones(2), attractors)


@given(st.permutations(range(4)), st.floats(0.0, 0.05))
@settings(max_examples=30)
def test_attractors_that_change_little_keep_their_number_in_any_order(
    order: list[int], change: float
) -> None:
    known = [attractor(0.0, 0.0), attractor(1.0, 1.0), attractor(1.0, 3.0), attractor(0.5, 1.0)]
    continued = Continued()
    continued.add(basins(known))
    moved = [attractor(each.impacts[0], each.features.at_stops[0, 4] * (1.0 + change)) for each in known]
    continued.add(basins([moved[place] for place in order]))
    assert continued.numbers[1].tolist() == list(order)
    assert len(continued.last) == 4


def test_a_doubled_period_is_one_attractor_and_motion_without_impacts_is_another() -> None:
    continued = Continued()
    continued.add(basins([attractor(1.0, 1.0)]))
    continued.add(basins([attractor(1.0, 1.05, name=(2, 2)), attractor(0.0, 0.0)]))
    assert continued.names == ["P(1,1), P(2,2)", "no impacts"]
    assert np.isinf(features_apart(attractor(0.0, 0.0), attractor(1.0, 1.0)))


def test_an_attractor_that_comes_back_keeps_its_number_and_equal_names_are_numbered() -> None:
    continued = Continued()
    slow, fast = attractor(1.0, 1.0), attractor(1.0, 4.0)
    for each in ([slow, fast], [fast], [slow, fast]):
        continued.add(basins(each))
    assert [each.tolist() for each in continued.numbers] == [[0, 1], [1], [0, 1]]
    assert continued.names == ["P(1,1) (1)", "P(1,1) (2)"]
