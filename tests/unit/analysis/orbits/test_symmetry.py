"""Mirror images of orbits, and the bodies that have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form, find_orbit
from vibroimpact.analysis.orbits.periodic import evaluated
from vibroimpact.analysis.orbits.symmetry import are_alike, is_symmetric, mirror_image, mirrored_contacts


def between(frequency: float = 0.97, **changes: object) -> ImpactingBody:
    one = np.ones(1)
    stops = Contact(one, 1.0, 1.0, 0.7), Contact(one, -1.0, -1.0, 0.7)
    body = ImpactingBody(one, 0.04 * one, 0.5 * one, 0.0 * one, frequency, 0.0, stops, one)
    return replace(body, **changes)  # type: ignore[arg-type]


def test_bodies_with_a_mirror_image_are_known() -> None:
    one = np.ones(1)
    upper, lower = between().contacts
    third = {3: np.array([0.1 + 0.2j])}
    moving = replace(upper, motion={1: 0.1j, 2: 0.05}), replace(lower, motion={1: 0.1j, 2: -0.05})
    # a stop below may be written as one above of a mirrored shape
    turned = Contact(-one, 1.0, 1.0, 0.7)
    for body in (
        between(),
        between(further=third),
        between(contacts=moving),
        between(contacts=(upper, turned)),
    ):
        assert mirrored_contacts(body) is not None
        assert mirrored_contacts(body).tolist() == [1, 0]  # type: ignore[union-attr]
    for body in (
        between(held=0.01 * one),
        between(further={2: np.array([0.1 + 0.0j])}),
        between(contacts=(upper,)),
        between(contacts=(upper, replace(lower, position=-0.999))),
        between(contacts=(upper, replace(lower, restitution=0.71))),
        between(contacts=(moving[0], replace(lower, motion={1: 0.1j, 2: 0.05}))),
    ):
        assert mirrored_contacts(body) is None
        assert mirror_image(closed_form(body, 1, 0)[0]) is None


@given(
    st.floats(0.9, 1.15), st.floats(0.02, 0.2), st.floats(0.4, 0.9), st.floats(0.0, 0.2), st.floats(0.0, 0.1)
)
@settings(max_examples=40, deadline=None)
def test_the_mirror_image_of_an_orbit_is_an_orbit(
    frequency: float, ratio: float, restitution: float, third: float, moved: float
) -> None:
    one = np.ones(1)
    stops = tuple(
        Contact(one, side, 0.5 * side, restitution, {1: moved * 1j, 2: side * 0.3 * moved})
        for side in (1.0, -1.0)
    )
    further = {3: np.array([third * (1.0 + 1.0j)])}
    body = between(frequency, damping_ratios=ratio * one, contacts=stops, further=further)
    for orbit in closed_form(body, 1, 0):
        image = mirror_image(orbit)
        assert image is not None
        assert image.contacts.tolist() == [1]
        found = evaluated(body, image.contacts, image.phases, 1)
        assert np.abs(found.distances).max() < 1e-11 * body.scale
        np.testing.assert_allclose(found.velocities, orbit.velocities, rtol=1e-9, atol=1e-11)
        again = mirror_image(image)
        assert again is not None
        assert are_alike(again, orbit)
        assert not is_symmetric(orbit)


def test_an_orbit_that_hits_both_stops_alike_is_symmetric() -> None:
    orbit = find_orbit(between(0.99), [0.1, 0.1 + np.pi], [0, 1])
    assert is_symmetric(orbit)
    assert np.diff(orbit.phases) == pytest.approx([np.pi], abs=1e-9)
