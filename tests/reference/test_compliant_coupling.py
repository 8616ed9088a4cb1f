"""A body and a compliant stop, as two FMUs, conserve the interface energy and move like one FMU.

Closed forms: equations.md 6.9 (a spring and a dashpot, with separation at zero force) and 6.10.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.compliant_parts import FREE, LAWS, contact_energy_error, coupled, plain_energy_error
from support.coupled_parts import EXCHANGES, VERSIONS

from vibroimpact.orchestrator.run.coupled import CoupledDriver
from vibroimpact.orchestrator.run.fused import BodyDriver

MIXED = [(b, s) for b in VERSIONS for s in VERSIONS]
EXACT = 1e-12
"""Relative energy error of one contact with a linear stop: some thirty roundings of the flow."""
REPORTED = 1e-9
"""Largest difference between the residual and the energy really gained, over the energy of the impact."""


# ---- the requirement ----


@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_an_elastic_contact_at_thirty_steps_keeps_its_energy(
    versions: tuple[str, str], exchange: str
) -> None:
    error, residual = contact_energy_error(
        "kelvin_voigt", {"stiffness": 1e4}, versions=versions, exchange=exchange
    )
    assert abs(error) <= EXACT  # required: 1e-6
    assert abs(residual) <= EXACT


def test_a_plain_importer_creates_the_energy_that_this_one_does_not() -> None:
    # held forces, no events, thirty steps per contact: each step multiplies the energy by at least 1 + (w H)^2 / 2
    assert plain_energy_error("jacobi", 30) > 0.6
    assert plain_energy_error("gauss_seidel", 30) > 0.15
    # first order: ten times the steps leave a tenth of it
    assert 7.0 <= plain_energy_error("gauss_seidel", 100) / plain_energy_error("gauss_seidel", 1000) <= 13.0


@pytest.mark.parametrize("steps", [1.0, 3.0, 7.0, 300.0])
def test_a_linear_stop_is_exact_at_any_number_of_steps(steps: float) -> None:
    error, residual = contact_energy_error("kelvin_voigt", {"stiffness": 1e4}, contact_steps=steps)
    assert max(abs(error), abs(residual)) <= EXACT


@pytest.mark.parametrize("law", ["hertz", "hunt_crossley"])
def test_the_default_error_of_a_nonlinear_stop_is_a_few_millionths(law: str) -> None:
    elastic = {"stiffness": 1e6}
    error, _ = contact_energy_error(law, elastic)
    assert abs(error) <= 5e-6


def test_the_error_of_a_nonlinear_stop_falls_faster_than_the_second_power_of_the_step() -> None:
    errors = [abs(contact_energy_error("hertz", LAWS["hertz"], contact_steps=n)[0]) for n in (8, 32, 128)]
    assert errors[1] < errors[0] / 16.0
    assert errors[2] < errors[0] / 256.0


# ---- the residual ----


@pytest.mark.parametrize("slopes", [True, False], ids=["slopes", "force alone"])
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
@pytest.mark.parametrize("steps", [6.0, 30.0])
def test_the_reported_residual_is_the_energy_gained(
    versions: tuple[str, str], slopes: bool, steps: float
) -> None:
    # an elastic stop stores all energy: any excess of the mass comes from the exchange
    error, residual = contact_energy_error(
        "hertz", LAWS["hertz"], versions=versions, slopes=slopes, contact_steps=steps
    )
    assert abs(error) > 100.0 * REPORTED
    assert abs(residual - error) <= REPORTED


@pytest.mark.parametrize("side", ["upper", "lower"])
def test_the_residual_of_a_stop_below_is_that_of_its_mirror_image(side: str) -> None:
    sign = 1.0 if side == "upper" else -1.0
    run = coupled("hertz", LAWS["hertz"], {**FREE, "velocity_start": sign}, position=sign, side=side)
    run.importer.advance(2.0)
    error = run.values("velocity")[0] ** 2 - 1.0
    assert abs(run.residual() / 0.5 - error) <= REPORTED
    run.importer.free()


# ---- stops that return only a force ----


@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_a_stop_without_slopes_keeps_energy_by_repeated_steps(versions: tuple[str, str]) -> None:
    spring, _ = contact_energy_error("kelvin_voigt", {"stiffness": 1e4}, versions=versions, slopes=False)
    ball, _ = contact_energy_error("hertz", LAWS["hertz"], versions=versions, slopes=False)
    assert abs(spring) <= EXACT  # the straight line through its answers equals the spring
    assert abs(ball) <= 1e-2


def test_a_stop_without_slopes_converges_to_the_one_with() -> None:
    def velocity(steps: float, *, slopes: bool) -> float:
        run = coupled("kelvin_voigt", LAWS["kelvin_voigt"], slopes=slopes, contact_steps=steps)
        run.importer.advance(2.0)
        (found,) = run.values("velocity")
        run.importer.free()
        return found

    exact = velocity(30, slopes=True)
    errors = [abs(velocity(n, slopes=False) - exact) for n in (15, 60, 240)]
    assert errors[1] < errors[0] / 16.0
    assert errors[2] < errors[0] / 100.0


# ---- the begin and the end of a contact ----


@pytest.mark.parametrize("versions", MIXED, ids="+".join)
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5, 2.0])
def test_entry_exit_and_restitution_of_a_dashpot_are_those_of_the_closed_form(
    versions: tuple[str, str], ratio: float
) -> None:
    stiffness = 1e4
    w = math.sqrt(stiffness)
    run = coupled(
        "kelvin_voigt",
        {"stiffness": stiffness, "damping": 2.0 * ratio * w},
        {**FREE, "displacement_start": 0.25},
        versions=versions,
    )
    run.importer.advance(1.5)
    displacement, velocity, began = run.values("displacement", "velocity", "contact[1].last_time")
    run.importer.free()
    if ratio < 1.0:
        root = math.sqrt(1.0 - ratio * ratio)
        angle = 2.0 * math.acos(ratio) / root
    else:
        root = math.sqrt(ratio * ratio - 1.0)
        angle = 2.0 * math.acosh(ratio) / root
    restitution, lasts = math.exp(-ratio * angle), angle / w
    assert began == pytest.approx(0.75, abs=1e-14)
    assert -velocity == pytest.approx(restitution, rel=1e-11)
    # separation is at zero force: k y + c v = 0 at y = c e / k beyond the surface
    at_exit = 1.0 + 2.0 * ratio * restitution / w
    assert 1.5 + (displacement - at_exit) / restitution == pytest.approx(0.75 + lasts, abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_a_stop_never_pulls_and_the_body_is_not_in_it_without_force(law: str) -> None:
    run = coupled(law, LAWS[law], {"velocity_start": 1.5}, contact_steps=10)
    forces = []
    while run.importer.time < 12.0:
        run.importer.advance(run.importer.time + 0.00037)
        force, displacement, velocity = run.values("contact[1].force", "displacement", "velocity")
        forces.append(force)
        if displacement > 1.0 + 1e-9 and velocity > 0.0:
            assert force > 0.0
        if displacement < 1.0:
            assert force == 0.0
    assert min(forces) == 0.0
    assert max(forces) > 1.0
    run.importer.free()


# ---- coupled is fused ----

FORCED = {
    "mass": 1.0,
    "damping": 0.2,
    "stiffness": 1.0,
    "forcing.amplitude": 0.5,
    "forcing.angular_frequency": 1.0,
    "forcing.phase": 0.0,
    "displacement_start": 0.0,
    "velocity_start": 0.0,
    "contact[1].position": 1.0,
}
NUMBERS = {"restitution": 1, "kelvin_voigt": 2, "hertz": 3, "hunt_crossley": 4}


def rows_of(driver: BodyDriver | CoupledDriver, floats: dict[str, float], end: float) -> np.ndarray:
    """Return time, phase, velocity, impulse, contact, restitution and duration of each impact."""
    driver.begin(floats, None)
    driver.record(impacts=True, extrema=False, periods=False)
    driver.advance(end)
    rows = driver.impacts()
    driver.close()
    return rows


def both(law: str, parameters: dict[str, float], **settings: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the impacts of the fused body and of body and stop."""
    floats = FORCED | {f"contact[1].{name}": value for name, value in parameters.items()}
    integers = {"contact[1].law": NUMBERS[law], "contact[1].side": 1, "impact_limit": 10**6}
    end = 60 * math.pi
    fused = rows_of(BodyDriver(floats, integers), floats, end)
    apart = rows_of(CoupledDriver(floats, integers, 1, **settings), floats, end)  # type: ignore[arg-type]
    return fused, apart


