"""Contacts with power laws by steps that the contact sets, against the series of all modes."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.structure import Modes, Stop, Structure

from vibroimpact.fmus.core import beam_modes

Array = NDArray[np.float64]
#: Tolerance of the series that are the reference.
REFERENCE = 1e-13


@dataclass(frozen=True)
class Scene:
    """A body that moves into its first stop, and the inputs that act on it."""

    modes: Modes
    stops: tuple[Stop, ...]
    displacement: Array
    velocity: Array
    held: Array = field(default_factory=lambda: np.zeros(1))
    slope: Array = field(default_factory=lambda: np.zeros(1))
    observed: Array | None = None

    def body(self, tolerance: float, *, by_series: bool = False, extrema: bool = False) -> Structure:
        """Return the body at its start."""
        return Structure(
            self.modes,
            self.stops,
            self.displacement,
            self.velocity,
            tolerance=tolerance,
            observed=self.observed,
            extrema=extrema,
            by_series=by_series,
            at_once=not by_series,
        )

    def contact(self, tolerance: float, *, by_series: bool = False) -> Array:
        """Return restitution, impulse, duration and largest force of the first contact."""
        lowest = float(np.max(np.asarray(self.modes.natural)[:1]))
        with self.body(tolerance, by_series=by_series) as body:
            for _ in range(400):
                body.advance(0.3 / lowest, held=self.held, held_rate=self.slope)
                if len(body.impacts):
                    row = body.impacts[0]
                    return np.array([row[6], row[4], row[7], body.peaks[0, 3]])
        return np.full(4, math.nan)


def struck_beam(
    modes: int, damping: float, stop: Stop, boundary: str = "clamped_free", at: float = 1.0
) -> Scene:
    """Return a beam whose point `at` moves into the stop, with the shape of a static load there."""
    found = beam_modes("clamped_free", modes)
    natural, shape = np.asarray(found.eigenvalues) ** 2, np.asarray(found.shapes([at]))[0]
    velocity = shape / natural**2
    velocity *= 0.3 / (velocity @ shape)
    force = 0.15 * shape
    placed = replace(stop, shape=shape, position=1e-3)
    return Scene(Modes(natural, damping, force, 3.4), (placed,), np.zeros(modes), velocity)


LAWS = {
    "hertz": Stop([1.0], law="hertz", stiffness=1e4),
    "hunt_crossley": Stop([1.0], law="hunt_crossley", stiffness=1e4, damping=0.5),
    "odd exponent": Stop([1.0], law="hunt_crossley", stiffness=1e4, damping=0.5, exponent=1.3),
}


@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("modes", [4, 16, 64])
def test_a_contact_is_as_exact_as_its_tolerance(modes: int, law: str, damping: float) -> None:
    scene = struck_beam(modes, damping, LAWS[law])
    right = scene.contact(REFERENCE, by_series=True)
    for tolerance in (1e-6, 1e-8, 1e-10):
        found = scene.contact(tolerance)
        assert abs(found[0] - right[0]) < 4.0 * tolerance
        assert abs(found[1] / right[1] - 1.0) < 4.0 * tolerance
        assert abs(found[2] / right[2] - 1.0) < 4.0 * tolerance
        assert abs(found[3] / right[3] - 1.0) < 100.0 * tolerance


@st.composite
def random_scenes(draw: st.DrawFn) -> Scene:
    """Draw a body of 4 to 64 modes: soft and stiff, slow and fast, ringing, with loads that slope."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    modes = draw(st.sampled_from([4, 6, 8, 16, 32, 64]))
    if draw(st.booleans()):
        found = beam_modes(draw(st.sampled_from(["clamped_free", "pinned_pinned", "clamped_clamped"])), modes)
        natural, shape = (
            np.asarray(found.eigenvalues) ** 2,
            np.asarray(found.shapes([rng.uniform(0.1, 1.0)]))[0],
        )
    else:
        natural, shape = np.sort(10.0 ** rng.uniform(-1.0, 3.0, modes)), rng.normal(size=modes)
    speed = 10.0 ** draw(st.floats(-4.0, 1.0))
    side = draw(st.sampled_from(["upper", "lower"]))
    sign = 1.0 if side == "upper" else -1.0
    velocity = rng.normal(size=modes) / (1.0 + np.arange(modes))
    velocity *= sign * speed / (velocity @ shape)
    ringing = 10.0 ** draw(st.floats(-8.0, -1.0))
    displacement = ringing * speed * rng.normal(size=modes) / natural**1.5
    stop = Stop(
        shape,
        float(shape @ displacement) + sign * 1e-6 * speed / natural[-1],
        law=draw(st.sampled_from(["hertz", "hunt_crossley"])),
        side=side,
        stiffness=10.0 ** draw(st.floats(2.0, 7.0)),
        damping=draw(st.floats(0.0, 1.0)) / speed,
        exponent=draw(st.sampled_from([1.0, 1.3, 1.5, 2.0, 2.5])),
    )
    size = speed * natural[0]
    return Scene(
        Modes(
            natural,
            draw(st.sampled_from([0.0, 0.001, 0.02, 0.3])),
            shape * size * draw(st.floats(0.0, 1.0)),
            float(natural[0]) * draw(st.floats(0.1, 5.0)),
        ),
        (stop,),
        displacement,
        velocity,
        held=rng.normal(size=modes) * size * draw(st.integers(0, 1)),
        slope=rng.normal(size=modes) * size * natural[0] * draw(st.integers(0, 1)),
    )


