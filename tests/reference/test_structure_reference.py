"""The reference for bodies with many modes against printed numbers and closed forms (equations.md)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from support.exact_modes import beam_root
from support.reference_bodies import (
    Body,
    Chain,
    beam,
    beam_shape,
    chain,
    oscillator,
    period_one_orbits,
    uniform_chain,
)
from support.reference_stops import Forcing, Stop, complementary
from support.structure_reference import Reference

THREE_MASSES = chain([1.0, 2.0, 0.5], [3.0, 1.0, 2.0], [0.12, 0.04, 0.08])


def thesis_chain() -> Chain:
    """Return the two-mass chain of thesis 6.2: stop at .1 on mass 2, force .5 on mass 1, r = .7."""
    return uniform_chain(2)


def thesis_motion(angular_frequency: float, q: np.ndarray, p: np.ndarray, phase: float = 0.0) -> Reference:
    body = thesis_chain()
    forcing = Forcing(body.shapes[0] * 0.5, angular_frequency, phase)
    return Reference(body, [Stop(body.shapes[1], 0.1, 0.7)], forcing, q, p)


def test_the_two_mass_chain_has_the_natural_frequencies_of_the_golden_ratio() -> None:
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    assert thesis_chain().natural == pytest.approx([1.0 / golden, golden], rel=1e-14)


def test_a_non_uniform_chain_has_its_printed_natural_frequencies() -> None:
    # equations.md 5.2
    assert THREE_MASSES.natural == pytest.approx([0.53645647, 2.0, 2.28302747], abs=5e-9)
    assert uniform_chain(5).natural[0] ** 2 == pytest.approx(0.0810140527710, abs=5e-13)


def test_the_closed_form_orbit_of_one_mass_is_the_printed_one() -> None:
    # equations.md 4.3
    orbit, _ = period_one_orbits(oscillator(1.0, 0.08, 1.0), np.ones(1), np.array([0.45]), 1.1, 0.8, 0.75)
    assert orbit.velocity == pytest.approx(0.952486147774719, rel=1e-14)
    assert orbit.phase == pytest.approx(0.210560661892213, rel=1e-13)
    assert orbit.multipliers.real == pytest.approx([-0.35720824] * 2, abs=5e-9)
    assert np.abs(orbit.multipliers.imag) == pytest.approx([0.47810128] * 2, abs=5e-9)
    assert orbit.physical


def test_the_closed_form_orbit_of_the_thesis_chain_has_the_corrected_velocity_and_loss() -> None:
    # equations.md 9: the thesis prints .7882 and .1578 J
    body = thesis_chain()
    orbit, _ = period_one_orbits(body, body.shapes[1], body.shapes[0] * 0.5, 0.9, 0.1, 0.7)
    assert orbit.velocity == pytest.approx(0.787660852554797, rel=2e-14)
    assert (1.0 - 0.7**2) * orbit.velocity**2 / 2.0 == pytest.approx(0.158204452755, abs=5e-13)
    assert orbit.physical
    assert np.abs(orbit.multipliers).max() < 1.0


def test_a_penetrating_orbit_is_called_unphysical_and_has_the_printed_energy_exchange() -> None:
    # equations.md 5.4
    body, phi = THREE_MASSES, THREE_MASSES.shapes[2]
    orbit, _ = period_one_orbits(body, phi, body.shapes.T @ [0.6, 0.0, 0.2], 0.75, 0.1, 0.6)
    impulse = 1.6 * orbit.velocity * phi / (phi @ phi)
    exchange = (orbit.p**2 - (orbit.p + impulse) ** 2) / 2.0
    assert exchange == pytest.approx([-0.089094891794, -0.008200753577, 0.085666306514], abs=5e-13)
    assert not orbit.physical


def test_one_flight_of_an_oscillator_ends_at_the_printed_impact() -> None:
    # equations.md 2.1
    body = oscillator(1.0, 0.06, 1.0)
    motion = Reference(
        body,
        [Stop(np.ones(1), 0.4, 0.6)],
        Forcing(np.array([0.9]), 1.6),
        np.array([0.4]),
        np.array([-0.3]),
        0.7,
    ).advance(10.0, impacts=1)
    assert motion.impacts[0].time == pytest.approx(4.7793611823626821, abs=2e-12)
    assert motion.impacts[0].velocity == pytest.approx(1.9325431806445353, abs=2e-12)


def test_a_two_impact_orbit_comes_back_to_its_first_impact() -> None:
    # equations.md 4.7: P(2,2), 8 digits
    times, velocities = (0.59544845, 6.86299676), (0.41652521, 0.8717915)
    motion = Reference(
        oscillator(1.0, 0.08, 1.0),
        [Stop(np.ones(1), 0.8, 0.75)],
        Forcing(np.array([0.44]), 0.88),
        np.array([0.8]),
        np.array([-0.75 * velocities[0]]),
        times[0],
    ).advance(40.0, impacts=2)
    assert motion.impacts[0].time == pytest.approx(times[1], abs=5e-8)
    assert motion.impacts[0].velocity == pytest.approx(velocities[1], abs=5e-8)
    assert motion.impacts[1].time == pytest.approx(times[0] + 4.0 * math.pi / 0.88, abs=5e-8)
    assert motion.impacts[1].velocity == pytest.approx(velocities[0], abs=5e-8)


def test_the_chain_keeps_its_closed_form_orbit_over_fifty_impacts() -> None:
    body = thesis_chain()
    orbit, _ = period_one_orbits(body, body.shapes[1], body.shapes[0] * 0.5, 0.9, 0.1, 0.7)
    motion = thesis_motion(0.9, orbit.q, orbit.p, orbit.phase).advance(400.0, impacts=50)
    period = 2.0 * math.pi / 0.9
    assert [i.velocity for i in motion.impacts] == pytest.approx([orbit.velocity] * 50, abs=1e-10)
    assert [i.time for i in motion.impacts] == pytest.approx(period * np.arange(1, 51), abs=1e-10)


def test_the_chatter_of_an_oscillator_ends_and_is_released_at_the_printed_times() -> None:
    # equations.md 9, chatter anchor
    motion = Reference(
        oscillator(1.0, 0.1, 1.0),
        [Stop(np.ones(1), 0.0, 0.7)],
        Forcing(np.ones(1), 0.2),
        np.array([-0.1]),
        np.zeros(1),
    ).advance(25.0)
    stick = motion.sticks[0]
    assert stick.start == pytest.approx(2.50982609171410943, abs=1e-10)
    assert stick.end == pytest.approx(math.pi / 0.4, abs=1e-10)
    after = next(i for i in motion.impacts if i.time > stick.end)
    assert after.time == pytest.approx(23.64959897294654, abs=1e-8)
    assert after.velocity == pytest.approx(0.113626292719042, abs=1e-9)


def test_the_chatter_of_a_chain_accumulates_at_the_printed_time() -> None:
    # equations.md 3.1, N-DOF form
    body = uniform_chain(2, 0.2)
    motion = Reference(
        body,
        [Stop(body.shapes[1], 0.05, 0.55)],
        Forcing(body.shapes.T @ [0.7, 0.1], 0.23),
        np.zeros(2),
        np.zeros(2),
    ).advance(2.5)
    # the cut of the chatter errs by 5e-12, the integration by up to 1e-11, depending on the processor's order of sums
    assert motion.sticks[0].start == pytest.approx(1.649577027167, abs=2e-11)


def test_a_held_mass_leaves_the_printed_motion_of_the_others_and_the_printed_force() -> None:
    # equations.md 3.4; the printed case holds the mass under any force, so the test sets its status
    body = THREE_MASSES
    inverse = np.linalg.inv(body.shapes)
    motion = Reference(
        body,
        [Stop(body.shapes[2], 0.1, 0.6)],
        Forcing(body.shapes.T @ [0.6, 0.0, 0.2], 0.75),
        inverse @ [0.3, -0.05, 0.1],
        inverse @ [0.2, 0.1, 0.0],
        0.4,
    )
    end = motion.integrate(0.4, motion.y, 2.1, ("held",))
    _, force = motion.held_forces(2.1, end, ("held",))
    assert (body.shapes @ end[:3])[:2] == pytest.approx([-0.06125467, 0.2933916], abs=5e-9)
    assert force[0] == pytest.approx(0.391935115043184, abs=5e-13)


def restitution_of(law: str, mass: float, velocity: float, **parameters: float) -> tuple[float, float]:
    """Return contact time and velocity ratio of a free mass against a compliant stop."""
    body = Body(np.zeros(1), np.zeros((1, 1)))
    shape = np.array([1.0 / math.sqrt(mass)])
    stop = Stop(shape, 0.0, law=law, **parameters)
    start = np.array([velocity / shape[0]])
    # it starts on the stop; penetrations are small, and the absolute tolerance must be small as well
    motion = Reference(body, [stop], Forcing(np.zeros(1)), np.zeros(1), start, scale=1e-4).advance(1.0)
    (press,) = motion.presses
    return press.end - press.start, press.velocity_out / velocity


@pytest.mark.parametrize(("ratio", "restitution"), [(0.1, 0.74407940), (0.5, 0.29843606), (2.0, 0.04776873)])
def test_a_kelvin_voigt_stop_has_the_printed_restitution(ratio: float, restitution: float) -> None:
    # equations.md 6.9, separation where the force vanishes
    _, e = restitution_of("kelvin_voigt", 1.0, 1.0, stiffness=400.0, damping=2.0 * ratio * 20.0)
    assert e == pytest.approx(restitution, abs=5e-9)


def test_a_hertzian_stop_has_the_printed_contact_time_and_gives_all_energy_back() -> None:
    # equations.md 6.10
    time, e = restitution_of("hertz", 0.05, 0.4, stiffness=2e8)
    assert time == pytest.approx(0.557646e-3, abs=5e-10)
    assert e == pytest.approx(1.0, abs=1e-11)


def test_a_hunt_crossley_stop_has_the_restitution_of_its_implicit_equation() -> None:
    # equations.md 6.10: p (1 + e) = ln((1 + p) / (1 - p e)), for every stiffness and exponent
    p = 0.5 * 0.4
    exact = brentq(lambda e: p * (1.0 + e) - math.log((1.0 + p) / (1.0 - p * e)), 0.5, 1.0, xtol=1e-15)
    assert exact == pytest.approx(0.882189986, abs=5e-10)
    for exponent in (1.5, 2.0):
        _, e = restitution_of("hunt_crossley", 0.05, 0.4, stiffness=2e8, damping=0.5, exponent=exponent)
        assert e == pytest.approx(exact, abs=1e-10)


def test_both_ends_hit_at_once_share_the_impulse_and_keep_the_energy() -> None:
    # A symmetric three-mass chain, masses 1 and 3 reach stops at the same instant
    body = chain([1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [0.0] * 3)
    stops = [Stop(body.shapes[i], 0.5, 1.0) for i in (0, 2)]
    start = np.linalg.inv(body.shapes) @ [1.0, 1.0, 1.0]
    motion = Reference(body, stops, Forcing(np.zeros(3)), np.zeros(3), start).advance(1.0)
    first, second = motion.impacts[:2]
    assert first.time == second.time == pytest.approx(0.5, abs=1e-12)
    assert first.impulse == pytest.approx(2.0, abs=1e-10)
    assert second.impulse == pytest.approx(2.0, abs=1e-10)
    q, p = motion.state(1.0)
    assert p @ p + (body.natural * q) @ (body.natural * q) == pytest.approx(3.0, abs=1e-10)


def test_impulses_are_complementary_where_one_contact_pushes_the_other_off() -> None:
    impulses = complementary(np.array([[2.0, -1.5], [-1.5, 2.0]]), np.array([-1.0, -0.2]))
    slack = np.array([[2.0, -1.5], [-1.5, 2.0]]) @ impulses + [-1.0, -0.2]
    assert (impulses > 0.0).all()
    assert np.abs(slack).max() < 1e-14
    lone = complementary(np.array([[2.0, 1.5], [1.5, 2.0]]), np.array([-1.0, -0.2]))
    assert lone == pytest.approx([0.5, 0.0])


@pytest.mark.parametrize(
    ("boundary", "printed"),
    [
        ("clamped_free", [1.875104, 4.694091, 7.854757, 10.995541, 14.137168]),
        ("clamped_clamped", [4.730040745, 7.853204624]),
        ("clamped_pinned", [3.926602312, 7.068582746]),
        ("pinned_pinned", [math.pi, 2.0 * math.pi]),
    ],
)
def test_beam_eigenvalues_are_the_printed_ones(boundary: str, printed: list[float]) -> None:
    # thesis table 7.1, equations.md 6.2
    found = [float(beam_root(boundary, j)) for j in range(1, len(printed) + 1)]
    assert found == pytest.approx(printed, abs=6e-7)


def test_beam_shapes_have_norm_one_the_printed_nodes_and_the_tip_at_plus_and_minus_two() -> None:
    # thesis table 7.2
    for j, nodes in {2: [0.78344455], 3: [0.50354787, 0.86767759], 5: [0.27875171, 0.9265470]}.items():
        assert quad(lambda s, j=j: beam_shape("clamped_free", j, s) ** 2, 0.0, 1.0)[0] == pytest.approx(1.0)
        assert beam_shape("clamped_free", j, 1.0) == pytest.approx(2.0 * (-1.0) ** (j + 1), rel=1e-14)
        for node in nodes:
            found = brentq(lambda s, j=j: beam_shape("clamped_free", j, s), node - 0.01, node + 0.01)
            assert found == pytest.approx(node, abs=6e-9)
    for boundary in ("clamped_clamped", "clamped_pinned", "pinned_pinned"):
        assert quad(lambda s, b=boundary: beam_shape(b, 3, s) ** 2, 0.0, 1.0)[0] == pytest.approx(1.0)


def test_a_beam_of_the_bench_has_its_printed_frequency_and_tip_compliance() -> None:
    # equations.md 6.6: 20 x 2 mm, L = .25, E = 70e9, rho = 2700
    rigidity, line = 70e9 * 0.02 * 0.002**3 / 12.0, 2700.0 * 0.02 * 0.002
    body = beam(4, flexural_rigidity=rigidity, mass_per_length=line, length=0.25)
    assert body.natural[0] / (2.0 * math.pi) == pytest.approx(26.3207, abs=5e-5)
    compliance = np.sum(body.shape(1.0) ** 2 / body.natural**2) * 3.0 * rigidity / 0.25**3
    assert compliance == pytest.approx(0.99938, abs=5e-6)
