"""The Beam FMU: modes, statics, forcing, impacts, warnings, refusals. References: equations.md 6."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray
from support.component_fmu import HERTZ, HUNT_CROSSLEY, KELVIN_VOIGT, VERSIONS, ComponentFmu, each, stop
from support.tolerance import ORBIT, PRINTED_12, ROUNDING, SEQUENCE

#: The aluminium strip of the FMU's start values. equations.md 6.6
RIGIDITY = 70e9 * 0.02 * 0.002**3 / 12.0
LENGTH, BEAM_MASS = 0.25, 2700.0 * 0.02 * 0.002 * 0.25
TIP_STIFFNESS = 3.0 * RIGIDITY / LENGTH**3
FORCE, UNIFORM, MODE, BASE_ACCELERATION = 1, 2, 3, 4
COLLOCATION = 2
#: Clamped-free eigenvalues. equations.md 6.2
EIGENVALUES = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467])


def beam(parameters: Mapping[str, float] = {}, **options: Any) -> ComponentFmu:
    return ComponentFmu("Beam", parameters, **options)


def damped(modes: int, ratio: float = 0.7) -> dict[str, float]:
    return {"modes": modes, **each("damping_ratio", [ratio] * modes)}


def refusal(parameters: Mapping[str, float], version: str = "3.0") -> str:
    """Return the single message of a refused initialization."""
    with beam(parameters, version=version, initialize=False) as b:
        with pytest.raises(FMICallException, match="ExitInitializationMode"):
            b.initialize()
        assert len(b.messages) == 1
        return b.messages[0]


def clamped_free(s: float) -> NDArray[np.float64]:
    """Return the first four shapes at s in their textbook form, accurate to about 1e-11 there."""
    xi = EIGENVALUES
    sigma = (np.sinh(xi) - np.sin(xi)) / (np.cosh(xi) + np.cos(xi))
    shape: NDArray[np.float64] = np.cosh(xi * s) - np.cos(xi * s) - sigma * (np.sinh(xi * s) - np.sin(xi * s))
    return shape


# ---- modes ----

FIRST = {
    1: EIGENVALUES,
    2: np.array([4.730040744862704, 7.853204624095838, 10.995607838001671]),
    3: np.array([3.926602312047919, 7.068582745628732, 10.210176122813031]),
    4: np.array([math.pi, 2.0 * math.pi, 3.0 * math.pi]),
}


@pytest.mark.parametrize(("boundary", "eigenvalues"), FIRST.items())
def test_each_way_to_hold_the_ends_has_its_frequencies(
    boundary: int, eigenvalues: NDArray[np.float64]
) -> None:
    with beam({"boundary": boundary}) as b:
        natural = b.get_each("natural_angular_frequency[{}]", len(eigenvalues))
    expected = eigenvalues**2 * math.sqrt(RIGIDITY / (BEAM_MASS * LENGTH**3))
    assert natural == pytest.approx(expected, rel=PRINTED_12)


def test_rigidity_and_mass_per_length_stand_in_for_the_section() -> None:
    names = ("natural_angular_frequency[1]", "contact[1].mass")
    given = {"flexural_rigidity": RIGIDITY, "mass_per_length": BEAM_MASS / LENGTH}
    unused = {"width": 0.0, "thickness": -1.0, "density": math.nan, "youngs_modulus": 0.0}
    with beam(stop(1.0)) as section, beam({**stop(1.0), **given, **unused}) as replaced:
        assert [section.get(n) for n in names] == pytest.approx(
            [replaced.get(n) for n in names], rel=ROUNDING
        )
        assert section.get(names[0]) / (2.0 * math.pi) == pytest.approx(26.3207, abs=5e-5)


@pytest.mark.parametrize("modes", [1, 4, 64])
def test_the_contact_mass_at_the_tip_is_the_beams_over_four_n(modes: int) -> None:
    with beam({"modes": modes, **stop(1.0)}) as b:
        assert b.get("contact[1].mass") == pytest.approx(BEAM_MASS / (4 * modes), rel=ROUNDING)


# ---- statics ----


@pytest.mark.parametrize(("modes", "share"), [(1, 0.97069), (2, 0.99540), (4, 0.99938)])
def test_a_constant_force_at_the_tip_finds_the_compliance_of_its_modes(modes: int, share: float) -> None:
    for load in ({"forcing.amplitude": 2.0}, {"force": 2.0}, {"forcing.amplitude": 1.5, "force": 0.5}):
        with beam({**damped(modes), **load}) as b:
            b.step(5.0)
            exact = (4.0 / EIGENVALUES[:modes] ** 4).sum() * 2.0 / (TIP_STIFFNESS / 3.0)
            assert b.get("displacement") == pytest.approx(exact, rel=SEQUENCE)
            assert b.get("displacement") * TIP_STIFFNESS / 2.0 == pytest.approx(share, abs=5e-6)


def test_a_uniform_load_bends_the_tip_by_its_closed_form() -> None:
    load = {"forcing.kind": UNIFORM, "forcing.amplitude": 3.0, "forcing.phase": 0.5}
    with beam({**damped(64), **load}) as b:
        b.step(5.0)
        expected = 3.0 * math.cos(0.5) * LENGTH**4 / (8.0 * RIGIDITY)
        # the rest of the sum falls with the fifth power of the eigenvalue: 64 modes leave 1e-10
        assert b.get("displacement") == pytest.approx(expected, rel=1e-9)


def test_an_accelerated_base_bends_the_beam_as_its_own_weight() -> None:
    forcing = {"forcing.kind": BASE_ACCELERATION, "forcing.amplitude": 0.6}
    deflection = -9.6 * BEAM_MASS * LENGTH**3 / (8.0 * RIGIDITY)
    for load in ({**forcing, "base_acceleration": 9.0}, {"base_acceleration": 9.6}):
        with beam({**damped(64), **load}) as b:
            b.step(5.0)
            assert b.get("displacement") == pytest.approx(deflection, rel=1e-9)
            assert b.get("acceleration") == pytest.approx(9.6, rel=ORBIT)


def test_a_load_in_the_shape_of_a_mode_moves_this_mode_alone() -> None:
    load = {"forcing.kind": MODE, "forcing.mode": 2, "forcing.amplitude": 0.3}
    with beam({**damped(3), **load}) as b:
        b.step(5.0)
        natural = b.get("natural_angular_frequency[2]")
        expected = [0.0, 0.3 / (BEAM_MASS * natural**2), 0.0]
        assert b.get_each("modal_displacement[{}]", 3) == pytest.approx(expected, rel=ORBIT)


# ---- motion without stops ----


@pytest.mark.parametrize("version", VERSIONS)
def test_a_mode_that_is_released_decays_in_its_closed_form(version: str) -> None:
    start = {"modes": 3, "modal_displacement_start[2]": 1e-3, "modal_velocity_start[2]": 0.2}
    with beam({**start, "damping_ratio[2]": 0.02, "damping_ratio[1]": 1.5}, version=version) as b:
        natural = b.get("natural_angular_frequency[2]")
        ratio, time = 0.02, 0.0317
        rate = natural * math.sqrt(1.0 - ratio**2)
        sine = (0.2 + ratio * natural * 1e-3) / rate * math.sin(rate * time)
        expected = math.exp(-ratio * natural * time) * (1e-3 * math.cos(rate * time) + sine)
        b.step(time)
        assert b.get_each("modal_displacement[{}]", 3) == pytest.approx([0, expected, 0], abs=1e-3 * SEQUENCE)
        assert b.get("displacement") == pytest.approx(-2.0 * expected, abs=2e-3 * SEQUENCE)


def test_rayleigh_damping_is_added_to_each_ratio() -> None:
    alpha, beta, own = 3.0, 1e-5, [0.01, 0.0, 0.02]
    start = {"modes": 3, **each("modal_velocity_start", [0.1, -0.2, 0.3])}
    with beam(start) as b:
        natural = b.get_each("natural_angular_frequency[{}]", 3)
    ratios = own + alpha / (2.0 * natural) + beta * natural / 2.0
    ends = []
    for damping in (
        {**each("damping_ratio", own), "rayleigh.mass": alpha, "rayleigh.stiffness": beta},
        each("damping_ratio", ratios),
    ):
        with beam({**start, **damping}) as b:
            b.step(0.1)
            ends.append(b.get_each("modal_displacement[{}]", 3))
    assert ends[0] == pytest.approx(ends[1], rel=SEQUENCE)


def test_the_motion_anywhere_is_the_sum_of_the_shapes() -> None:
    start, places = np.array([1e-3, -2e-4, 1e-4, 5e-5]), [0.0, 0.3, 0.7, 1.0]
    sensors = {f"sensor[{k + 1}].location": s for k, s in enumerate(places)}
    with beam({**each("modal_displacement_start", start), **sensors, "sensor_location": 0.3}) as b:
        shapes = np.array([clamped_free(s) for s in places])
        assert b.get_each("sensor[{}].displacement", 4) == pytest.approx(shapes @ start, abs=1e-13)
        assert b.get("displacement") == b.get("sensor[2].displacement")
        natural = b.get_each("natural_angular_frequency[{}]", 4)
        acceleration = -shapes @ (natural**2 * start)
        assert b.get_each("sensor[{}].acceleration", 4) == pytest.approx(acceleration, rel=1e-9)


def test_the_clamp_moves_with_the_base() -> None:
    forcing = {"forcing.kind": BASE_ACCELERATION, "forcing.amplitude": 2.0, "forcing.phase": 0.4}
    inputs = {"base_acceleration": 0.5, "base_acceleration_rate": 0.1}
    rate, time = 120.0, 0.73
    with beam({**forcing, **inputs, "forcing.angular_frequency": rate, "sensor[1].location": 0.0}) as b:
        for t in (0.0, time):
            if t:
                b.step(t)
            expected = 2.0 * math.cos(rate * t + 0.4) + 0.5 + 0.1 * t
            assert b.get("sensor[1].acceleration") == pytest.approx(expected, abs=SEQUENCE)
            assert b.get("sensor[1].displacement") == 0.0


# ---- impacts ----

STRUCK = {**each("modal_velocity_start", [0.5, 0.2, -0.1, 0.05]), **stop(0.0, 1.0)}


def energy(b: ComponentFmu) -> float:
    return float(b.get("energy.kinetic") + b.get("energy.potential"))


def energies_over_elastic_impacts(projection: int, impacts: int) -> NDArray[np.float64]:
    """Return the energies of an unforced, undamped beam of four modes that hits a stop at its tip."""
    energies = []
    with beam({**STRUCK, **stop(0.0, 1.0), "impact_projection": projection}) as b:
        energies.append(energy(b))
        while b.get("contact[1].count") < impacts:
            b.step(1e-3)
            energies.append(energy(b))
    return np.array(energies) / energies[0]


def test_elastic_impacts_keep_the_energy_and_those_by_collocation_do_not() -> None:
    variational = energies_over_elastic_impacts(1, 200)
    assert np.abs(variational - 1.0).max() <= 1e-12
    assert np.abs(energies_over_elastic_impacts(COLLOCATION, 200) - 1.0).max() > 1e-2


def collocated_rule(restitution: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rule of three clamped-free modes, grid 1/3, 2/3, 1, and the state with the largest gain of energy."""
    shapes = np.array([clamped_free(s)[:3] for s in (1 / 3, 2 / 3, 1.0)])
    direction = np.linalg.solve(shapes, [0.0, 0.0, 1.0])
    rule = np.eye(3) - (1.0 + restitution) * np.outer(direction, shapes[2])
    return rule, np.linalg.svd(rule)[2][0]


