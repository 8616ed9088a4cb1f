"""P(1,1) of m=1, k=1, zeta=.1, F=.5, w=1, r=.7, stop 1: 40-digit closed form (thesis eqs. 2.48 to 2.66)."""

import math

import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, stop
from support.exact_motion import period_one_orbits
from support.tolerance import LONG_PHASE, ORBIT, PARTITION

PHASE, VELOCITY = 0.3665212101960540571, 0.7910497883492130773
SCENE = {**forced(), **stop(1.0)}
PERIOD = 2.0 * math.pi
MILLION = 1_000_000


@pytest.mark.parametrize("version", VERSIONS)
def test_the_motion_from_rest_settles_on_the_exact_phase_and_velocity(version: str) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        o.step(100 * PERIOD)
        phase, velocity = o.contact("last_phase", "last_velocity")
    assert abs(phase - PHASE) <= ORBIT
    assert abs(velocity - VELOCITY) <= ORBIT


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("steps", [1, 1000, 100_000])
def test_a_million_impacts_later_phase_and_velocity_are_the_same(version: str, steps: int) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        end = (MILLION + 2) * PERIOD
        for i in range(1, steps + 1):
            o.step(end * (i / steps) - o.time)
        count, phase, velocity = o.contact("count", "last_phase", "last_velocity")
    assert count >= MILLION
    assert abs(phase - PHASE) <= LONG_PHASE
    assert abs(velocity - VELOCITY) <= ORBIT


def test_a_million_impacts_later_the_time_of_the_last_one_is_that_of_its_period_to_one_rounding() -> None:
    with OscillatorFmu(SCENE) as o:
        o.step((MILLION + 1) * PERIOD)
        time, count = o.contact("last_time", "count")
    # 2 pi in 33 digits: MILLION times the double 2 pi alone has an error of 2.4e-10
    period = (6.283185307179586232, 2.449293598294706414e-16)
    exact = math.fsum([PHASE, count * period[0], count * period[1]])
    assert abs(time - exact) <= 2 * math.ulp(exact)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interval", [0.001, 0.05, 1.0 / 3.0, 7.0])
def test_the_orbit_is_the_same_at_any_communication_step(version: str, interval: float) -> None:
    with OscillatorFmu(SCENE, version=version) as o:
        for i in range(1, math.ceil(60 * PERIOD / interval)):
            o.step(i * interval - o.time)
        phase, velocity = o.contact("last_phase", "last_velocity")
    assert abs(phase - PHASE) <= PARTITION
    assert abs(velocity - VELOCITY) <= PARTITION


GRID = [
    (zeta, w, force, r, orbit)
    for zeta in (0.0, 0.01, 0.04, 0.1, 0.3, 0.8)
    for w in (0.55, 0.8, 0.95, 1.1, 1.3, 1.7, 2.3)
    for force in (0.2, 0.5, 1.5)
    for r in (0.2, 0.5, 0.75, 0.9)
    for orbit in period_one_orbits(zeta, w, force, 0.8, r)
    if orbit.multiplier < 0.9 and orbit.velocity > 1e-3
]


def test_the_grid_of_orbits_is_a_grid() -> None:
    assert len(GRID) > 100


@pytest.mark.parametrize("part", range(4))
def test_every_stable_closed_form_orbit_is_an_orbit_of_the_fmu(part: int) -> None:
    for zeta, w, force, r, orbit in GRID[part::4]:
        parameters = forced(force, w, zeta, displacement_start=0.8, velocity_start=-r * orbit.velocity)
        parameters["forcing.phase"] = orbit.phase
        with OscillatorFmu({**parameters, **stop(0.8, r)}) as o:
            o.step(40.5 * 2.0 * math.pi / w)
            count, phase, velocity = o.contact("count", "last_phase", "last_velocity")
        case = f"zeta={zeta} w={w} F={force} r={r}: {orbit}"
        assert count == 40, case
        # 1 / velocity: the error of a phase is a displacement's rounding over the velocity
        bound = 20 * ORBIT * (1.0 + 1.0 / orbit.velocity) / (1.0 - orbit.multiplier)
        assert abs(math.remainder(phase - orbit.phase, 2.0 * math.pi)) <= bound, case
        assert abs(velocity - orbit.velocity) <= bound, case


def test_the_fresh_example_of_the_closed_form_is_met_by_formula_and_fmu() -> None:
    # equations.md 4.3: zeta=.04, F=.45, w=1.1, a=.8, r=.75, 40-digit computation
    (orbit,) = period_one_orbits(0.04, 1.1, 0.45, 0.8, 0.75)
    with OscillatorFmu({**forced(0.45, 1.1, 0.04), **stop(0.8, 0.75)}) as o:
        o.step(400 * 2.0 * math.pi / 1.1)
        phase, velocity = o.contact("last_phase", "last_velocity")
    for value in (orbit.velocity, velocity):
        assert abs(value - 0.952486147774719) <= 5 * ORBIT
    for value in (orbit.phase, phase):
        assert abs(value - 0.210560661892213) <= 5 * ORBIT