@given(random_scenes(), st.sampled_from([1e-10, 1e-8]))
def test_no_contact_is_less_exact_than_by_series(scene: Scene, tolerance: float) -> None:
    right = scene.contact(REFERENCE, by_series=True)
    found, series = scene.contact(tolerance), scene.contact(tolerance, by_series=True)
    if np.isnan([right, found, series]).any():
        assert np.isnan(right).all() == np.isnan(found).all()
        return
    allowed = 8.0 * np.maximum(tolerance, np.abs(series[0] - right[0]))
    assert abs(found[0] - right[0]) <= allowed
    lasts = 8.0 * max(tolerance, abs(series[2] / right[2] - 1.0))
    assert abs(found[2] / right[2] - 1.0) <= lasts


#: Natural frequency, shape, velocity and force of each mode; stiffness, damping, exponent and frequency of the force.
#: At loose tolerances the ways out of these contacts went on beyond the end of the force, as those of thin contacts.
SPENT = {
    "4 modes": (
        [
            (0.149, 0.153, -0.519, 0.00277),
            (1.43, -0.51, 0.427, -0.00924),
            (12.9, -0.172, 1.04, -0.00313),
            (228.0, -0.808, -0.949, -0.0146),
        ],
        (31.4, 2.91, 2.0, 0.297),
    ),
    "8 modes": (
        [
            (0.259, -2.45, 1.2, -0.0204),
            (0.484, 0.37, -1.67, 0.00309),
            (2.51, -0.823, 0.158, -0.00685),
            (3.44, -0.751, -0.169, -0.00626),
            (43.7, -0.369, -2.48, -0.00307),
            (98.1, -0.61, -1.18, -0.00508),
            (123.0, 0.44, -2.33, 0.00366),
            (911.0, 1.76, 2.17, 0.0147),
        ],
        (16.2, 0.704, 1.0, 0.517),
    ),
}


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("by_series", [True, False])
@pytest.mark.parametrize("name", SPENT)
def test_a_hunt_crossley_contact_ends_at_the_speed_that_spends_its_force(
    name: str, by_series: bool, tolerance: float
) -> None:
    modes, (stiffness, damping, exponent, frequency) = SPENT[name]
    natural, shape, velocity, force = np.ascontiguousarray(np.transpose(modes))
    stop = Stop(shape, 1e-12, law="hunt_crossley", stiffness=stiffness, damping=damping, exponent=exponent)
    scene = Scene(Modes(natural, 0.02, force, frequency), (stop,), np.zeros_like(natural), velocity)
    # 1 + damping d' is 0 at the end, and the contact has begun with the speed shape . velocity
    found = scene.contact(tolerance, by_series=by_series)
    assert abs(found[0] * damping * (shape @ velocity) - 1.0) < 4.0 * tolerance


def test_elastic_contacts_of_an_undamped_beam_conserve_energy() -> None:
    scene = struck_beam(64, 0.0, LAWS["hertz"])
    scene = replace(scene, modes=replace(scene.modes, force=0.0, angular_frequency=0.0))
    tolerance = 1e-10
    with scene.body(tolerance) as body:
        start = body.energy
        body.advance(8.0)
        while body.statuses[0] != "free":
            body.advance(1e-3)
        assert len(body.impacts) > 20
        assert abs(body.energy / start - 1.0) < tolerance * len(body.impacts)