@pytest.mark.parametrize(("projection", "most"), [(1, 1.0), (COLLOCATION, 1.46313)])
def test_collocation_turns_round_the_contact_alone_and_may_create_energy(
    projection: int, most: float
) -> None:
    rule, worst = collocated_rule(0.6)
    worst *= np.sign(clamped_free(1.0)[:3] @ worst)
    start = {"modes": 3, **each("modal_velocity_start", worst), **stop(0.0, 0.6)}
    places = {f"sensor[{k}].location": k / 3 for k in (1, 2, 3)}
    with beam({**start, **places, "impact_projection": projection}) as b:
        before, first = b.get_each("sensor[{}].velocity", 3), energy(b)
        b.step(1e-12)
        after = b.get_each("sensor[{}].velocity", 3)
        assert after[2] == pytest.approx(-0.6 * before[2], abs=1e-6)
        ratio = energy(b) / first
        if projection == COLLOCATION:
            assert after[:2] == pytest.approx(before[:2], abs=1e-6)
            assert b.get_each("modal_velocity[{}]", 3) == pytest.approx(rule @ worst, abs=1e-6)
            assert ratio == pytest.approx(most, abs=5e-6)  # equations.md 6.8
        else:
            assert ratio < most


@pytest.mark.parametrize("boundary", [2, 3, 4])
def test_collocation_has_a_grid_for_beams_held_at_both_ends(boundary: int) -> None:
    start = {"boundary": boundary, "modes": 5, "modal_velocity_start[1]": 0.3, **stop(0.0, 0.5)}
    places = {f"sensor[{k}].location": s for k, s in enumerate((1 / 6, 1 / 3, 2 / 3), 1)}
    with beam({**start, **places, "contact[1].location": 0.48, "impact_projection": COLLOCATION}) as b:
        before = b.get_each("sensor[{}].velocity", 3)
        b.step(1e-12)
        assert b.get("contact[1].count") == 1
        assert b.get_each("sensor[{}].velocity", 3) == pytest.approx(before, abs=1e-5)


