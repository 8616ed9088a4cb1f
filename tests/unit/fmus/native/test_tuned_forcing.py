"""Forcing tuned during a motion: phase, motion and time continue. Reference: a body that starts from that state."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.component_fmu import (
    EXTERNAL,
    KELVIN_VOIGT,
    VERSIONS,
    ComponentFmu,
    OscillatorFmu,
    each,
    forced,
    stop,
)
from support.tolerance import SEQUENCE

OSCILLATOR = {**forced(damping_ratio=0.05), **stop(1.0)}
YIELDING = {**forced(damping_ratio=0.05), **stop(0.5, law=KELVIN_VOIGT, stiffness=200.0, damping=1.0)}
CHAIN = {
    "masses": 2,
    **each("damping", [0.1, 0.1]),
    "forcing.amplitude[1]": 0.5,
    "forcing.amplitude[2]": 0.1,
    "forcing.angular_frequency": 0.9,
    **stop(0.3),
    "contact[1].mass_number": 2,
}
BEAM = {
    "modes": 3,
    **each("damping_ratio", [0.02] * 3),
    "forcing.amplitude": 0.6,
    "forcing.angular_frequency": 150.0,
    **stop(0.0006),
}
BASE = {"forcing.base_acceleration": -0.3}
#: Component, parameters, tuned amplitude, time of a radian, displacements and velocities at the start and now.
BODIES = [
    pytest.param(
        "Oscillator", OSCILLATOR, "forcing.amplitude", 1.0, ("displacement", "velocity"), id="rigid"
    ),
    pytest.param(
        "Oscillator", YIELDING, "forcing.amplitude", 1.0, ("displacement", "velocity"), id="yielding"
    ),
    pytest.param(
        "Chain", CHAIN, "forcing.amplitude[1]", 1.0, ("displacement[{}]", "velocity[{}]"), id="chain"
    ),
    pytest.param(
        "Oscillator",
        {**OSCILLATOR, **BASE},
        "forcing.base_acceleration",
        1.0,
        ("displacement", "velocity"),
        id="base",
    ),
    pytest.param(
        "Chain",
        {**CHAIN, **BASE},
        "forcing.base_acceleration",
        1.0,
        ("displacement[{}]", "velocity[{}]"),
        id="chain's base",
    ),
    pytest.param(
        "Beam", BEAM, "forcing.amplitude", 0.007, ("modal_displacement[{}]", "modal_velocity[{}]"), id="beam"
    ),
]


def begin_again(body: ComponentFmu, names: tuple[str, str]) -> dict[str, float]:
    """Return start values for a body of the same kind in the present state of this body."""
    found = {}
    for name in names:
        count = {"Chain": 2, "Beam": 3}.get(body.path.stem, 1)
        for k in range(1, count + 1):
            start = name.replace("displacement", "displacement_start").replace("velocity", "velocity_start")
            found[start.format(k)] = body.get(name.format(k))
    return found


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("component", "parameters", "amplitude", "radian", "names"), BODIES)
def test_a_tuned_body_moves_on_as_one_that_starts_there_at_the_phase_of_then(
    component: str,
    parameters: Mapping[str, float],
    amplitude: str,
    radian: float,
    names: tuple[str, str],
    version: str,
) -> None:
    w, tuned = parameters["forcing.angular_frequency"], 1.07 * parameters["forcing.angular_frequency"]
    at, end = 31.7 * radian, 40.0 * radian
    with ComponentFmu(component, parameters, version=version) as body:
        body.advance(at)
        start = begin_again(body, names)
        body.set(amplitude, 1.3 * parameters[amplitude])
        body.set("forcing.angular_frequency", tuned)
        body.advance(end)
        impacts = body.get("contact[1].count")
        moved = list(begin_again(body, names).values())
        seen = body.contact("last_time", "last_phase", "last_velocity")
    again = {
        **parameters,
        **start,
        amplitude: 1.3 * parameters[amplitude],
        "forcing.angular_frequency": tuned,
        "forcing.phase": (w - tuned) * at,
    }
    with ComponentFmu(component, again, version=version, start_time=at) as other:
        other.advance(end)
        expected = list(begin_again(other, names).values())
        assert 0 < other.get("contact[1].count") < impacts
        assert seen == pytest.approx(other.contact("last_time", "last_phase", "last_velocity"), rel=SEQUENCE)
    assert moved == pytest.approx(expected, rel=SEQUENCE, abs=SEQUENCE * max(map(abs, expected)))


def test_time_and_phase_stay_right_over_thousands_of_frequencies() -> None:
    draw = np.random.default_rng(3)
    phase, time, w = 0.7, 0.0, 1.0
    # only the force acts: the acceleration of a heavy mass at rest shows the force
    parameters = {"stiffness": 0.0, "mass": 1e9, "forcing.amplitude": 1e9, "forcing.phase": phase}
    with OscillatorFmu({**parameters, "forcing.angular_frequency": w}) as body:
        for _ in range(3000):
            size = float(draw.integers(2**10, 2**24)) / 2.0**20  # sums of these numbers are exact
            phase, time = math.remainder(phase + w * size, 2.0 * math.pi), time + size
            body.advance(time)
            assert body.get("acceleration") == pytest.approx(math.cos(phase), abs=1e-11)
            w = float(10.0 ** draw.uniform(-1.0, 1.0))
            body.set("forcing.angular_frequency", w)
            assert body.get("acceleration") == pytest.approx(math.cos(phase), abs=1e-11), "phase goes on"
            assert body.get("time") == pytest.approx(time, rel=1e-15)


def test_a_rest_on_a_stop_ends_where_the_tuned_force_no_longer_presses() -> None:
    parameters = {"forcing.amplitude": 2.0, "damping": 0.2, **stop(0.5, 0.0)}
    with OscillatorFmu({**parameters, "forcing.angular_frequency": 0.05}) as body:
        body.advance(10.0)
        assert body.get("contact[1].stuck")
        assert body.get("contact[1].force") == pytest.approx(2.0 * math.cos(0.5) - 0.5)
        body.set("forcing.amplitude", 1.0)
        assert body.get("contact[1].force") == pytest.approx(math.cos(0.5) - 0.5)
        body.set("forcing.amplitude", 0.1)
        body.step(1e-3)
        assert not body.get("contact[1].stuck")
        assert body.get("velocity") == pytest.approx((0.1 * math.cos(0.5) - 0.5) * 1e-3, rel=1e-3)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_saved_state_knows_the_tuned_forcing(version: str) -> None:
    with OscillatorFmu(OSCILLATOR, version=version) as body:
        body.advance(20.0)
        body.set("forcing.angular_frequency", 1.1)
        saved, at = body.serialized(), body.time
        first = body.advance(60.0).state()
    with OscillatorFmu(OSCILLATOR, version=version) as other:
        other.advance(5.0)
        other.restore(saved)
        other.time = at
        assert other.advance(60.0).state() == first


def test_an_answer_to_a_contact_and_a_tuned_force_come_at_one_event() -> None:
    with OscillatorFmu({**OSCILLATOR, **stop(1.0, law=EXTERNAL)}, event_mode=True) as body:
        body.advance_to_event()
        at, velocity = body.time, body.get("contact[1].velocity")
        body.set("forcing.amplitude", 0.8)
        body.set("forcing.angular_frequency", 0.9)
        body.answer(0.5)
        assert body.get("velocity") == pytest.approx(-0.5 * velocity)
        assert body.get("acceleration") == pytest.approx(
            0.8 * math.cos(at) - 1.0 + 0.1 * 0.5 * velocity, rel=1e-12
        )


MOVING = (
    "forcing.angular_frequency: expected another > 0, with a period that the time can be counted in, got "
)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("component", ["Oscillator", "Chain", "Beam"])
@pytest.mark.parametrize(
    ("frequency", "name", "value", "message"),
    [
        (1.0, "forcing.angular_frequency", 0.0, MOVING + "0"),
        (1.0, "forcing.angular_frequency", -1.0, MOVING + "-1"),
        (1.0, "forcing.angular_frequency", math.nan, MOVING + "nan"),
        (1.0, "forcing.angular_frequency", 1e-310, MOVING + "9.99"),
        (1.0, "forcing.angular_frequency", 1e300, MOVING + "1.0"),
        (1.0, "forcing.amplitude", math.inf, "forcing.amplitude{}: expected a finite number, got inf"),
        (
            0.0,
            "forcing.angular_frequency",
            1.0,
            "expected 0, for the force is constant since the start, got 1",
        ),
    ],
)
def test_a_forcing_that_no_body_can_go_on_with_is_refused(
    component: str, frequency: float, name: str, value: float, message: str, version: str
) -> None:
    index = "[1]" if component == "Chain" else ""
    name = name + index if name.endswith("amplitude") else name
    parameters = {f"forcing.amplitude{index}": 0.5, "forcing.angular_frequency": frequency}
    with ComponentFmu(component, parameters, version=version) as body:
        body.advance(0.7)
        body.set(name, value)
        with pytest.raises(FMICallException):
            body.step(0.1)
        assert message.format(index) in body.messages[-1]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("component", ["Oscillator", "Chain"])
def test_a_base_that_is_no_number_is_refused_at_the_start_and_later(component: str, version: str) -> None:
    message = "forcing.base_acceleration: expected a finite number, got inf"
    with ComponentFmu(component, {"forcing.angular_frequency": 1.0}, version=version) as body:
        body.set("forcing.base_acceleration", math.inf)
        with pytest.raises(FMICallException):
            body.step(0.1)
        assert message in body.messages[-1]
    base = {"forcing.base_acceleration": math.inf}
    with ComponentFmu(component, base, version=version, initialize=False) as body:
        with pytest.raises(FMICallException):
            body.initialize()
        assert message in body.messages[-1]


def test_a_base_shaken_at_a_phase_carries_a_free_mass_along() -> None:
    shaken = {"forcing.base_acceleration": 2.0, "forcing.angular_frequency": 3.0, "forcing.phase": 0.4}
    with OscillatorFmu({**shaken, "stiffness": 0.0, "forcing.amplitude": 0.5}) as body:
        for time in (0.0, 0.3, 1.7, 9.0):
            if time:
                body.advance(time)
            # only the force acts on the mass
            assert body.get("acceleration") == pytest.approx(0.5 * math.cos(3.0 * time + 0.4), abs=1e-14)
            relative = (0.5 - 2.0) * math.cos(3.0 * time + 0.4)
            assert body.get("relative_acceleration") == pytest.approx(relative, abs=1e-14)


def test_a_constant_force_may_change_its_size() -> None:
    with OscillatorFmu({"forcing.amplitude": 0.5, "forcing.phase": 1.0, "damping": 2.0}) as body:
        body.advance(50.0)
        assert body.get("displacement") == pytest.approx(0.5 * math.cos(1.0))
        body.set("forcing.amplitude", 2.0)
        body.advance(100.0)
        assert body.get("displacement") == pytest.approx(2.0 * math.cos(1.0))


def test_the_description_says_what_is_tunable() -> None:
    for component in ("Oscillator", "Chain", "Beam"):
        for version in VERSIONS:
            with ComponentFmu(component, version=version) as body:
                found: Any = {v.name for v in body._variables.values() if v.variability == "tunable"}
            expected = {"forcing.amplitude", "forcing.angular_frequency"}
            expected |= {"forcing.base_acceleration"} if component != "Beam" else set()
            assert {name.partition("[")[0] for name in found} == expected
