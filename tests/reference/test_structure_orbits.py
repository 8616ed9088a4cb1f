"""Chains and beams against references independent of the engine: closed forms, printed numbers, DOP853."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import beta
from support.component_fmu import HERTZ, KELVIN_VOIGT, each, stop
from support.exact_modes import beam_root
from support.reference_bodies import (
    Beam,
    Body,
    Chain,
    beam,
    oscillator,
    period_one_orbits,
    uniform_chain,
)
from support.reference_stops import Forcing, Stop
from support.structure_fmu import ROW_IMPACT, StructureFmu, forced
from support.structure_reference import Reference

# DOP853 at rtol 1e-12, over up to 50 flights of a contracting orbit
ROAD = 1e-9
THESIS_VELOCITY, THESIS_LOSS = 0.787660852554797, 0.158204452755


def chain_parameters(
    masses: list[float], stiffnesses: list[float], dampings: list[float]
) -> dict[str, float]:
    return {
        "masses": len(masses),
        **each("mass", masses),
        **each("stiffness", stiffnesses),
        **each("damping", dampings),
    }


def thesis_chain(angular_frequency: float, **more: float) -> dict[str, float]:
    """Return two unit masses, k = 1, c = .1, stop on mass 2 at .1, force .5 on mass 1, r = .7 (thesis 6.2)."""
    return {
        **chain_parameters([1.0, 1.0], [1.0, 1.0], [0.1, 0.1]),
        **each("forcing.amplitude", [0.5, 0.0]),
        "forcing.angular_frequency": angular_frequency,
        **stop(0.1, restitution=0.7),
        **more,
    }


def thesis_reference(angular_frequency: float, fmu: StructureFmu) -> Reference:
    """Return the reference of the same chain, from the current state of the FMU."""
    body = uniform_chain(2)
    inverse = np.linalg.inv(body.shapes)
    return Reference(
        body,
        [Stop(body.shapes[1], 0.1, 0.7)],
        Forcing(body.shapes[0] * 0.5, angular_frequency),
        inverse @ fmu.get_each("displacement[{}]", 2),
        inverse @ fmu.get_each("velocity[{}]", 2),
        fmu.time,
    )


def test_the_thesis_chain_settles_on_the_closed_form_orbit_and_its_loss() -> None:
    # equations.md 9
    period = 2.0 * math.pi / 0.9
    with StructureFmu("Chain", {**thesis_chain(0.9), "record.energies": True}) as fmu:
        natural = fmu.get_each("natural_angular_frequency[{}]", 2)
        fmu.advance(300 * period)
        before = fmu.get("energy.contact_loss")
        fmu.advance(310 * period)
        lost = (fmu.get("energy.contact_loss") - before) / 10.0
        velocities = fmu.impacts[-10:, 2]
    assert natural == pytest.approx([(math.sqrt(5.0) - 1.0) / 2.0, (math.sqrt(5.0) + 1.0) / 2.0], rel=1e-14)
    assert velocities == pytest.approx([THESIS_VELOCITY] * 10, abs=1e-12)
    assert lost == pytest.approx(THESIS_LOSS, abs=1e-12)


@pytest.mark.parametrize(("angular_frequency", "impacts"), [(0.6, 2), (1.4, 1), (0.4, 4)])
def test_the_thesis_chain_has_so_many_impacts_in_each_period_and_they_are_those_of_the_reference(
    angular_frequency: float, impacts: int
) -> None:
    period, periods = 2.0 * math.pi / angular_frequency, 12
    with StructureFmu("Chain", thesis_chain(angular_frequency)) as fmu:
        fmu.advance(250 * period)
        seen = len(fmu.impacts)
        motion = thesis_reference(angular_frequency, fmu)
        fmu.advance((250 + periods) * period)
        found = fmu.impacts[seen:]
    motion.advance((250 + periods) * period)
    expected = np.array([(i.time, i.velocity, i.impulse) for i in motion.impacts])
    assert len(found) == impacts * periods == len(expected)
    assert np.abs(found[:, [0, 2, 3]] - expected).max() < ROAD
    by_period = found[:, 2].reshape(periods, impacts)
    assert np.abs(by_period - by_period[0]).max() < 1e-11


@pytest.mark.parametrize(("angular_frequency", "sticks"), [(0.1, 1), (0.2, 1), (0.3, 1), (0.32, 0)])
def test_mass_two_sticks_in_every_slow_period_and_in_none_at_a_frequency_of_point_32(
    angular_frequency: float, sticks: int
) -> None:
    # thesis 6.2.3: sticking motions up to just above .3
    period = 2.0 * math.pi / angular_frequency
    with StructureFmu("Chain", thesis_chain(angular_frequency)) as fmu:
        fmu.advance(100 * period)
        seen = len(fmu.sticks)
        fmu.advance(120 * period)
        found = fmu.sticks[seen:]
    assert len(found) == 20 * sticks
    if sticks:
        assert np.diff(found[:, 0]) == pytest.approx([period] * 19, abs=1e-8)


def test_a_stick_of_the_thesis_chain_begins_and_ends_where_the_reference_says() -> None:
    period = 2.0 * math.pi / 0.3
    with StructureFmu("Chain", thesis_chain(0.3)) as fmu:
        fmu.advance(100 * period)
        seen = len(fmu.sticks)
        motion = thesis_reference(0.3, fmu)
        fmu.advance(102 * period)
        found = fmu.sticks[seen:]
    motion.advance(102 * period)
    expected = np.array([(s.start, s.end) for s in motion.sticks])
    assert len(found) == 2
    assert np.abs(found[:, :2] - expected).max() < 1e-8


class Orbiting(NamedTuple):
    """A body on its P(1,1) orbit: parts of the reference, parameters of the FMU, and a function from q to its start."""

    body: Body
    contact: np.ndarray
    force: np.ndarray
    position: float
    restitution: float
    angular_frequency: float
    component: str
    parameters: dict[str, float]
    start: tuple[str, str]
    to_start: np.ndarray


def orbiting_oscillator() -> Orbiting:
    body = oscillator(1.0, 0.08, 1.0)
    parameters = {"damping": 0.08, **forced(0.45, 1.1)}
    return Orbiting(
        body,
        np.ones(1),
        np.array([0.45]),
        0.8,
        0.75,
        1.1,
        "Oscillator",
        parameters,
        ("displacement_start", "velocity_start"),
        np.eye(1),
    )


def orbiting_chain() -> Orbiting:
    body: Chain = uniform_chain(2)
    names = ("displacement_start", "velocity_start")
    return Orbiting(
        body,
        body.shapes[1],
        body.shapes[0] * 0.5,
        0.1,
        0.7,
        0.9,
        "Chain",
        thesis_chain(0.9),
        names,
        body.shapes,
    )


def orbiting_beam() -> Orbiting:
    """Return a clamped-free beam of four modes, forced in the middle at its first frequency, stop at the tip."""
    body: Beam = beam(4, damping_ratio=0.05)
    parameters = {
        "modes": 4,
        "length": 1.0,
        "flexural_rigidity": 1.0,
        "mass_per_length": 1.0,
        **each("damping_ratio", [0.05] * 4),
        **forced(0.05, float(body.natural[0])),
        "forcing_location": 0.5,
        "contact[1].location": 1.0,
        "sensor_location": 1.0,
    }
    names = ("modal_displacement_start", "modal_velocity_start")
    return Orbiting(
        body,
        body.shape(1.0),
        body.shape(0.5) * 0.05,
        0.0521781594213819,
        0.6,
        float(body.natural[0]),
        "Beam",
        parameters,
        names,
        np.eye(4),
    )


@pytest.mark.parametrize(
    ("make", "impacts"),
    [
        (orbiting_oscillator, 50),
        (orbiting_chain, 50),
        (orbiting_beam, 10),
        pytest.param(orbiting_beam, 50, marks=pytest.mark.long),
    ],
)
def test_impacts_of_a_period_one_orbit_are_those_of_dop853_and_of_the_closed_form(make, impacts) -> None:
    o = make()
    orbit = next(
        x
        for x in period_one_orbits(o.body, o.contact, o.force, o.angular_frequency, o.position, o.restitution)
        if x.physical
    )
    forcing = Forcing(o.force, o.angular_frequency, orbit.phase)
    ends = Stop(o.contact, o.position, o.restitution)
    motion = Reference(o.body, [ends], forcing, orbit.q, orbit.p, scale=o.position).advance(
        1e4, impacts=impacts
    )
    many = o.body.modes > 1
    displacement, velocity = o.to_start @ orbit.q, o.to_start @ orbit.p
    start = (
        {**each(o.start[0], displacement), **each(o.start[1], velocity)}
        if many
        else {o.start[0]: displacement[0], o.start[1]: velocity[0]}
    )
    parameters = {
        **o.parameters,
        **stop(o.position, restitution=o.restitution),
        **start,
        "forcing.phase": orbit.phase,
    }
    period = 2.0 * math.pi / o.angular_frequency
    with StructureFmu(o.component, parameters) as fmu:
        fmu.advance((impacts + 0.5) * period)
        found = fmu.impacts
    assert len(found) == impacts
    assert found[:, 2] == pytest.approx([orbit.velocity] * impacts, abs=1e-12 * max(1.0, orbit.velocity))
    expected = np.array([(i.time, i.velocity) for i in motion.impacts])
    assert np.abs(found[:, [0, 2]] - expected).max() < ROAD


def test_the_chatter_of_a_chain_accumulates_at_the_time_in_forty_digits() -> None:
    # equations.md 3.1, N-DOF form
    parameters = {
        **chain_parameters([1.0, 1.0], [1.0, 1.0], [0.2, 0.2]),
        **each("forcing.amplitude", [0.7, 0.1]),
        "forcing.angular_frequency": 0.23,
        **stop(0.05, restitution=0.55),
    }
    with StructureFmu("Chain", parameters) as fmu:
        fmu.advance(2.5)
        assert fmu.get("contact[1].stuck")
        began = fmu.get("contact[1].stick_start")
    assert began == pytest.approx(1.649577027167, abs=1e-11)


def test_a_held_mass_leaves_the_printed_motion_of_the_others_and_the_printed_force() -> None:
    # equations.md 3.4; a constant force of 1 on the held mass keeps it pressed and has no other effect
    parameters = {
        **chain_parameters([1.0, 2.0, 0.5], [3.0, 1.0, 2.0], [0.12, 0.04, 0.08]),
        **each("forcing.amplitude", [0.6, 0.0, 0.2]),
        "forcing.angular_frequency": 0.75,
        **stop(0.1, restitution=0.6),
        **each("displacement_start", [0.3, -0.05, 0.1]),
        **each("velocity_start", [0.2, 0.1, 0.0]),
        "force[3]": 1.0,
    }
    with StructureFmu("Chain", parameters, start_time=0.4) as fmu:
        fmu.advance(2.1)
        assert fmu.get_each("displacement[{}]", 3) == pytest.approx([-0.06125467, 0.2933916, 0.1], abs=5e-9)
        assert fmu.get("contact[1].force") == pytest.approx(1.391935115043184, abs=1e-12)


def compliant(law: int, velocity: float = 1.0, **parameters: float) -> tuple[float, float, float]:
    """Return contact time, restitution and impulse of a free unit mass against a compliant stop."""
    start = {
        **chain_parameters([1.0], [0.0], [0.0]),
        **stop(0.0, law=law, **parameters),
        **each("displacement_start", [-0.5]),
        **each("velocity_start", [velocity]),
    }
    with StructureFmu("Chain", start) as fmu:
        fmu.advance(2.0)
        (row,) = fmu.recorded(ROW_IMPACT)
        after = fmu.get("velocity")
    return float(row[7]), -after / velocity, float(row[4])


@pytest.mark.parametrize("stiffness", [1e2, 1e6, 1e10])
def test_a_hertzian_stop_gives_all_energy_back_after_its_closed_form_contact_time(stiffness: float) -> None:
    # equations.md 6.10: 3.2180650... = (4/5) B(2/5, 1/2) (5/4)^(2/5)
    factor = 0.8 * beta(0.4, 0.5) * 1.25**0.4
    assert factor == pytest.approx(3.218065, abs=5e-7)
    time, restitution, impulse = compliant(HERTZ, stiffness=stiffness)
    # with the default contact_tolerance of 1e-10 the end of the contact, where the force is flat, is less exact
    assert time == pytest.approx(factor * stiffness**-0.4, rel=1e-8)
    assert restitution == pytest.approx(1.0, abs=1e-9)
    assert impulse == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 0.99])
@pytest.mark.parametrize("stiffness", [1e2, 1e8])
def test_a_kelvin_voigt_stop_has_contact_time_and_restitution_of_the_damped_half_period(
    ratio: float, stiffness: float
) -> None:
    # equations.md 6.9, separation where the force vanishes
    rate = math.sqrt(stiffness)
    time, restitution, _ = compliant(KELVIN_VOIGT, stiffness=stiffness, damping=2.0 * ratio * rate)
    angle = math.acos(ratio) / math.sqrt(1.0 - ratio**2)
    assert time == pytest.approx(2.0 * angle / rate, rel=1e-11)
    assert restitution == pytest.approx(math.exp(-2.0 * ratio * angle), rel=1e-11)


def test_a_stiff_kelvin_voigt_stop_tends_to_the_restitution_law_with_the_contact_time() -> None:
    """On the thesis's P(1,1) orbit; the restitution .7 fixes the damping ratio of the contact (equations.md 6.9)."""
    period = 2.0 * math.pi / 0.9
    ratio = 0.11745  # start of the search for exp(-2 z acos(z) / sqrt(1 - z^2)) = .7
    for _ in range(50):
        angle = math.acos(ratio) / math.sqrt(1.0 - ratio**2)
        ratio *= math.log(0.7) / (-2.0 * ratio * angle)
    errors = []
    for stiffness in (1e6, 1e8, 1e10):
        law = stop(0.1, law=KELVIN_VOIGT, stiffness=stiffness, damping=2.0 * ratio * math.sqrt(stiffness))
        without = {k: v for k, v in thesis_chain(0.9).items() if not k.startswith("contact[1]")}
        with StructureFmu("Chain", {**without, **law}) as fmu:
            fmu.advance(150 * period)
            errors.append(abs(fmu.impacts[-1, 2] - THESIS_VELOCITY))
    # the contact time falls by 10 from one to the next
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.05)


