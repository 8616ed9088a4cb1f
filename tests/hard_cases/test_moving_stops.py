"""A ball on a shaken table against 40 digits: chatter on the table, rests, take-offs that graze, and known orbits."""

import math
from itertools import islice

import mpmath as mp
import pytest
from support.component_fmu import ComponentFmu
from support.moving_stops import ball_on_table
from support.shaken_table import DIGITS, Table, events

HALF_TURN = math.pi


@pytest.mark.parametrize("phase", [0.0, 2.1])
@pytest.mark.parametrize(("amplitude", "restitution"), [(1.2, 0.5), (1.01, 0.3), (2.7, 0.6)])
def test_a_ball_that_chatters_rests_and_takes_off_is_the_exact_one(
    amplitude: float, restitution: float, phase: float
) -> None:
    table = Table(amplitude, phase=phase, restitution=restitution)
    start = amplitude * math.cos(phase) + 0.01
    with (
        mp.workdps(DIGITS),
        ball_on_table(amplitude, start, 0.4, phase=phase, restitution=restitution) as fmu,
    ):
        checked = 0
        for event in islice(events(table, start, 0.4), 160):
            late = float(event.time) + 1e-9
            if late > 30.0:  # beyond, chaos has multiplied the rounding
                break
            if event.kind == "rest":
                fmu.step(late - fmu.time)
                assert fmu.get("contact[1].stuck")
                assert fmu.get("contact[1].stick_start") == pytest.approx(float(event.time), abs=1e-13)
            elif event.kind == "take-off":
                fmu.step(late + 0.01 - fmu.time)
                assert not fmu.get("contact[1].stuck")
                assert fmu.get("contact[1].stick_end") == pytest.approx(float(event.time), abs=1e-14)
            elif event.speed > 0.05:
                fmu.step(late - fmu.time)
                assert fmu.get("contact[1].last_time") == pytest.approx(float(event.time), abs=1e-13)
                assert fmu.get("contact[1].last_velocity") == pytest.approx(float(event.speed), abs=1e-13)
                checked += 1
        assert checked >= 3


def cycles(fmu: ComponentFmu, count: int) -> list[float]:
    """Return the speeds of the impacts that end `count` periods of the table."""
    speeds = []
    for _ in range(count):
        fmu.step(2.0 * HALF_TURN)
        speeds.append(fmu.get("contact[1].last_velocity"))
    return speeds


def start_of_cycle(amplitude: float, restitution: float) -> tuple[float, float, float]:
    """Return phase, height and speed of the ball just after the impact of P(1,1), at time 0."""
    rise = HALF_TURN * (1.0 - restitution) / (1.0 + restitution)  # speed of the table at the impact
    phase = -math.asin(rise / amplitude)
    return phase, amplitude * math.cos(phase), HALF_TURN


@pytest.mark.parametrize("amplitude", [1.0473, 1.2, 1.5, 1.5268])
def test_the_cycle_of_one_impact_has_its_speed(amplitude: float) -> None:
    """Flights last a period, so the ball leaves with pi g / w; relative speed 2 pi / (1 + r) = 4.18879 at r = .5."""
    phase, height, speed = start_of_cycle(amplitude, 0.5)
    with ball_on_table(amplitude, height, speed, phase=phase, restitution=0.5) as fmu:
        fmu.step(HALF_TURN)  # between impacts
        assert cycles(fmu, 40)[-1] == pytest.approx(4.0 * HALF_TURN / 3.0, rel=1e-9)


def test_the_cycle_doubles_at_its_known_amplitude() -> None:
    """Stability ends at amplitude^2 = (pi (1 - r) / (1 + r))^2 + (2 (1 + r^2) / (1 + r)^2)^2: 1.526824 at r = .5."""
    edge = math.hypot(HALF_TURN / 3.0, 2.0 * 1.25 / 2.25)
    assert edge == pytest.approx(1.526824, abs=5e-7)
    differences = []
    for amplitude in (edge - 0.01, edge + 0.01):
        phase, height, speed = start_of_cycle(amplitude, 0.5)
        with ball_on_table(amplitude, height, speed + 1e-3, phase=phase, restitution=0.5) as fmu:
            fmu.step(HALF_TURN)
            last = cycles(fmu, 300)[-2:]
            differences.append(abs(last[1] - last[0]))
    assert differences[0] < 1e-5
    assert differences[1] > 0.05
