"""Given rigid-body modes joined by links: the motions that remain free, and the modes of the whole."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.bodies.assembly import Assembly, Joint, MassesPart, ModesPart

MASS, LENGTH = 2.0, 1.0
PLACES = (-0.5, 0.5, 0.2)


def rigid_bar(mass: float = MASS) -> ModesPart:
    """Return a free bar by its translation and its rotation, with points at both ends and between."""
    inertia = mass * LENGTH**2 / 12.0
    shapes = np.array([[1.0 / np.sqrt(mass), place / np.sqrt(inertia)] for place in PLACES])
    none = [0.0, 0.0]
    return ModesPart(none, none, np.zeros((2, 2)), shapes, none, none, none)


def free_count(parts: list[ModesPart | MassesPart], joints: list[Joint]) -> int:
    return int((Assembly(parts, joints).frequencies == 0.0).sum())


def spring(first: tuple[int, float], second: tuple[int, float] | None, stiffness: float = 3.0) -> Joint:
    return Joint(first, second, stiffness, 0.0)


def test_a_bar_on_two_springs_has_the_modes_of_the_textbook() -> None:
    found = Assembly([rigid_bar()], [spring((0, 1), None, 3.0), spring((0, 2), None, 5.0)])
    stiffness = np.array([[8.0, 1.0], [1.0, 2.0]])  # of the translation and the rotation of the centre
    exact = np.sqrt(np.linalg.eigvals(stiffness / np.array([[MASS], [MASS / 12.0]])))
    assert found.frequencies == pytest.approx(np.sort(exact), rel=1e-14)


def test_links_leave_the_motions_that_stretch_none_of_them() -> None:
    ball = MassesPart([1.0], [0.0, 0.0], [0.0, 0.0], [0.0], [0.0])
    assert free_count([rigid_bar()], []) == 2
    assert free_count([rigid_bar()], [spring((0, 1), None)]) == 1
    assert free_count([rigid_bar()], [spring((0, 1), (0, 2))]) == 1
    assert free_count([rigid_bar(), rigid_bar(1.0)], [spring((0, 1), (1, 2))]) == 3
    three = [spring((0, place), (1, place)) for place in (1, 2, 3)]
    assert free_count([rigid_bar(), rigid_bar(1.0)], three) == 2  # three springs, two ways
    assert free_count([rigid_bar(), ball], [spring((0, 1), (1, 1))]) == 2
    assert free_count([rigid_bar(), ball], [spring((0, 1), (1, 1), -3.0)]) == 2


def test_the_further_damping_of_a_part_is_that_of_the_whole() -> None:
    damping = np.array([[0.2, 0.05], [0.05, 0.1]])
    none = [0.0, 0.0]
    part = ModesPart([1.0, 3.0], [0.1, 0.0], damping, np.eye(2), none, none, none)
    alone = Assembly([part], [])
    assert alone.damping == pytest.approx(damping + np.diag([0.2, 0.0]), rel=1e-15)
    assert alone.is_coupled
    proportional = ModesPart([1.0, 3.0], none, np.diag([0.2, 0.1]), np.eye(2), none, none, none)
    assert not Assembly([proportional], []).is_coupled
    joined = Assembly([part, rigid_bar()], [spring((0, 1), (1, 1))])
    expected = np.zeros((4, 4))
    expected[:2, :2] = damping + np.diag([0.2, 0.0])
    assert joined.damping == pytest.approx(joined.shapes.T @ expected @ joined.shapes, abs=1e-14)


@given(st.integers(0, 2**32 - 1))
def test_random_given_modes_with_links_meet_their_equation(seed: int) -> None:
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(random.integers(1, 4)):
        count = int(random.integers(1, 6))
        natural = np.where(random.random(count) < 0.5, 0.0, 10.0 ** random.uniform(-1, 2, count)).tolist()
        none, shapes = [0.0] * count, random.normal(size=(3, count))
        parts.append(ModesPart(natural, none, np.zeros((count, count)), shapes, none, none, none))
    ends = [None, *((part, place) for part in range(len(parts)) for place in (1, 2, 3))]
    joints = []
    for _ in range(random.integers(0, 6)):
        one, other = random.integers(0, len(ends), 2)
        joints.append(Joint(ends[one], ends[other], 10.0 ** random.uniform(-2, 3), 0.0))
    found = Assembly(parts, joints)
    stiffness = sum(
        (each.stiffness * np.outer(each.shape, each.shape) for each in found.elements),
        np.zeros((len(found.masses),) * 2),
    )
    size = max(float(found.frequencies.max()) ** 2, 1.0)
    assert found.shapes.T @ found.shapes == pytest.approx(np.eye(len(found.masses)), abs=1e-11)
    assert found.shapes.T @ stiffness @ found.shapes == pytest.approx(
        np.diag(found.frequencies**2), abs=1e-11 * size
    )
    assert (found.frequencies == 0.0).sum() == len(found.masses) - np.linalg.matrix_rank(stiffness, tol=1e-9)