@pytest.mark.parametrize("macro_step", [math.inf, 0.05, 0.003])
@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_coupled_is_fused_for_a_spring_and_a_dashpot(damping: float, macro_step: float) -> None:
    fused, apart = both("kelvin_voigt", {"stiffness": 1e3, "damping": damping}, macro_step=macro_step)
    assert len(fused) == len(apart) > 20
    # every communication point in the flight before adds a rounding of the state, and of absolute time
    assert np.abs(fused[:, 1:] - apart[:, 1:]).max() <= 2e-12
    assert np.abs(fused[:, 0] - apart[:, 0]).max() <= 2e-12


@pytest.mark.parametrize("law", ["hertz", "hunt_crossley"])
def test_coupled_is_fused_for_a_nonlinear_stop_within_its_order(law: str) -> None:
    fused, apart = both(
        law, {"stiffness": 1e4, "damping": 0.3} if law == "hunt_crossley" else {"stiffness": 1e4}
    )
    assert len(fused) == len(apart) > 20
    assert np.abs(fused[:, [0, 2, 3]] - apart[:, [0, 2, 3]]).max() <= 1e-3
    # energies that each impact takes from the mass
    taken = [rows[:, 2] ** 2 * (1.0 - rows[:, 5] ** 2) for rows in (fused, apart)]
    assert np.abs(taken[0] - taken[1]).max() <= 1e-3 * float((fused[:, 2] ** 2).max())


def test_a_restitution_that_falls_with_speed_is_the_same_coupled_and_fused() -> None:
    fused, apart = both("restitution", {"restitution": 0.7, "yield_velocity": 0.1})
    assert len(fused) > 20
    np.testing.assert_array_equal(fused, apart)
    # the restitution falls with speed: (V / yield_velocity)^(-1/4)
    fast = fused[fused[:, 2] > 0.2]
    np.testing.assert_allclose(fast[:, 5], 0.7 * (fast[:, 2] / 0.1) ** -0.25, rtol=1e-14)
