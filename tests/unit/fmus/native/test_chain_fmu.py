"""The Chain FMU: modes, closed-form motion, stops, energies, refusals. References: equations.md 5."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.linalg import expm
from support.component_fmu import EXTERNAL, KELVIN_VOIGT, LOWER, VERSIONS, ComponentFmu, each, stop
from support.reference_bodies import chain_matrix
from support.tolerance import ORBIT, PARTITION, ROUNDING, SEQUENCE

#: Reference: thesis chapter 6, two unit masses, force on the first, stop on the second.
TWO = {"masses": 2, "damping[1]": 0.1, "damping[2]": 0.1, "forcing.amplitude[1]": 0.5}
SCENE = {**TWO, "forcing.angular_frequency": 0.9, **stop(0.1)}


def chain(parameters: Mapping[str, float] = {}, **options: Any) -> ComponentFmu:
    return ComponentFmu("Chain", parameters, **options)


def refusal(parameters: Mapping[str, float], version: str = "3.0") -> str:
    """Return the single message of a refused initialization."""
    with chain(parameters, version=version, initialize=False) as c:
        with pytest.raises(FMICallException, match="ExitInitializationMode"):
            c.initialize()
        assert len(c.messages) == 1
        return c.messages[0]


# ---- modes ----


@pytest.mark.parametrize("masses", [1, 2, 5, 64])
def test_a_uniform_chain_has_the_closed_form_frequencies(masses: int) -> None:
    j = np.arange(1, masses + 1)
    expected = 2.0 * np.sin((2 * j - 1) * np.pi / (2 * (2 * masses + 1))) * math.sqrt(3.0 / 2.0)
    parameters = {"masses": masses, **each("mass", [2.0] * masses), **each("stiffness", [3.0] * masses)}
    with chain(parameters) as c:
        natural = c.get_each("natural_angular_frequency[{}]", masses)
    assert natural == pytest.approx(expected, rel=ROUNDING)


def test_a_chain_of_different_masses_has_the_frequencies_of_the_equation_sheet() -> None:
    with chain({"masses": 3, **each("mass", [1, 2, 0.5]), **each("stiffness", [3, 1, 2])}) as c:
        natural = c.get_each("natural_angular_frequency[{}]", 4)
        assert natural == pytest.approx([0.53645647, 2.0, 2.28302747, 0.0], abs=5e-9)


def test_a_far_spring_makes_the_two_ends_alike() -> None:
    with chain({"masses": 3, "far_stiffness": 1.0}) as c:
        # fixed at both ends: 2 sin(j pi / (2 (N + 1)))
        expected = [2.0 * math.sin(j * math.pi / 8.0) for j in (1, 2, 3)]
        assert c.get_each("natural_angular_frequency[{}]", 3) == pytest.approx(expected, rel=ROUNDING)


# ---- motion without stops ----


@pytest.mark.parametrize("version", VERSIONS)
def test_a_mode_that_is_released_decays_in_its_closed_form(version: str) -> None:
    masses, c1 = 4, 0.05
    i, angle = np.arange(1, masses + 1), np.pi / (2 * masses + 1)
    shape, natural = np.sin(i * angle), 2.0 * math.sin(angle / 2.0)
    parameters = {"masses": masses, **each("damping", [c1] * masses), **each("displacement_start", shape)}
    ratio, time = c1 * natural / 2.0, 17.3
    damped = natural * math.sqrt(1.0 - ratio**2)
    decay = math.exp(-ratio * natural * time)
    expected = decay * (math.cos(damped * time) + ratio * natural / damped * math.sin(damped * time))
    with chain(parameters, version=version) as c:
        c.step(time)
        assert c.get_each("displacement[{}]", masses) == pytest.approx(shape * expected, abs=SEQUENCE)
        assert c.get("displacement") == c.get("displacement[4]")


@pytest.mark.parametrize("load", ["forcing.amplitude", "force"])
def test_a_constant_force_ends_in_the_static_deflection(load: str) -> None:
    stiffness, force = [3.0, 1.0, 2.0], [0.2, 0.0, -0.5]
    parameters = {"masses": 3, **each("stiffness", stiffness), "far_stiffness": 0.5}
    damping = {**each("damping", [3.0, 1.0, 2.0]), "far_damping": 0.5}
    with chain({**parameters, **damping, **each(load, force)}) as c:
        c.step(300.0)
        expected = np.linalg.solve(chain_matrix(stiffness, 0.5), force)
        assert c.get_each("displacement[{}]", 3) == pytest.approx(expected, abs=ORBIT)
        assert c.get_each("acceleration[{}]", 3) == pytest.approx([0.0] * 3, abs=ORBIT)


def test_an_accelerated_base_is_felt_by_all_masses() -> None:
    masses = [1.0, 2.0, 0.5]
    parameters = {"masses": 3, **each("mass", masses), **each("damping", [2.0] * 3), "base_acceleration": 0.3}
    with chain(parameters) as c:
        assert c.get("acceleration[3]") == pytest.approx(0.0, abs=ROUNDING)
        c.step(300.0)
        expected = np.linalg.solve(chain_matrix([1.0] * 3), -0.3 * np.array(masses))
        assert c.get_each("displacement[{}]", 3) == pytest.approx(expected, abs=1e-11)
        assert c.get_each("acceleration[{}]", 3) == pytest.approx([0.3] * 3, abs=1e-11)


def test_free_masses_stay_where_they_are_while_the_base_moves_away() -> None:
    rate = 0.1
    with chain({**each("stiffness", [0.0, 1.0]), "base_acceleration_rate": rate}) as c:
        c.step(2.0)
        assert c.get_each("displacement[{}]", 2) == pytest.approx([-rate * 2.0**3 / 6.0] * 2, abs=SEQUENCE)
        # absolute acceleration: zero, also at the end of the slope
        assert c.get_each("acceleration[{}]", 2) == pytest.approx([0.0] * 2, abs=SEQUENCE)


@pytest.mark.parametrize("dampings", [[0.3, 0.0, 0.0], [0.0, 2.0, 9.0], [1.0, 0.5, 0.1]])
def test_damping_that_couples_the_modes_moves_as_the_matrix_exponential(dampings: list[float]) -> None:
    start = np.array([0.3, -0.1, 0.2, 0.5, 0.0, -0.4])
    mass, stiffness = np.array([1.0, 2.0, 0.5]), [3.0, 1.0, 2.0]
    inverse = np.diag(1.0 / mass)
    below = np.hstack([-inverse @ chain_matrix(stiffness), -inverse @ chain_matrix(dampings)])
    expected = expm(np.vstack([np.eye(3, 6, 3), below]) * 7.0) @ start
    parameters = {
        **{"masses": 3, **each("mass", mass), **each("stiffness", stiffness), **each("damping", dampings)},
        **{**each("displacement_start", start[:3]), **each("velocity_start", start[3:])},
    }
    with chain(parameters) as c:
        c.step(7.0)
        assert c.get_each("displacement[{}]", 3) == pytest.approx(expected[:3], abs=PARTITION)
        assert c.get_each("velocity[{}]", 3) == pytest.approx(expected[3:], abs=PARTITION)


def test_a_mass_on_a_dashpot_alone_comes_to_rest() -> None:
    one = {"masses": 1, "mass[1]": 2.0, "stiffness[1]": 0.0, "damping[1]": 0.5, "velocity_start[1]": 3.0}
    with chain(one) as c:
        c.step(1.7)
        assert c.get("velocity") == pytest.approx(3.0 * math.exp(-0.25 * 1.7), rel=SEQUENCE)
        assert c.get("displacement") == pytest.approx(12.0 * (1.0 - math.exp(-0.25 * 1.7)), rel=SEQUENCE)


# ---- stops ----


@pytest.mark.parametrize("version", VERSIONS)
def test_the_thesis_chain_settles_on_its_orbit_of_one_impact(version: str) -> None:
    with chain(SCENE, version=version) as c:
        for k in range(1, 301):
            c.step(k * 10.0 - c.time)
        # reference value of the issue
        assert c.get("contact[1].last_velocity") == pytest.approx(0.787660852554797, abs=ORBIT)
        loss = (1.0 - 0.7**2) / 2.0 * c.get("contact[1].last_velocity") ** 2
        assert loss == pytest.approx(0.158204452755, abs=1e-12)


def test_an_impact_leaves_the_velocities_of_the_other_masses() -> None:
    before = [0.3, 0.8, -0.2]
    start = {"masses": 3, **each("mass", [1.0, 2.0, 0.5]), **each("velocity_start", before)}
    with chain({**start, **stop(0.0, 0.6), "contact[1].mass_number": 2}) as c:
        assert c.get("contact[1].mass") == pytest.approx(2.0, rel=ROUNDING)
        c.step(1e-9)
        after = c.get_each("velocity[{}]", 3)
        assert after == pytest.approx([0.3, -0.6 * 0.8, -0.2], abs=1e-8)
        assert c.get("contact[1].impulse") == pytest.approx(1.6 * 0.8 * 2.0, rel=SEQUENCE)


def test_the_observed_mass_and_a_stop_are_on_the_last_mass_unless_told_otherwise() -> None:
    start = {"masses": 3, **each("displacement_start", [0.1, 0.2, 0.3])}
    for number, expected in ((0, 0.3), (3, 0.3), (1, 0.1)):
        with chain({**start, "observed_mass": number}) as c:
            assert c.get("displacement") == pytest.approx(expected, abs=ROUNDING)
        with chain({**start, **stop(1.0), "contact[1].mass_number": number}) as c:
            assert c.get("contact[1].displacement") == pytest.approx(expected, abs=ROUNDING)


def test_two_contacts_at_one_instant_wait_for_both_answers() -> None:
    two = {**each("velocity_start", [0.5, 0.5]), "stiffness[1]": 0.0, "contact[2].mass_number": 1}
    with chain({**two, **stop(0.1, law=EXTERNAL), **stop(0.1, law=EXTERNAL, k=2)}, event_mode=True) as c:
        c.advance_to_event()
        c.set("contact[1].applied_restitution", 0.5)
        with pytest.raises(FMICallException):
            c.fmu.updateDiscreteStates()
        assert "contact[2].applied_restitution: expected an answer" in c.messages[-1]
        c.answer(0.8, k=2)
        assert c.get_each("velocity[{}]", 2) == pytest.approx([-0.4, -0.25], rel=SEQUENCE)


# ---- energies ----


def test_energies_balance_and_are_only_followed_when_asked_for() -> None:
    names = ("kinetic", "potential", "forcing_work", "damping_loss", "contact_loss")
    with chain({**SCENE, "velocity_start[1]": 0.4, "record.energies": True}) as c:
        start = c.get("energy.kinetic")
        c.advance(100.0)
        kinetic, potential, work, damping, contact = (c.get(f"energy.{name}") for name in names)
        assert kinetic + potential == pytest.approx(start + work - damping - contact, abs=1e-11)
        assert min(work, damping, contact) > 0.1
        assert c.get_each("modal_energy[{}]", 2).sum() == pytest.approx(kinetic + potential, rel=SEQUENCE)
    with chain(SCENE) as c:
        c.advance(100.0)
        followed = [*names[2:], *("modal_energy[1]", "modal_energy[2]")]
        assert [c.get(n if n.startswith("modal") else f"energy.{n}") for n in followed] == [0.0] * 5
        assert c.get("energy.kinetic") > 0.0


# ---- fewer modes ----


def test_a_chain_with_fewer_modes_moves_in_those_alone() -> None:
    # two equal masses between equal springs with a free end: the slow mode alone, from a start with both modes
    golden = (math.sqrt(5.0) - 1.0) / 2.0  # its frequency, and x_1 / x_2 of its shape
    start = np.array([0.3, 0.1])
    shape = np.array([golden, 1.0]) / math.hypot(golden, 1.0)
    with chain({"modes": 1, **each("displacement_start", list(start))}) as c:
        assert c.get_each("displacement[{}]", 2) == pytest.approx(shape * (shape @ start), rel=ROUNDING)
        c.advance(7.0)
        expected = shape * (shape @ start) * math.cos(7.0 * golden)
        assert c.get_each("displacement[{}]", 2) == pytest.approx(expected, rel=1e-13)


def test_more_modes_than_masses_are_refused() -> None:
    assert "modes: expected 1 to 2, or 0 for all, got 3" in refusal({"modes": 3})


# ---- refusals ----


def test_more_problems_than_a_message_holds_are_cut_and_marked() -> None:
    text = refusal({"masses": 64, **each("mass", [-1.0] * 64)})
    assert "mass[1]: expected" in text
    assert text.endswith("...")


def test_a_law_needs_only_its_own_numbers() -> None:
    unused = {"contact[1].stiffness": -1.0, "contact[1].exponent": 0.0, "contact[2].position": math.nan}
    with chain({**SCENE, **unused}) as c:
        assert c.messages == []
    yielding = {**SCENE, **stop(0.1, law=4), **unused}
    text = refusal(yielding)
    assert "contact[1].stiffness: expected" in text
    assert "contact[1].exponent: expected a finite number >= 1" in text


def test_a_start_beyond_a_rigid_stop_is_refused_by_its_name() -> None:
    text = refusal({**SCENE, "displacement_start[2]": 0.2})
    assert "displacement_start: expected a start on the free side of contact[1] (<= 0.1" in text


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (stop(0.1, side=LOWER, k=2), "contact[2].position: expected room between it and contact[1]"),
        (stop(0.2, side=LOWER, k=2), "contact[2].position: expected room between it and contact[1]"),
        (stop(0.2, k=2), "contact[2].position: expected a position that the rigid contact[1]"),
        (stop(0.05, k=2), "contact[1].position: expected a position that the rigid contact[2]"),
        (
            {**stop(0.1, law=KELVIN_VOIGT, k=2), "contact[2].stiffness": 1.0},
            "contact[2].position: expected a position that the rigid contact[1]",
        ),
    ],
)
def test_stops_that_cannot_both_be_met_are_refused(second: dict[str, float], message: str) -> None:
    assert message in refusal({**SCENE, **second})


def test_stops_that_can_be_met_one_after_the_other_are_allowed() -> None:
    soft = {**stop(0.05, law=KELVIN_VOIGT, k=2), "contact[2].stiffness": 10.0}
    softer = {**stop(0.02, law=KELVIN_VOIGT, k=3), "contact[3].stiffness": 1.0}
    elsewhere = {**stop(0.0, k=4), "contact[4].mass_number": 1}
    with chain({**SCENE, **soft, **softer, **elsewhere}) as c:
        c.advance(100.0)
        assert min(c.get(f"contact[{k}].count") for k in (1, 2, 3, 4)) > 0


def test_initialization_can_be_repeated_with_better_values() -> None:
    with chain({**SCENE, "mass[1]": -1.0}, initialize=False) as c:
        with pytest.raises(FMICallException):
            c.initialize()
        c.set("mass[1]", 1.0)
        c.set("displacement_start[2]", 0.1)  # on the stop
        assert c.get("contact[1].displacement") == 0.1
        c.set("displacement_start[2]", 0.2)
        with pytest.raises(FMICallException):
            c.fmu.exitInitializationMode()
        c.set("displacement_start[2]", 0.0)
        c.fmu.exitInitializationMode()
        c.step(1.0)