@pytest.mark.parametrize("boundary", [1, 2, 3, 4])
@pytest.mark.parametrize("law", [1, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY])
def test_unforced_beams_of_all_kinds_lose_energy_to_every_law_of_contact(boundary: int, law: int) -> None:
    stiffness = {KELVIN_VOIGT: 1e4, HERTZ: 1e6, HUNT_CROSSLEY: 1e6}.get(law, 0.0)
    contact = {**stop(1e-4, 0.6, law=law), "contact[1].stiffness": stiffness, "contact[1].location": 0.6}
    damping = {} if law in (1, HERTZ) else {"contact[1].damping": 0.3}
    start = {"boundary": boundary, **damped(4, 1e-4), **each("modal_velocity_start", [0.2, 0.1])}
    with beam({**start, **contact, **damping, "record.energies": True}) as b:
        first = energy(b)
        b.advance(0.2)
        while b.get("contact[1].force") > 0.0:  # energy stored in a stop does not belong to the beam
            b.step(1e-4)
        assert b.get("contact[1].count") > 3
        lost = b.get("energy.damping_loss") + b.get("energy.contact_loss")
        assert energy(b) == pytest.approx(first - lost, rel=1e-8)
        assert lost > 1e-3 * first


def test_modal_energies_are_only_worked_out_when_asked_for() -> None:
    for recorded in (False, True):
        with beam({**STRUCK, "record.energies": recorded}) as b:
            b.step(0.01)
            total = b.get_each("modal_energy[{}]", 4).sum()
            assert total == pytest.approx(energy(b) if recorded else 0.0, rel=SEQUENCE)


