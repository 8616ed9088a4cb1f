"""Orbits of bodies whose stops yield, for given phases of their contacts: equations.md 4.18."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, closed_form, find_orbit
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.periodic import evaluated
from vibroimpact.analysis.orbits.yielding_stops.motion import yielding_motion
from vibroimpact.analysis.orbits.yielding_stops.power_passages import PowerPassage
from vibroimpact.fmus.bodies.impacting_body import Press

ONE = np.ones(1)
KELVIN_VOIGT, HERTZ = Press("kelvin_voigt", 50.0, 1.0), Press("hertz", 80.0, 0.0, 1.5)
HUNT_CROSSLEY = Press("hunt_crossley", 80.0, 0.3, 1.5)
LAWS = [KELVIN_VOIGT, Press("kelvin_voigt", 50.0), HERTZ, HUNT_CROSSLEY]
NAMES = ["dashpot", "spring", "hertz", "hunt_crossley"]


def oscillator(press: Press, w: float = 1.2, position: float = 0.5) -> ImpactingBody:
    stop = Contact(ONE, 1.0, position, 0.0, press=press)
    return ImpactingBody(ONE, 0.05 * ONE, 0.5 * ONE, 0.0 * ONE, w, 0.0, (stop,), ONE)


def moved_body() -> ImpactingBody:
    """Return three modes under two sines and a constant force, between a rigid stop and two that yield."""
    rng = np.random.default_rng(5)
    shapes = rng.normal(size=(3, 3))
    return ImpactingBody(
        np.array([1.0, 2.3, 4.1]),
        np.array([0.05, 0.03, 0.02]),
        rng.normal(size=3),
        np.array([0.1, 0.0, -0.2]),
        1.1,
        0.0,
        (
            Contact(shapes[0], 1.0, 0.4, 0.0, {1: 0.05 + 0.02j}, press=KELVIN_VOIGT),
            Contact(shapes[1], -1.0, -0.6, 0.7, {2: 0.03j}),
            Contact(shapes[2], 1.0, 0.5, 0.0, press=HUNT_CROSSLEY),
        ),
        shapes[0],
        further={2: np.array(rng.normal(size=3) * (0.3 + 0.15j), dtype=np.complex128)},
    )


def mirrored_body(press: Press, side: float) -> ImpactingBody:
    """Return two modes at a stop that moves, above (1) or below (-1), under a force of the same sign."""
    stop = Contact(np.array([0.8, -0.5]), side, side * 0.3, 0.0, {1: side * (0.04 + 0.02j)}, press=press)
    forces, held = side * np.array([0.5, -0.2]), side * np.array([0.1, 0.3])
    return ImpactingBody(np.array([1.0, 2.7]), 0.03 * np.ones(2), forces, held, 1.2, 0.0, (stop,), np.ones(2))


@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from(LAWS),
    st.floats(0.0, 6.2),
    st.floats(0.2, 3.0),
    st.floats(-1.0, 1.0),
)
def test_a_contact_below_is_the_mirror_image_of_a_contact_above(
    press: Press, phase: float, speed: float, swing: float
) -> None:
    passed = []
    for side in (1.0, -1.0):
        motion = yielding_motion(mirrored_body(press, side))
        rows = np.array([motion.beyond[0], motion.approach[0]])
        vector = motion.forced.vector(side * np.array([0.3, swing, 0.1, -swing]), phase)
        own = motion.forced.motion
        off = rows @ vector - [0.0, side * speed]
        vector[own] -= np.linalg.lstsq(rows[:, own], off, rcond=None)[0]
        passed.append(motion.passages[0].through(vector, 30.0))
    above, below = passed
    assert above.impulse > 0.0
    for name in ("speed", "rebound", "duration", "impulse", "slope", "tangent", "shrinking"):
        np.testing.assert_allclose(getattr(below, name), getattr(above, name), rtol=1e-9, atol=1e-9)
    for name in ("after", "shift"):
        np.testing.assert_allclose(getattr(below, name), -getattr(above, name), rtol=1e-9, atol=1e-9)


def test_a_contact_outlasts_a_fast_mode_that_brakes_its_beginning() -> None:
    stop = Contact(np.ones(2), 1.0, 0.0, 0.0, press=Press("hertz", 150.0, 0.0, 1.5))
    rates = np.array([1.0, 20.0])
    body = ImpactingBody(rates, 0.02 * np.ones(2), np.zeros(2), np.zeros(2), 1.0, 0.0, (stop,), np.ones(2))
    motion = yielding_motion(body)
    before = motion.forced.vector(np.array([-0.05, 0.05, 0.9, 0.0]), 0.0)
    passage = motion.passages[0].through(before, 10.0)
    assert passage.duration > 0.2  # with the first acceleration alone: 0.09
    assert passage.after[:2].sum() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("press", LAWS, ids=NAMES)
def test_the_slopes_of_distances_and_speeds_are_their_differences(press: Press) -> None:
    body, contacts = oscillator(press), np.zeros(1, np.int32)
    for phase in (0.2, 1.1, 6.0):
        found = evaluated(body, contacts, np.array([phase]), 1)
        ends = [
            evaluated(body, contacts, np.array([phase + side * 1e-5]), 1, found.start) for side in (1, -1)
        ]
        for name, slope in (("distances", found.distance_slopes), ("velocities", found.velocity_slopes)):
            change = (getattr(ends[0], name) - getattr(ends[1], name)) / 2e-5
            np.testing.assert_allclose(slope[0], change, rtol=1e-7, atol=1e-8)


def test_the_slopes_of_three_contacts_of_all_kinds_are_their_differences() -> None:
    body, contacts, phases = moved_body(), np.array([0, 1, 2], np.int32), np.array([0.3, 2.0, 4.4])
    found = evaluated(body, contacts, phases, 1)
    assert (found.velocities > 0.0).any()
    for k in range(3):
        step = 1e-5 * np.eye(3)[k]
        ends = [evaluated(body, contacts, phases + side * step, 1, found.start) for side in (1, -1)]
        np.testing.assert_allclose(
            found.distance_slopes[:, k], (ends[0].distances - ends[1].distances) / 2e-5, rtol=1e-6, atol=1e-7
        )
        np.testing.assert_allclose(
            found.velocity_slopes[:, k],
            (ends[0].velocities - ends[1].velocities) / 2e-5,
            rtol=1e-6,
            atol=1e-7,
        )


@pytest.mark.parametrize("press", LAWS, ids=NAMES)
def test_an_orbit_repeats_in_an_integration_of_its_equation(press: Press) -> None:
    body = oscillator(press)
    (orbit,) = closed_form(body)
    w, begin = body.angular_frequency, float(orbit.phases[0]) / body.angular_frequency

    def rates(t: float, state: np.ndarray) -> list[float]:
        depth, v = state[0] - 0.5, state[1]
        if press.is_linear:
            force = press.stiffness * depth + press.damping * v
        else:
            force = press.stiffness * max(depth, 0.0) ** press.exponent * (1.0 + press.damping * v)
        return [v, 0.5 * np.cos(w * t) - 0.1 * v - state[0] - max(force, 0.0) * (depth > 0.0)]

    left = begin + orbit.durations[0]
    assert orbit.start is not None
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    pressed = solve_ivp(rates, (begin, left), orbit.start, **options).y[:, -1]
    np.testing.assert_allclose(pressed, orbit.states[0], atol=1e-10)
    end = solve_ivp(rates, (left, begin + body.period), pressed, **options).y[:, -1]
    np.testing.assert_allclose(end, orbit.start, atol=1e-10)
    times = np.linspace(begin, left, 4001)
    x, _ = orbit.at(times * w)
    driven = 0.5 * (np.sin(w * left) - np.sin(w * begin)) / w - np.trapezoid(x, times)
    momentum = pressed[1] - orbit.start[1] + 0.1 * (pressed[0] - orbit.start[0])
    assert orbit.impulses[0] == pytest.approx(driven - momentum, abs=1e-6)


@settings(max_examples=5, deadline=None)
@given(
    stiffness=st.floats(0.5, 1e4),
    drag=st.floats(0.0, 2.0),
    w=st.floats(0.5, 2.5),
    position=st.floats(-0.3, 1.0),
    law=st.sampled_from(["kelvin_voigt", "hunt_crossley"]),
)
def test_the_determinant_is_the_decay_of_modes_and_dashpots(
    stiffness: float, drag: float, w: float, position: float, law: str
) -> None:
    damping = drag * np.sqrt(stiffness) if law == "kelvin_voigt" else 0.3 * drag
    body = oscillator(Press(law, stiffness, damping, 1.0 if law == "kelvin_voigt" else 1.5), w, position)
    for orbit in closed_form(body):
        assert np.abs(evaluated(body, orbit.contacts, orbit.phases, 1, orbit.start).distances).max() < 1e-12
        assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-9, abs=1e-13)


def test_stiff_stops_have_the_orbits_of_rigid_ones() -> None:
    # 6.9: the restitution of a spring and a dashpot of damping ratio z is exp(-2 z acos z / sqrt(1 - z^2))
    z, one = 0.2, np.ones(1)
    restitution = np.exp(-2.0 * z * np.arccos(z) / np.sqrt(1.0 - z**2))
    rigid = ImpactingBody(
        one, 0.05 * one, 0.5 * one, 0.0 * one, 1.2, 0.0, (Contact(one, 1.0, 0.5, restitution),), one
    )
    (limit,) = closed_form(rigid)
    offs = []
    for stiffness in (1e6, 1e8):
        (orbit,) = closed_form(oscillator(Press("kelvin_voigt", stiffness, 2.0 * z * np.sqrt(stiffness))))
        offs.append(np.abs(orbit.multipliers - limit.multipliers).max())
        assert orbit.restitutions[0] == pytest.approx(restitution, abs=2.0 / np.sqrt(stiffness))
    assert offs[1] == pytest.approx(0.1 * offs[0], rel=0.1)


@pytest.mark.parametrize(
    "press",
    [
        KELVIN_VOIGT,
        pytest.param(LAWS[1], marks=pytest.mark.long),
        pytest.param(HERTZ, marks=pytest.mark.long),
        pytest.param(HUNT_CROSSLEY, marks=pytest.mark.long),
    ],
    ids=NAMES,
)
def test_a_branch_begins_at_the_graze_of_the_motion_without_impacts(press: Press) -> None:
    # 1.8: the amplitude of the steady motion is the distance of the stop
    w2 = 1.0 - 2.0 * 0.05**2
    graze = np.sqrt(w2 - np.sqrt(w2**2 - (1.0 - 0.5**2)))
    follower = Follower(lambda w: oscillator(press, w, 1.0), FollowSettings(0.7, 0.7116, 0.2))
    orbit = closed_form(oscillator(press, 0.7114, 1.0))[0]
    branch = follower.branch(orbit, 0.7114)
    found = [point.at.value for point in branch.points if point.kind == "graze"]
    assert found == pytest.approx([graze], abs=1e-10)
    assert not [point for point in branch.points if point.kind == "stability change"]


def test_a_contact_without_other_forces_lasts_as_long_as_the_closed_form() -> None:
    # 6.10: m=.05, k_h=2e8, V=.4: t_c=.557646 ms
    stop = Contact(ONE / np.sqrt(0.05), 1.0, 0.5, 0.0, press=Press("hertz", 2e8, 0.0, 1.5))
    body = ImpactingBody(ONE, 0.05 * ONE, 0.5 * ONE, 0.0 * ONE, 1.2, 0.0, (stop,), ONE)
    (law,) = yielding_motion(body).passages
    assert isinstance(law, PowerPassage)
    assert law.usual_duration_at(0.4) == pytest.approx(0.557646e-3, rel=2e-6)


def test_phases_that_no_contact_has_are_refused_by_name() -> None:
    body = oscillator(Press("kelvin_voigt", 1e-3), 1.2, -2.0)
    with pytest.raises(OrbitError, match=r"^orbit: expected "):
        find_orbit(body, [0.5])
    assert yielding_motion(body) is yielding_motion(body)