def test_samples_within_a_contact_lie_on_the_motion_without_samples() -> None:
    scene = struck_beam(32, 0.02, LAWS["hunt_crossley"])
    moments = [0.0002, 0.0061, 0.0099, 0.0101, 0.02, 0.0613]
    with scene.body(1e-10) as sampled, scene.body(REFERENCE, by_series=True) as series:
        for before, moment in zip([0.0, *moments], moments, strict=False):
            sampled.advance(moment - before)
            series.advance(moment - before)
            assert np.abs(sampled.velocity - series.velocity).max() < 1e-9 * np.abs(series.velocity).max()
            assert abs(sampled.forces[0] - series.forces[0]) < 1e-8 * max(1.0, series.forces[0])


@pytest.mark.parametrize("place", [1.0, 0.37])
def test_extremes_during_a_contact_are_those_of_the_series(place: float) -> None:
    scene = struck_beam(16, 0.0, LAWS["hertz"])
    scene = replace(scene, observed=np.asarray(beam_modes("clamped_free", 16).shapes([place]))[0])
    with (
        scene.body(1e-10, extrema=True) as body,
        scene.body(REFERENCE, by_series=True, extrema=True) as series,
    ):
        for _ in range(8):
            body.advance(0.03)
            series.advance(0.03)
            for found, right in (
                (body.displacement_max, series.displacement_max),
                (body.displacement_min, series.displacement_min),
            ):
                assert abs(found - right) < 1e-9 * (series.displacement_max - series.displacement_min)


@pytest.mark.parametrize("law", ["restitution", "kelvin_voigt", "hertz"])
@pytest.mark.parametrize("gap", [3e-4, 1e-3, 4e-3])
def test_another_stop_met_during_the_contact_is_not_passed(law: str, gap: float) -> None:
    scene = struck_beam(16, 0.02, LAWS["hertz"])
    middle = np.asarray(beam_modes("clamped_free", 16).shapes([0.6]))[0]
    other = Stop(middle, gap, law=law, restitution=0.6, stiffness=1e3, damping=1.0)
    scene = replace(scene, stops=(*scene.stops, other))
    with scene.body(1e-10) as body, scene.body(REFERENCE, by_series=True) as series:
        body.advance(0.25)
        series.advance(0.25)
        assert len(series.impacts) == len(body.impacts) > 1
        assert np.array_equal(series.impacts[:, 5], body.impacts[:, 5])
        assert np.abs(series.impacts[:, 1] - body.impacts[:, 1]).max() < 1e-9


@pytest.mark.parametrize("modes", [16, 64])
def test_stops_that_press_at_once_are_followed_together(modes: int) -> None:
    scene = struck_beam(modes, 0.02, LAWS["hertz"])
    places = (0.5, 0.7, 0.85)
    shapes = np.asarray(beam_modes("clamped_free", modes).shapes(places))
    others = tuple(
        Stop(shape, 1e-3 * place**1.8, law=law, stiffness=1e4, damping=0.5)
        for shape, place, law in zip(shapes, places, ("hertz", "hunt_crossley", "hertz"), strict=True)
    )
    scene = replace(scene, stops=(*scene.stops, *others))
    together = 0
    with (
        scene.body(1e-10, extrema=True) as body,
        scene.body(REFERENCE, by_series=True, extrema=True) as series,
    ):
        for _ in range(16):
            body.advance(0.01)
            series.advance(0.01)
            assert body.statuses == series.statuses
            assert np.abs(body.velocity - series.velocity).max() < 1e-8 * np.abs(series.velocity).max()
            assert np.abs(body.forces - series.forces).max() < 1e-7 * max(1.0, series.forces.max())
            together = max(together, body.statuses.count("yielding"))
        assert together > 1
        assert np.allclose(body.impacts, series.impacts, rtol=1e-7, atol=1e-9)
        assert abs(body.displacement_max - series.displacement_max) < 1e-9 * series.displacement_max


def test_a_beam_of_64_modes_costs_a_fraction_of_the_series() -> None:
    scene = struck_beam(64, 0.02, LAWS["hertz"])
    cost = {}
    for by_series in (False, True):
        with scene.body(1e-10, by_series=by_series) as body:
            body.advance(0.5)
            taken = []
            for _ in range(3):
                began, before = time.process_time(), len(body.impacts)
                body.advance(1.8)
                taken.append((time.process_time() - began) / max(1, len(body.impacts) - before))
            cost[by_series] = min(taken)
    assert cost[False] < 0.2 * cost[True]
