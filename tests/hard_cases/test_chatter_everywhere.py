"""Chatter, sticking and release over restitution, damping and inputs; references: 40-digit bouncing, mirror images."""

import math

import pytest
from mpmath import mp, mpf
from support.component_fmu import LOWER, VERSIONS, OscillatorFmu, forced, stop
from support.exact_motion import Oscillator as Exact
from support.exact_motion import exact_flow
from support.tolerance import ROUNDING, SEQUENCE

FORCE, W = 1.0, 0.2


def exact_accumulation(zeta: float, r: float, start: float) -> mpf:
    """Return the end of the chatter that starts on the stop at 0 with velocity -start, t = 0, bounce by bounce."""
    body = Exact(1.0, 2.0 * zeta, 1.0, FORCE, W)
    with mp.workdps(40):
        time, velocity = mpf(0), mpf(start)
        while velocity > mpf(10) ** -14:
            pressure = FORCE * mp.cos(W * time)
            flight = 2 * velocity / pressure
            for _ in range(8):
                x, v = exact_flow(body, (mpf(0), -velocity), flight, W * time)
                flight -= x / v
            time += flight
            velocity = r * exact_flow(body, (mpf(0), -velocity), flight, W * time - W * flight)[1]
        return time + 2 * velocity / (FORCE * mp.cos(W * time) * (1 - r))


@pytest.mark.parametrize(("zeta", "r"), [(0.0, 0.3), (0.05, 0.7), (0.5, 0.5), (0.01, 0.85), (2.0, 0.6)])
def test_chatter_ends_when_the_bounces_add_up_to(zeta: float, r: float) -> None:
    start = 0.1
    parameters = forced(FORCE, W, zeta, velocity_start=-start)
    with OscillatorFmu({**parameters, **stop(0.0, r)}) as o:
        o.step(7.0)
        found, stuck = o.contact("stick_start", "stuck")
    assert stuck
    assert abs(found - float(exact_accumulation(zeta, r, start))) <= SEQUENCE


@pytest.mark.parametrize("r", [0.0, 1e-12, 0.5, 0.99, 0.999, 0.999999, 1.0])
@pytest.mark.parametrize("zeta", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("position", [-0.3, 0.0, 0.4])
def test_every_restitution_stays_on_its_side_and_comes_to_its_end(
    r: float, zeta: float, position: float
) -> None:
    parameters = forced(FORCE, 0.7, zeta, displacement_start=position - 0.5)
    switches = {"record.extrema": True, "impact_limit": 3_000_000}
    with OscillatorFmu({**parameters, **stop(position, r), **switches}) as o:
        for _ in range(200):
            o.step(0.3)
            assert o.get("displacement") <= position
        assert o.get("record.displacement_max") <= position
        assert o.contact("count")[0] > 5


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("position", "damping"),
    [
        *(pytest.param(position, 0.2, marks=pytest.mark.long) for position in (0.0, 0.3)),
        (0.3, 200.0),  # bounces too short for doubles come before four million low ones
    ],
)
def test_an_elastic_stop_on_a_damped_and_pressed_mass_does_not_bounce_for_ever(
    version: str, position: float, damping: float
) -> None:
    # velocity falls like exp(-2 zeta t / 3), with ever more impacts: the sum has no accumulation point
    parameters = {
        **{"damping": damping, "force": 1.0 + position, "displacement_start": -1.0},
        **stop(position, 1.0),
    }
    with OscillatorFmu(parameters, version=version) as o:
        o.step(1000.0)
        stuck, count, velocity = o.contact("stuck", "count", "last_velocity")
    assert stuck
    assert count < 5_000_000
    assert velocity < 1e-5


@pytest.mark.parametrize("height", [1e-9, 1e-20, 1e-60, 1e-300])
@pytest.mark.parametrize("position", [0.0, 0.3])
def test_elastic_bounces_too_low_to_matter_come_to_rest(height: float, position: float) -> None:
    # undamped, pressed, r = 1: without a rule the bounces go on for ever, 2e-30 s apart
    parameters = {"force": 1.0 + position, "displacement_start": position - height}
    with OscillatorFmu({**parameters, **stop(position, 1.0)}) as o:
        o.step(100.0)
        assert o.get("displacement") >= position - 2.0 * height
        assert o.contact("count")[0] + o.contact("graze_count")[0] < 5_000_000


def test_a_dead_stop_catches_at_the_first_impact_when_pressed() -> None:
    with OscillatorFmu({**forced(FORCE, W, 0.05, displacement_start=-0.1), **stop(0.0, 0.0)}) as o:
        o.step(5.0)
        count, last, start, stuck = o.contact("count", "last_time", "stick_start", "stuck")
    assert count == 1
    assert start == last
    assert stuck


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("start", "slope"),
    [
        ({"force": 1.0}, {"force_rate": -0.25}),
        ({"base_acceleration": -1.0}, {"base_acceleration_rate": 0.25}),
    ],
    ids=["force", "base"],
)
def test_a_ramp_releases_the_mass_when_the_contact_force_has_gone(
    version: str, start: dict[str, float], slope: dict[str, float]
) -> None:
    with OscillatorFmu({**start, **slope, **stop(0.0)}, version=version) as o:
        o.step(3.0)
        assert o.contact("stuck")[0]
        assert abs(o.get("contact[1].force") - 0.25) <= ROUNDING
    with OscillatorFmu({**start, **slope, **stop(0.0)}, version=version) as o:
        o.step(10.0)
        assert abs(o.contact("stick_end")[0] - 4.0) <= ROUNDING * 4.0
        # x'' + x = -(t - 4)/4 from rest at t = 4
        assert abs(o.get("displacement") + 0.25 * (6.0 - math.sin(6.0))) <= 10 * ROUNDING


