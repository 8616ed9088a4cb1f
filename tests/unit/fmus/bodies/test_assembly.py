"""Several bodies with links as one set of modes: the modes of one chain, of beams, of bodies that nothing holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.bodies.assembly import Assembly, BeamPart, Joint, MassesPart
from vibroimpact.fmus.core.modes import chain_modes, spring_modes
from vibroimpact.fmus.errors import UsageError

BEAM = {
    **{"length": 0.4, "flexural_rigidity": 2.0, "mass_per_length": 0.3, "damping_ratio[1]": 0.01},
    **{"forcing_location": 1.0, "sensor_location": 1.0},
}
OF_THE_BEAM = {"modes": 3, "boundary": 1}
NUMBERS = st.floats(0.1, 10.0)


def ball(mass: float, stiffness: float = 0.0, damping: float = 0.0) -> MassesPart:
    return MassesPart([mass], [stiffness, 0.0], [damping, 0.0], [0.0], [0.0])


@given(st.data())
def test_a_chain_that_is_split_into_masses_and_links_has_its_modes(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 7))
    mass = np.array(data.draw(st.lists(NUMBERS, min_size=count, max_size=count)))
    stiffness = np.array(data.draw(st.lists(NUMBERS | st.just(0.0), min_size=count + 1, max_size=count + 1)))
    proportional = data.draw(st.booleans())
    drawn = data.draw(st.lists(NUMBERS | st.just(0.0), min_size=count + 1, max_size=count + 1))
    damping = 0.01 * stiffness if proportional else np.array(drawn)
    split = Assembly(
        [ball(each) for each in mass],
        [
            Joint((e - 1, 1) if e > 0 else None, (e, 1) if e < count else None, stiffness[e], damping[e])
            for e in range(count + 1)
        ],
    )
    whole = Assembly([MassesPart(mass, stiffness, damping, [0.0] * count, [0.0] * count)], [])
    modes = chain_modes(mass, stiffness, damping)
    apart = np.diff(modes.frequencies).min(initial=1.0) > 1e-3
    for one in (split, whole):
        assert one.frequencies == pytest.approx(modes.frequencies, rel=1e-11, abs=1e-14)
        assert one.is_coupled == (not modes.is_classical) or not apart
        if apart:
            assert one.shapes == pytest.approx(modes.shapes, rel=1e-8, abs=1e-8)
            assert one.damping_ratios == pytest.approx(modes.damping_ratios, rel=1e-8, abs=1e-10)


@given(st.lists(NUMBERS, min_size=2, max_size=6), st.integers(0, 2**32 - 1))
def test_modes_are_mass_normalised_and_meet_their_equation(masses: list[float], seed: int) -> None:
    random = np.random.default_rng(seed)
    count = len(masses)
    pairs = [tuple(random.choice(count, 2, replace=False)) for _ in range(2 * count)]
    joints = [Joint((int(a), 1), (int(b), 1), 10 ** random.uniform(-2, 2), 0.1) for a, b in pairs]
    beam = BeamPart(BEAM, OF_THE_BEAM)
    joints.append(Joint((0, 1), (count, 0.7), 3.0, 0.0))
    found = Assembly([*(ball(mass) for mass in masses), beam], joints)
    stiffness = sum(each.stiffness * np.outer(each.shape, each.shape) for each in found.elements)
    shapes, size = found.shapes, found.frequencies.max() ** 2
    assert shapes.T @ (found.masses[:, None] * shapes) == pytest.approx(np.eye(count + 3), abs=1e-11)
    assert shapes.T @ stiffness @ shapes == pytest.approx(np.diag(found.frequencies**2), abs=1e-11 * size)
    assert found.is_coupled


def test_two_equal_masses_that_a_spring_joins_have_the_modes_of_the_textbook() -> None:
    found = Assembly([ball(2.0, 8.0), ball(2.0, 8.0)], [Joint((0, 1), (1, 1), 4.0, 0.0)])
    assert found.frequencies == pytest.approx([2.0, math.sqrt(8.0)], rel=1e-15)
    assert found.shapes == pytest.approx(np.array([[0.5, 0.5], [0.5, -0.5]]), rel=1e-14)
    assert not found.is_coupled


def test_a_beam_alone_keeps_its_modes() -> None:
    part = BeamPart(BEAM, OF_THE_BEAM)
    found = Assembly([part], [])
    assert found.shapes == pytest.approx(np.eye(3) / math.sqrt(0.12), rel=1e-14)
    assert found.damping_ratios == pytest.approx([0.01, 0.0, 0.0])
    assert found.in_modes(found.point((0, 1.0))) == pytest.approx(
        np.array([2.0, -2.0, 2.0]) / math.sqrt(0.12)
    )


def test_bodies_that_nothing_holds_have_modes_of_frequency_0() -> None:
    joints = [
        Joint((0, 1), (1, 1), 5.0, 0.0),
        Joint((1, 1), (2, 1), 7.0, 0.0),
        Joint((0, 1), (2, 1), 3.0, 0.0),
    ]
    found = Assembly([ball(1.0), ball(2.0), ball(3.0), ball(0.5)], joints)
    assert found.frequencies[:2].tolist() == [0.0, 0.0]
    assert found.shapes[:, 0] == pytest.approx([6.0**-0.5] * 3 + [0.0])
    assert found.shapes[:3, 1].tolist() == [0.0, 0.0, 0.0]
    assert found.shapes[3, 1] == pytest.approx(0.5**-0.5)
    assert not found.is_coupled
    assert Assembly([ball(1.0, damping=0.1)], []).is_coupled  # such a mode has no damping ratio


def test_more_springs_than_the_core_takes_are_folded() -> None:
    rows = np.random.default_rng(3).normal(size=(200, 12))
    frequencies, vectors = spring_modes(rows)
    assert frequencies == pytest.approx(np.linalg.svd(rows)[1][::-1], rel=1e-13)
    assert rows.T @ rows == pytest.approx(vectors.T @ np.diag(frequencies**2) @ vectors, abs=1e-11)
    with pytest.raises(UsageError, match="1 to 64 coordinates, got 65"):
        spring_modes(np.zeros((2, 65)))


def test_a_light_mass_on_a_stiff_spring_leaves_slow_modes_exact() -> None:
    found = Assembly([ball(1.0, 1.0), ball(1e-12, 0.0)], [Joint((0, 1), (1, 1), 1e12, 0.0)])
    assert found.frequencies[0] == pytest.approx(1.0, rel=1e-11)
    assert found.frequencies[1] == pytest.approx(1e12, rel=1e-11)
