"""Bodies without a spring, with impacts in closed form: a ball that falls, a ball between walls."""

import math

import numpy as np
import pytest
from support.component_fmu import LOWER, VERSIONS, OscillatorFmu, stop
from support.tolerance import ROUNDING, SEQUENCE

from vibroimpact import Scene, run

GRAVITY = 2.0
FALL = {"stiffness": 0.0, "forcing.amplitude": -GRAVITY}


def ball(height: float, floor: float, restitution: float) -> dict[str, float]:
    return {**FALL, "displacement_start": floor + height, **stop(floor, restitution, side=LOWER)}


@pytest.mark.parametrize("floor", [-1e3, -0.3, 0.0, 0.7, 1e3])
@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.7, 0.9, 0.99])
def test_a_falling_ball_meets_every_bounce_and_comes_to_rest_on_time(
    floor: float, restitution: float
) -> None:
    height, r = 1.0, restitution
    first = math.sqrt(2.0 * height / GRAVITY)
    speed = GRAVITY * first
    with OscillatorFmu({**ball(height, floor, r), "record.impacts": True}, early_return=True) as o:
        rows = []
        for end in np.linspace(0.5, 1.2 * first * (1.0 + 2.0 * r / (1.0 - r)), 9):
            o.advance(end)
            rows.append(o.rows())
        rows = np.concatenate(rows)
        start, stuck, force = (
            o.get("contact[1].stick_start"),
            o.contact("stuck")[0],
            o.get("contact[1].force"),
        )
        impulse = o.get("contact[1].total_impulse")
    impacts = rows[rows[:, 0] == 1.0]
    n = np.arange(len(impacts))
    times = first + 2.0 * first * r * (1.0 - r**n) / (1.0 - r)
    # the position of a distant floor has fewer digits
    scale = (1.0 + abs(floor)) * (1.0 + times[-1])
    assert np.abs(impacts[:, 1] - times).max() <= SEQUENCE * scale
    assert np.abs(impacts[:, 3] - speed * r**n).max() <= SEQUENCE * scale
    assert abs(start - first * (1.0 + r) / (1.0 - r)) <= SEQUENCE * scale
    assert stuck
    assert force == GRAVITY
    # momentum: the speed of the first impact, and gravity until the rest; the summed tail has 1e-4 of it
    assert impulse == pytest.approx(speed * (1.0 + r) / (1.0 - r), rel=SEQUENCE * scale)
    assert len(impacts) >= math.log(1e-3) / math.log(r)


@pytest.mark.parametrize("slow", [1e-6, 1e-9])
def test_slowly_varying_gravity_is_gravity(slow: float) -> None:
    # a force cos(slow t), flights of a second: the steady response is 1e12 times as high as the bounce
    parameters = ball(1.0, 0.0, 0.9)
    parameters["forcing.angular_frequency"] = slow
    with OscillatorFmu(parameters) as o, OscillatorFmu(ball(1.0, 0.0, 0.9)) as constant:
        o.step(40.0)
        constant.step(40.0)
        assert o.contact("count") == constant.contact("count")
        # gravity is smaller by (slow t)^2 / 2
        assert (
            abs(o.contact("stick_start")[0] - constant.contact("stick_start")[0])
            <= 20 * (20 * slow) ** 2 + SEQUENCE
        )