# ---- warnings ----


@pytest.mark.parametrize("version", VERSIONS)
def test_the_first_mode_outside_euler_bernoullis_theory_is_named(version: str) -> None:
    j = np.arange(1, 41)
    xi = (j - 0.5) * np.pi  # accurate to 1e-3 or better from mode 3 on
    error = 50.0 * (xi * 0.002 / math.sqrt(12.0) / LENGTH) ** 2 * (1.0 + 2.6 * 1.2)
    first = int(j[error > 2.0][0])
    with beam({"modes": 40}, version=version) as b:
        assert len(b.messages) == 1
        assert f"mode {first} leaves the validity of Euler-Bernoulli's theory" in b.messages[0]
        assert f"{error[first - 1]:.2g} %" in b.messages[0]
        b.get("displacement")
        b.step(1e-3)
        assert len(b.messages) == 1
    with beam({"modes": first - 1}, version=version) as b:
        assert b.messages == []


def test_a_thick_beam_is_warned_of_and_one_of_unknown_section_is_not() -> None:
    with beam({"thickness": 0.1}) as b:
        assert "mode 1 leaves" in b.messages[0]
        assert "Use a thinner beam" in b.messages[0]
    with beam({"thickness": 0.1, "flexural_rigidity": 1.0, "mass_per_length": 0.1}) as b:
        assert b.messages == []