def test_release_under_harmonic_force_and_moving_base_together_is_at_the_zero_of_their_sum() -> None:
    # contact force: cos(.2 t) + .3 - .1 t on a stop at 0
    parameters = {
        **forced(1.0, 0.2, 0.05),
        "base_acceleration": -0.3,
        "base_acceleration_rate": 0.1,
        **stop(0.0),
    }
    with OscillatorFmu(parameters) as o:
        o.step(10.0)
        end = o.contact("stick_end")[0]
    assert abs(math.cos(0.2 * end) + 0.3 - 0.1 * end) <= ROUNDING


def test_changing_the_force_on_a_resting_mass_holds_it_or_lets_it_go_at_once() -> None:
    with OscillatorFmu({"force": 1.0, **stop(0.0)}) as o:
        o.step(1.0)
        o.set("force", 5.0)
        o.step(1.0)
        assert o.contact("stuck")[0]
        assert o.get("contact[1].force") == 5.0
        o.set("force", -0.5)
        o.step(math.pi)
        assert not o.contact("stuck")[0]
        assert o.contact("stick_end")[0] == 2.0
        assert abs(o.get("displacement") + 1.0) <= ROUNDING
        assert o.contact("count", "graze_count") == [0, 0]


def test_a_mass_lifted_before_its_chatter_has_ended_has_no_stick_in_the_future() -> None:
    # with r near 1 the summed tail lasts long; the force reverses in the middle of it
    parameters = {"stiffness": 0.0, "force": 1.0, "velocity_start": -1.0, "record.impacts": True}
    with OscillatorFmu({**parameters, **stop(0.0, 0.999)}, early_return=True) as o:
        o.advance(1990.0)
        while not o.contact("stuck")[0]:
            o.step(0.01)
            o.set("record.taken", o.get("record.count"))
        now = o.time
        assert o.contact("stick_start")[0] > now
        o.set("force", -1.0)
        o.step(0.01)
        start, end = o.contact("stick_start", "stick_end")
    assert start <= end <= now + SEQUENCE * now


@pytest.mark.parametrize("phase", [0.0, 0.3, 2.0, math.pi / 2, math.pi, 4.0, 3 * math.pi / 2])
def test_a_mass_started_at_rest_on_the_stop_rests_if_pressed_and_leaves_if_not(phase: float) -> None:
    parameters = {**forced(1.0, 0.5, 0.05), "forcing.phase": phase, **stop(0.0)}
    with OscillatorFmu(parameters) as o:
        o.step(1e-3)
        # at 3 pi / 2 the force rises through zero, at pi / 2 it falls: from there on the body is pressed, or free
        pressed = math.cos(phase + 0.25e-3) > 0.0
        assert o.contact("stuck")[0] == pressed
        assert (o.get("displacement") < 0.0) != pressed


def test_a_pressure_that_only_touches_zero_lets_go_and_takes_back() -> None:
    # .5 cos t + .5 on a stop at -.5: zero once in a period, with zero slope
    parameters = {**forced(0.5, 1.0, 0.0, displacement_start=-0.5), **stop(-0.5)}
    with OscillatorFmu(parameters) as o:
        o.step(100 * 2.0 * math.pi + 1.0)
        assert abs(o.get("displacement") + 0.5) <= 1e-12
        assert o.contact("count", "graze_count")[0] < 1000


def test_a_slow_ramp_leads_the_mass_off_the_stop_with_its_equilibrium() -> None:
    for rate in (1e-3, 1e-6, 1e-9, 1e-12, 1e-15):
        with OscillatorFmu({"force": 1.0, "force_rate": -rate, "displacement_start": 1.0, **stop(1.0)}) as o:
            o.step(10.0)
            fallen = rate * (10.0 - math.sin(10.0))
            assert abs(1.0 - o.get("displacement") - fallen) <= 2e-15 + 1e-12 * fallen


@pytest.mark.parametrize("position", [-0.4, 0.0, 0.3])
@pytest.mark.parametrize("w", [0.2, 0.9, 2.0])
def test_the_mirrored_scene_has_the_mirrored_motion_bit_for_bit(position: float, w: float) -> None:
    both = []
    for sign, side in ((1.0, 1), (-1.0, LOWER)):
        parameters = forced(
            sign * 1.1, w, 0.03, displacement_start=sign * (position - 0.2), force=sign * 0.05
        )
        with OscillatorFmu({**parameters, **stop(sign * position, 0.8, side=side)}) as o:
            o.step(120.0)
            x, v = o.state()
            both.append(
                (sign * x, sign * v, *o.contact("count", "graze_count", "last_time", "last_velocity"))
            )
    assert both[0] == both[1]
    assert both[0][2] > 5


@pytest.mark.parametrize("gap", [1e-6, 1e-2, 0.5])
def test_a_driven_mass_between_two_stops_stays_between_them(gap: float) -> None:
    stops = {**stop(gap, 0.9), **stop(-gap, 0.6, side=LOWER, k=2)}
    with OscillatorFmu({**forced(2.0, 0.7, 0.05), **stops, "record.extrema": True}) as o:
        o.step(200.0)
        assert o.get("record.displacement_max") == gap
        assert o.get("record.displacement_min") == -gap
        assert o.contact("count")[0] > 10
        assert o.contact("count", k=2)[0] > 10
