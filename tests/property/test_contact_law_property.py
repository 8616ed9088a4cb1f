"""The laws of stops alone, over random parameters: a free mass on one stop, against closed forms."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from support.structure import Modes, Stop, Structure
from support.tolerance import ROUNDING

FEW = settings(max_examples=100, derandomize=True)

#: Error of contacts with power laws, which are solved to a tolerance of 1e-10 in each of their segments.
FOLLOWED = 1e-8

masses = st.floats(-3.0, 3.0).map(lambda x: 10.0**x)
stiffnesses = st.floats(0.0, 8.0).map(lambda x: 10.0**x)
speeds = st.floats(-2.0, 1.0).map(lambda x: 10.0**x)


def free_mass(mass: float, stop: Stop, speed: float) -> tuple[float, float, float]:
    """Return restitution, duration and impulse of one contact of a free mass with a stop."""
    root = math.sqrt(mass)
    with Structure(Modes([0.0]), [stop], [-root], [speed * root]) as body:
        for _ in range(100):
            body.advance(2.0 / speed)
            if len(body.impacts):
                row = body.impacts[0]
                return float(row[6]), float(row[7]), float(row[4])
    raise AssertionError("no contact within 200 distances")


@FEW
@given(masses, speeds, st.floats(0.0, 1.0), st.floats(0.01, 10.0))
def test_restitution_falls_with_the_fourth_root_of_the_speed_above_the_yield_velocity(
    mass: float, speed: float, r: float, threshold: float
) -> None:
    stop = Stop([1.0 / math.sqrt(mass)], restitution=r, yield_velocity=threshold)
    restitution, _, impulse = free_mass(mass, stop, speed)
    expected = r * min(1.0, (speed / threshold) ** -0.25)
    assert abs(restitution - expected) <= 4 * ROUNDING
    assert abs(impulse - mass * (1.0 + expected) * speed) <= 4 * ROUNDING * mass * speed


@FEW
@given(masses, speeds, stiffnesses, st.floats(0.0, 3.0))
def test_kelvin_voigt_contacts_end_where_the_force_does(
    mass: float, speed: float, k: float, zeta: float
) -> None:
    # equations.md 6.9: F = K d + C d' falls through zero where ...
    natural = math.sqrt(k / mass)
    stop = Stop([1.0 / math.sqrt(mass)], law="kelvin_voigt", stiffness=k, damping=2.0 * zeta * natural * mass)
    restitution, duration, _ = free_mass(mass, stop, speed)
    if zeta < 0.999:
        angle = 2.0 * math.acos(zeta)  # ... rate t = pi - 2 asin(zeta)
        rate = math.sqrt(1.0 - zeta * zeta)
        time = angle / (rate * natural)
        expected = math.exp(-zeta * angle / rate)
    elif zeta > 1.001:
        rate = math.sqrt(zeta * zeta - 1.0)
        time = 2.0 * math.acosh(zeta) / (rate * natural)
        expected = math.exp(-zeta * 2.0 * math.acosh(zeta) / rate)
    else:
        time, expected = 2.0 / natural, math.exp(-2.0)
    near = 1.0 if 0.999 <= zeta <= 1.001 else 1e-9
    # the mass starts 1 m away: the duration is the difference of two times of about 1 / speed
    assert abs(duration - time) <= near * 2e-3 * time + 4 * ROUNDING / speed
    assert abs(restitution - expected) <= near * 2e-3


@FEW
@given(masses, speeds, stiffnesses)
def test_hertz_contacts_are_elastic_and_last_as_the_closed_form_says(
    mass: float, speed: float, k: float
) -> None:
    # equations.md 6.10: 2 (5/4)^(2/5) int_0^1 dx / sqrt(1 - x^(5/2)) (m^2 / (K^2 v))^(1/5)
    integral = math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    factor = 2.0 * 1.25**0.4 * integral
    stop = Stop([1.0 / math.sqrt(mass)], law="hertz", stiffness=k)
    restitution, duration, impulse = free_mass(mass, stop, speed)
    assert abs(restitution - 1.0) <= FOLLOWED
    time = factor * (mass**2 / (k**2 * speed)) ** 0.2
    assert abs(duration - time) <= FOLLOWED * time + 4 * ROUNDING / speed
    assert abs(impulse / (2.0 * mass * speed) - 1.0) <= FOLLOWED


@FEW
@given(masses, speeds, stiffnesses, st.floats(1.0, 2.5), st.floats(0.01, 3.0))
def test_hunt_crossley_restitution_depends_on_chi_times_the_speed_alone(
    mass: float, speed: float, k: float, exponent: float, chi_speed: float
) -> None:
    # m v dv = -K d^n (1 + chi v) dd. With w = chi v, w - ln(1 + w) is the same on the way in and out
    chi = chi_speed / speed
    stop = Stop([1.0 / math.sqrt(mass)], law="hunt_crossley", stiffness=k, damping=chi, exponent=exponent)
    restitution, _, _ = free_mass(mass, stop, speed)
    out = -chi_speed * restitution
    energy = chi_speed - math.log1p(chi_speed)
    assert 0.0 < restitution < 1.0
    # d energy / d restitution = w^2 e / (1 - w e), which divides the error of the restitution
    slope = chi_speed**2 * restitution / (1.0 + out)
    assert abs(out - math.log1p(out) - energy) <= FOLLOWED * (slope + energy)


@FEW
@given(stiffnesses, st.floats(0.0, 10.0), st.floats(1.0, 2.5), st.floats(1e-6, 1.0), st.floats(-3.0, 3.0))
def test_no_stop_pulls_and_all_are_stiffer_deeper_down(
    k: float, damping: float, exponent: float, depth: float, rate: float
) -> None:
    for law in ("kelvin_voigt", "hertz", "hunt_crossley"):
        stop = Stop([1.0], law=law, stiffness=k, damping=damping, exponent=exponent)
        forces = []
        for at in (depth, 1.5 * depth):
            with Structure(Modes([1.0]), [stop], [at], [rate]) as body:
                forces.append(body.forces[0])
        assert 0.0 <= forces[0] <= forces[1]