# ---- refusals ----

SCENE = {**damped(3), **stop(1e-3)}


def test_the_forced_mode_must_be_in_use() -> None:
    text = refusal({**SCENE, "forcing.kind": MODE, "forcing.mode": 4})
    assert "forcing.mode: expected 1 to 3 (modes), got 4" in text


@pytest.mark.parametrize(("boundary", "location"), [(1, 0.0), (2, 1.0), (3, 1.0), (4, 0.0), (4, 1.0)])
def test_a_stop_on_a_support_is_refused(boundary: int, location: float) -> None:
    text = refusal({**SCENE, "boundary": boundary, "contact[1].location": location})
    assert "contact[1].location: expected a point that can move" in text


def test_a_start_beyond_a_stop_is_refused_and_a_stop_at_a_node_is_not() -> None:
    text = refusal({**SCENE, "modal_displacement_start[1]": 1e-3})
    assert "modal_displacement_start: expected a start on the free side of contact[1] (<= 0.001" in text
    node = {"boundary": 4, "contact[1].location": 0.5, "modal_velocity_start[2]": 0.3}
    with beam({**SCENE, **node}) as b:
        b.step(1.0)
        assert b.get("contact[1].count") == 0


def test_beams_beyond_the_range_of_numbers_are_refused() -> None:
    assert "natural frequencies are finite numbers" in refusal(
        {**SCENE, "youngs_modulus": 1e308, "length": 1e-100}
    )


# ---- residual vectors ----


@pytest.mark.parametrize("version", VERSIONS)
def test_a_beam_with_residual_vectors_yields_as_a_whole_beam_does(version: str) -> None:
    # a heavily damped beam settles on its stop: the static deflection of a force on a clamped beam and a spring
    stiffness, force = 3.0 * TIP_STIFFNESS, 0.2
    pressed = {"forcing.amplitude": force, "forcing.angular_frequency": 0.0}
    found = {}
    for residual in (0, 1):
        values = {
            **damped(3),
            **pressed,
            "residual": residual,
            **stop(0.0, law=KELVIN_VOIGT, stiffness=stiffness),
        }
        with beam(values, version=version) as b:
            b.step(5.0)
            found[residual] = b.get("displacement")
    whole = force / (TIP_STIFFNESS + stiffness)
    assert found[1] == pytest.approx(whole, rel=1e-9)
    assert abs(found[0] / whole - 1.0) > 1e-4


def test_residual_vectors_beside_a_rigid_stop_or_too_few_modes_are_refused() -> None:
    rigid = {"residual": 1, "contact[2].law": 1, "contact[2].position": 1.0}
    assert "contact[2].law: expected a stop that yields beside residual" in refusal(rigid)
    few = {"residual": 1, "modes": 1, **stop(1.0, law=KELVIN_VOIGT, stiffness=1e3)}
    assert "modes: expected more than 1 beside residual" in refusal(few)
    near = {
        **few,
        "modes": 4,
        **stop(1.0, law=KELVIN_VOIGT, k=2, stiffness=1e3),
        "contact[2].location": 1.0 - 1e-9,
    }
    assert "contact[2].location: expected a place that residual can tell" in refusal(near)
    shaped = {**few, "modes": 4, "forcing.kind": MODE, "forcing.mode": 4, "forcing.amplitude": 1.0}
    assert "forcing.mode: expected 1 to 3, a natural mode, got 4" in refusal(shaped)
