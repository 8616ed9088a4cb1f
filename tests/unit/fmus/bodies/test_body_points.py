"""Bodies from the parameters of their FMUs: both views describe the same body, at each point of a sweep."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from vibroimpact.fmus.bodies import POINTS_OF_FMU, BodyPoints
from vibroimpact.fmus.core.modes import chain_modes
from vibroimpact.fmus.errors import UsageError

STOP = {"contact[1].position": 0.3, "contact[1].restitution": 0.8}
FORCE = {"forcing.angular_frequency": 2.0, "forcing.phase": 0.1}
OSCILLATOR = {"mass": 2.0, "stiffness": 3.0, "damping": 0.1, "forcing.amplitude": 0.5}
OSCILLATOR |= {"displacement_start": 0.1, "velocity_start": 0.2}
CHAIN = {"mass[1]": 1.0, "mass[2]": 2.0, "stiffness[1]": 3.0, "stiffness[2]": 1.0, "far_stiffness": 0.5}
CHAIN |= {"damping[1]": 0.06, "damping[2]": 0.02, "far_damping": 0.01, "forcing.amplitude[2]": 0.5}
CHAIN |= {"displacement_start[1]": 0.1}
BEAM = {"length": 0.4, "flexural_rigidity": 2.0, "mass_per_length": 0.3, "damping_ratio[1]": 0.01}
BEAM |= {
    "forcing_location": 1.0,
    "sensor_location": 1.0,
    "contact[1].location": 0.8,
    "forcing.amplitude": 0.5,
}
STRUCTURE = {
    "mode.angular_frequency[1]": 1.5,
    "mode.angular_frequency[2]": 4.0,
    "mode.damping_ratio[1]": 0.02,
}
STRUCTURE |= {
    "mode.damping_ratio[2]": 0.01,
    "mode.forcing[1]": 0.7,
    "mode.forcing[2]": -0.3,
    "mode.force[1]": 0.7,
}
STRUCTURE |= {"mode.force[2]": -0.3, "mode.observed_shape[1]": 0.5, "mode.observed_shape[2]": 0.9}
STRUCTURE |= {"mode.contact_shape[1,1]": 0.8, "mode.contact_shape[1,2]": -0.6, "forcing.amplitude": 0.5}
STRUCTURE |= {"mode.displacement_start[1]": 0.1}
BODIES: dict[str, tuple[dict[str, float], dict[str, int]]] = {
    "Oscillator": (OSCILLATOR, {}),
    "Chain": (CHAIN, {"masses": 2, "modes": 0, "observed_mass": 2, "contact[1].mass_number": 2}),
    "Beam": (BEAM, {"modes": 3, "boundary": 1, "forcing.kind": 1}),
    "Structure": (STRUCTURE, {"modes": 2, "coupled": False}),
}


def body(fmu: str, **changes: float) -> BodyPoints:
    floats, integers = BODIES[fmu]
    numbers = floats | STOP | FORCE | changes
    return POINTS_OF_FMU[fmu](numbers, integers | {"contact[1].law": 1, "contact[1].side": 1}, 1)


def at_points(one: BodyPoints, columns: Mapping[str, np.ndarray]) -> BodyPoints:
    count = len(next(iter(columns.values())))
    floats = {name: np.full(count, value) for name, value in one.floats.items()} | columns
    return type(one)(floats, one.integers, one.stops)


@pytest.mark.parametrize("fmu", BODIES)
def test_both_views_of_a_body_are_the_same_modes_under_the_same_force(fmu: str) -> None:
    one = body(fmu)
    orbit, lanes = (
        one.mass_normalised(),
        at_points(one, {"forcing.phase": np.zeros(3)}).in_state_coordinates(),
    )
    assert lanes.stiffness.shape == (len(orbit.frequencies), 3)
    np.testing.assert_allclose(lanes.stiffness[:, 0], orbit.frequencies**2, rtol=1e-14)
    np.testing.assert_allclose(lanes.decay[:, 1], orbit.damping_ratios * orbit.frequencies, rtol=1e-14)
    # the observed response to a steady force does not depend on the coordinates
    seen = (lanes.observed * lanes.force / lanes.stiffness)[:, 2].sum()
    assert seen == pytest.approx((orbit.observed * orbit.force / orbit.frequencies**2).sum(), rel=1e-13)
    answer = (lanes.shape[0] * lanes.impulse[0])[:, 0].sum()
    assert answer == pytest.approx(1.0 / orbit.contacts[0].mass, rel=1e-13)


def test_a_stop_meets_the_mass_that_it_limits_and_on_a_beam_that_of_its_modes() -> None:
    assert body("Oscillator").contact_masses() == [2.0]
    with_all_modes = body("Chain")
    assert with_all_modes.contact_masses() == [2.0]
    assert with_all_modes.mass_normalised().contacts[0].mass == pytest.approx(2.0, rel=1e-13)
    beam = body("Beam")
    assert beam.contact_masses()[0] == pytest.approx(beam.mass_normalised().contacts[0].mass, rel=1e-13)


@pytest.mark.parametrize("fmu", BODIES)
def test_points_of_different_bodies_have_the_bits_of_each_alone(fmu: str) -> None:
    others = {"Beam": "length", "Structure": "mode.angular_frequency[1]"}
    key = ({"Oscillator": "stiffness", "Chain": "stiffness[1]"} | others)[fmu]
    values = np.array([0.7, 0.9, 0.7])
    together = at_points(body(fmu), {key: values}).in_state_coordinates()
    for point, value in enumerate(values):
        alone = at_points(body(fmu), {key: np.array([value])}).in_state_coordinates()
        for name in ("stiffness", "decay", "force", "shape", "impulse", "observed", "start_q"):
            assert getattr(together, name)[..., point].tobytes() == getattr(alone, name)[..., 0].tobytes()


def test_the_modes_of_a_chain_in_lanes_have_its_coupled_damping_and_no_spring_without_a_tie() -> None:
    none = {"stiffness[1]": 0.0, "far_stiffness": 0.0, "damping[1]": 0.0, "far_damping": 0.0}
    tied = body("Chain")
    assert tied.mass_normalised().coupling is None, "its dampings are in proportion to its stiffnesses"
    coupled, loose = body("Chain", far_damping=0.5), body("Chain", **none)
    at_two = {"forcing.phase": np.zeros(2)}
    found = at_points(coupled, at_two).in_state_coordinates()
    assert found.coupling is not None
    assert found.coupling[..., 1] == pytest.approx(coupled.mass_normalised().coupling, abs=1e-15)
    assert 2.0 * found.decay[:, 0] == pytest.approx(found.coupling[..., 0].diagonal(), rel=1e-15)
    assert at_points(tied, at_two).in_state_coordinates().coupling is None
    assert (at_points(loose, at_two).in_state_coordinates().stiffness[0] == 0.0).all()
    dragged = body("Chain", **none | {"damping[1]": 0.1, "far_damping": 0.2, "damping[2]": 0.0})
    assert at_points(dragged, at_two).in_state_coordinates().decay[:, 0] == pytest.approx([0.05, 0.05])
    bodies = [each.mass_normalised() for each in (tied, coupled, loose, dragged, body("Beam"))]
    assert [each.loose for each in bodies] == [0, 0, 1, 1, 0]
    assert [each.is_dragged for each in bodies] == [False, False, False, True, False]
    alone = [body("Oscillator", stiffness=0.0, damping=c).mass_normalised() for c in (0.0, 0.1)]
    assert [(each.loose, each.is_dragged) for each in alone] == [(1, False), (1, True)]


def test_the_damping_between_the_modes_of_a_chain_is_that_of_its_dashpots() -> None:
    coupled = body("Chain", far_damping=0.5).mass_normalised()
    modes = chain_modes([1.0, 2.0], [3.0, 1.0, 0.5], [0.06, 0.02, 0.5])
    dashpots = np.array([[0.08, -0.02], [-0.02, 0.52]])
    np.testing.assert_allclose(coupled.coupling, modes.shapes.T @ dashpots @ modes.shapes, atol=1e-15)
    np.testing.assert_allclose(
        2.0 * coupled.damping_ratios * coupled.frequencies, np.diag(coupled.coupling), rtol=1e-15
    )


def test_a_state_is_told_in_mass_normalised_modes_with_its_kinetic_energy() -> None:
    velocities = np.array([[0.3, -0.2]])
    modal = body("Chain").normalised(velocities)
    assert (modal**2).sum() == pytest.approx(1.0 * 0.3**2 + 2.0 * 0.2**2, rel=1e-13)
    assert body("Oscillator").normalised(np.array([[0.3]]))[0, 0] ** 2 == pytest.approx(2.0 * 0.3**2)


@pytest.mark.parametrize("fmu", BODIES)
def test_the_natural_frequencies_are_those_of_the_modes(fmu: str) -> None:
    one = body(fmu)
    np.testing.assert_allclose(one.natural_frequencies, one.mass_normalised().frequencies, rtol=1e-14)


def test_damping_that_couples_the_modes_of_a_chain_leaves_its_natural_frequencies() -> None:
    coupled = body("Chain", **{"damping[2]": 0.5})
    assert coupled.mass_normalised().coupling is not None
    np.testing.assert_array_equal(coupled.natural_frequencies, body("Chain").natural_frequencies)


def test_residual_vectors_have_no_natural_frequency() -> None:
    floats, integers = BODIES["Beam"]
    one = POINTS_OF_FMU["Beam"](floats, integers | {"residual": 1}, 1)
    np.testing.assert_array_equal(one.natural_frequencies, body("Beam").natural_frequencies[:2])


def test_several_bodies_have_natural_frequencies_coupled_or_loose_too() -> None:
    damping = {f"mode.damping[{i},{j}]": 0.1 for i in (1, 2) for j in (1, 2)}
    floats, integers = BODIES["Structure"]
    loose = floats | damping | {"mode.angular_frequency[1]": 0.0}
    one = POINTS_OF_FMU["Structure"](loose, integers | {"coupled": True}, 1)
    assert one.natural_frequencies.tolist() == [0.0, 4.0]


SINES = {
    **{"mode.sine[1,1]": 0.2, "mode.sine[1,2]": 0.4, "mode.sine[2,1]": -1.0, "mode.sine[3,2]": 2.0},
    **{"sine[1].amplitude": 0.5, "sine[1].angular_frequency": 6.0, "sine[1].phase": 0.4},
    **{"sine[2].amplitude": 0.3, "sine[2].angular_frequency": 0.0, "sine[2].phase": 0.0},
    **{"sine[3].amplitude": 0.1, "sine[3].angular_frequency": 6.0, "sine[3].phase": -0.2},
    **{"stop[1].amplitude": 0.05, "stop[1].angular_frequency": 4.0, "stop[1].phase": 0.7},
}


def test_a_structure_has_its_further_sines_constant_forces_and_moving_stops() -> None:
    found, plain = body("Structure", **SINES).mass_normalised(), body("Structure").mass_normalised()
    assert list(found.harmonics) == [1, 2, 3]
    assert not found.has_one_sine
    assert plain.has_one_sine
    time, phase = 0.77, 2.0 * 0.77 + 0.1  # of the clock
    pushed = sum((force * np.exp(1j * order * phase)).real for order, force in found.harmonics.items())
    expected = 0.5 * np.array([0.7, -0.3]) * np.cos(phase)
    expected += 0.5 * np.array([0.2, 0.4]) * np.cos(6.0 * time + 0.4)
    expected += 0.1 * np.array([0.0, 2.0]) * np.cos(6.0 * time - 0.2)
    np.testing.assert_allclose(pushed, expected, atol=1e-15)
    np.testing.assert_allclose(found.held, plain.held + np.array([-0.3, 0.0]), atol=1e-16)
    assert found.contacts[0].stop_at(phase) == pytest.approx(0.3 + 0.05 * np.cos(4.0 * time + 0.7), abs=1e-15)


@pytest.mark.parametrize("name", ["sine[1]", "stop[1]"])
def test_sines_without_the_period_of_the_clock_have_no_orbits(name: str) -> None:
    apart = body("Structure", **SINES | {f"{name}.angular_frequency": 3.0})
    with pytest.raises(UsageError, match=rf"{name[:-3]}\[1\]\.angular_frequency: expected a whole multiple"):
        apart.mass_normalised()