@pytest.mark.parametrize("gap", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("restitution", [1.0, 0.9])
def test_a_free_mass_between_two_walls_meets_them_in_turn(gap: float, restitution: float) -> None:
    speed = 0.5 * gap
    parameters = {"stiffness": 0.0, "displacement_start": 0.3 * gap, "velocity_start": speed}
    walls = {**stop(gap, restitution), **stop(0.0, restitution, side=LOWER, k=2)}
    with OscillatorFmu({**parameters, **walls, "record.impacts": True}, early_return=True) as o:
        o.advance(60.0)
        rows = o.rows()
    n = np.arange(len(rows))
    lost = (
        (restitution ** -(n + 1.0) - restitution**-1.0) / (1.0 / restitution - 1.0)
        if restitution < 1.0
        else n
    )
    times = (0.7 * gap + gap * lost) / speed
    assert np.abs(rows[:, 1] / times - 1.0).max() <= SEQUENCE
    assert np.all(rows[:, 5] == 1.0 + n % 2)
    assert np.abs(rows[:, 3] / (speed * restitution**n) - 1.0).max() <= SEQUENCE
    assert len(rows) > 10


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("step", [0.25, 0.5, 1.0, 2.0])
def test_an_impact_at_a_communication_point_is_resolved_once(version: str, step: float) -> None:
    # gravity 2 and height 1: the impacts are at t = 1, 3, 5, ... exactly; elastic
    with OscillatorFmu(ball(1.0, 0.0, 1.0), version=version) as o:
        for i in range(1, int(10.0 / step) + 1):
            o.step(step)
            time = i * step
            count = o.contact("count")[0]
            assert count == math.floor((time + 1.0) / 2.0) or (
                time % 2.0 == 1.0 and count == (time - 1.0) / 2.0
            )
        o.step(0.5)
        assert o.contact("count")[0] == 5
        assert abs(o.contact("last_time")[0] - 9.0) <= ROUNDING * 9.0
        assert abs(o.get("displacement") - (1.0 - 0.5**2)) <= 10 * ROUNDING


def test_an_impact_at_the_very_first_and_the_very_last_instant_counts() -> None:
    parameters = {"stiffness": 0.0, "velocity_start": -1.0, **stop(0.0, 0.5, side=LOWER)}
    with OscillatorFmu(parameters) as o:
        o.step(1.0)
        assert o.contact("count")[0] == 1
        assert o.contact("last_time")[0] == 0.0
        assert o.get("displacement") == 0.5
    with OscillatorFmu({**parameters, "displacement_start": 1.0}) as o:
        o.step(1.0)
        o.step(1.0)
        assert o.contact("count")[0] == 1
        assert o.contact("last_time")[0] == 1.0
        assert o.get("displacement") == 0.5


def test_a_mass_that_starts_on_a_stop_and_leaves_it_meets_nothing() -> None:
    with OscillatorFmu({"stiffness": 0.0, "velocity_start": 1.0, **stop(0.0, 0.5, side=LOWER)}) as o:
        o.step(3.0)
        assert o.contact("count", "graze_count") == [0, 0]
        assert o.get("displacement") == 3.0


@pytest.mark.parametrize("roundings", [0, 1, 2, 64])
def test_a_peak_over_the_stop_by_no_more_than_rounding_is_a_graze(roundings: int) -> None:
    parameters = {"velocity_start": 1.0 + roundings * np.finfo(float).eps}
    with OscillatorFmu({**parameters, **stop(1.0, 0.5)}) as o:
        o.step(3.0)
        assert o.contact("count", "graze_count") == ([1, 0] if roundings == 64 else [0, 1])


@pytest.mark.parametrize("k", [3.0, 7.0, 0.7, 1.3])
@pytest.mark.parametrize("position", [0.3, 0.1, 0.7, -0.3])
def test_a_dead_stop_at_the_equilibrium_holds_the_mass_without_pressing_it(k: float, position: float) -> None:
    # neither pressed nor lifted: without a rule this is an endless loop of contacts without rebound
    parameters = {"mass": 1.1, "damping": 0.1, "stiffness": k, "force": k * position}
    with OscillatorFmu({**parameters, "displacement_start": position - 1.0, **stop(position, 0.0)}) as o:
        o.step(100.0)
        count, grazes = o.contact("count", "graze_count")
        assert count == 1
        assert grazes <= 2
        assert abs(o.get("displacement") - position) <= ROUNDING


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-10])
def test_contact_tolerance_bounds_the_speed_after_one_contact_and_errors_add_up(tolerance: float) -> None:
    scene = Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 0.0, "displacement_start": -1.0},
            "forcing": {"amplitude": 1.0, "angular_frequency": 0.0},
            "stop": [{"position": 0.0, "law": "hertz", "stiffness": 1e4}],
            "record": {"recorded_time": 41.0},
            "execution": {"contact_tolerance": tolerance, "how": "fused"},
        }
    )
    # energy is conserved: each touch-down has the speed of the first
    speeds = run(scene, progress=False).impact_velocity.values
    assert speeds[0] == pytest.approx(math.sqrt(2.0), rel=ROUNDING)
    assert len(speeds) == 14
    errors = np.abs(speeds / math.sqrt(2.0) - 1.0) / tolerance
    assert 0.5 < errors[1] < 2.5
    assert 14.0 < errors[-1] < 30.0