def constrained(body: Beam) -> tuple[np.ndarray, np.ndarray]:
    """Return natural frequencies and shapes of a beam with a held tip, in modal coordinates."""
    _, _, rows = np.linalg.svd(body.shape(1.0)[None])
    space = rows[1:].T
    squares, vectors = np.linalg.eigh(space.T @ np.diag(body.natural**2) @ space)
    return np.sqrt(squares), space @ vectors


def test_a_beam_with_its_tip_held_approaches_the_clamped_pinned_beam_with_the_third_power_of_its_modes() -> (
    None
):
    exact = np.array([float(beam_root("clamped_pinned", j)) for j in (1, 2, 3)])
    gaps = []
    for modes in (16, 32, 64):
        natural, _ = constrained(beam(modes))
        gaps.append(np.sqrt(natural[:3]) / exact - 1.0)
    assert (np.array(gaps) > 0.0).all()
    for coarse, fine in pairwise(gaps):
        assert coarse / fine == pytest.approx([8.0] * 3, rel=0.05)
    assert gaps[-1].max() < 3e-6


@pytest.mark.parametrize("modes", [4, 16])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_beam_pressed_to_a_stop_at_its_tip_swings_at_the_frequencies_of_the_held_galerkin_beam(
    modes: int, number: int
) -> None:
    """Released in a held mode, it is inverted after half a period of that mode, and back after a whole period."""
    body = beam(modes)
    natural, vectors = constrained(body)
    start = 1e-3 * vectors[:, number - 1]
    half = math.pi / natural[number - 1]
    parameters = {
        "modes": modes,
        "length": 1.0,
        "flexural_rigidity": 1.0,
        "mass_per_length": 1.0,
        "forcing_location": 1.0,
        "contact[1].location": 1.0,
        **stop(0.0, restitution=0.5),
        **each("modal_displacement_start", start),
        "force": 10.0,
    }
    with StructureFmu("Beam", parameters) as fmu:
        for turn, sign in ((1, -1.0), (2, 1.0), (20, 1.0)):
            fmu.advance(turn * half)
            assert fmu.get("contact[1].stuck")
            assert fmu.get_each("modal_displacement[{}]", modes) == pytest.approx(sign * start, abs=1e-13)
