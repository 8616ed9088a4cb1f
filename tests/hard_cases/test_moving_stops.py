"""A ball on a shaken table against 40 digits: chatter on the table, rests, take-offs that graze, and known orbits."""

import math
from itertools import islice
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq
from support.component_fmu import ComponentFmu
from support.moving_stops import ball_on_table
from support.shaken_table import DIGITS, Table, events

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene

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


# ---- bodies that a moving stop presses against others ----

ENERGIES = ("kinetic", "potential", "forcing_work", "damping_loss", "contact_loss")


def run(rate: float, tables: dict[str, Any]) -> xr.Dataset:
    """Run a scene for a period, with its energies."""
    record = {
        "time_series": {"rate": rate, "variables": [f"energy.{name}" for name in ENERGIES]},
        "transient_periods": 0,
        "recorded_periods": 1,
    }
    return vi.run(Scene.from_dict({"scene": {"units": "nondimensional"}, "record": record} | tables))


def imbalance(found: xr.Dataset) -> float:
    """Return the largest error of the balance of energies, J."""
    kinetic, potential, work, loss, contact = (found[f"energy_{name}"].values for name in ENERGIES)
    balance = kinetic + potential - work + loss + contact
    return float(np.abs(balance - balance[0]).max())


@pytest.mark.parametrize("restitution", [0.0, 0.9, 1.0])
def test_a_row_of_balls_between_closing_stops_ends_by_name(restitution: float) -> None:
    # once the joint impulses of the three contacts were 1e5 times too large, and the run went on
    balls = [
        {"name": name, "mass": mass, "stiffness": 0.0} for name, mass in (("a", 1.0), ("b", 2.0), ("c", 0.7))
    ]
    pairs = [{"between": list(pair), "clearance": 0.05, "restitution": restitution} for pair in ("ab", "bc")]
    jaws = [
        {"at": "a", "side": "lower", "position": -0.2, "restitution": 0.0, "velocity": 0.1},
        {"at": "c", "side": "upper", "position": 0.3, "restitution": 0.0},
    ]
    tables: dict[str, Any] = {"body": balls, "contact": pairs, "stop": jaws}
    before, after = (
        run(
            20.0,
            tables | {"forcing": [{"at": "a", "amplitude": 0.0, "angular_frequency": 2.0 * math.pi / until}]},
        )
        for until in (5.999, 6.001)
    )
    assert imbalance(before) < 1e-12
    said, _, time = str(after.message.values).partition(
        ": expected room between their stops, of which one moves, got "
    )
    assert said.endswith("stop[1], stop[2], contact[1], contact[2]")
    assert float(time.removeprefix("none at ").partition(" s")[0]) == pytest.approx(6.0, abs=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_a_moving_stop_bears_the_force_of_a_power_law_that_moves_nothing(damping: float) -> None:
    amplitude, w, mass, stiffness, hertz, gap = 0.5, 1.3, 2.0, 1.0, 10.0, 0.1
    law = {"law": "hunt_crossley", "damping": damping} if damping else {"law": "hertz"}
    stops = [
        {"side": "upper", "position": gap, "stiffness": hertz, **law},
        {
            "side": "lower",
            "position": 0.0,
            "restitution": 0.0,
            "motion_amplitude": amplitude,
            "motion_angular_frequency": w,
        },
    ]
    found = run(
        30.0,
        {"body": {"mass": mass, "stiffness": stiffness, "displacement_start": amplitude}, "stop": stops},
    )

    def force(time: float) -> float:
        place, speed = amplitude * math.cos(w * time), -amplitude * w * math.sin(w * time)
        depth = max(0.0, place - gap)
        pressed = hertz * depth**1.5 * (1.0 + damping * speed)
        return pressed + (stiffness - mass * w * w) * place

    release = brentq(force, 0.0, 0.5 * math.pi / w, xtol=1e-15)
    assert float(found.stick_end[0]) == pytest.approx(release, abs=1e-10)
    assert imbalance(found) < 1e-9


@pytest.mark.parametrize("law", [{"law": "hertz"}, {"law": "hunt_crossley", "damping": 0.4}])
def test_the_work_of_a_stop_that_presses_a_body_into_a_power_law(law: dict[str, Any]) -> None:
    # once the series of the force, which moves nothing, went beyond where it converges: a work of 1e39 J
    speed, gap, until = 0.5, 0.05, 3.0
    stops = [
        {"side": "upper", "position": gap, "stiffness": 10.0, **law},
        {"side": "lower", "position": 0.0, "restitution": 0.0, "velocity": speed},
    ]
    none = {"amplitude": 0.0, "angular_frequency": 2.0 * math.pi / until}
    body = {"mass": 2.0, "stiffness": 1.0, "velocity_start": speed}
    found = run(30.0, {"body": body, "stop": stops, "forcing": [none]})
    depth = speed * float(found.time[-1]) - gap
    loss = (1.0 + law.get("damping", 0.0) * speed) * 10.0 * depth**2.5 / 2.5
    assert float(found.energy_forcing_work[-1]) == pytest.approx(loss + 0.5 * (depth + gap) ** 2, rel=1e-9)
    assert imbalance(found) < 1e-9
