"""Very stiff, slow, fast, small and large; step sizes, start times and step ends of every kind."""

import math
import random

import numpy as np
import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, stop
from support.exact_motion import Oscillator as Exact
from support.exact_motion import exact_flow, exact_next_contact
from support.tolerance import FLOW, LONG_PHASE, ORBIT, PARTITION, SEQUENCE

from vibroimpact.fmus.core import Oscillator, next_contact
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

PERIOD = 2.0 * math.pi
PHASE = 0.3665212101960540571  # of the P(1,1) motion, see tests/reference


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 5.0, 100.0, 1e4])
@pytest.mark.parametrize("w", [1e-6, 0.7, 1.0 + 1e-9, 1e3])
def test_contacts_are_found_in_every_damping_regime_at_slow_and_fast_forcing(zeta: float, w: float) -> None:
    body = (1.0, 2.0 * zeta, 1.0, 0.8, w)
    state = (0.2, 2.0 + 10.0 * zeta)  # enough to reach .5
    contact = next_contact(Oscillator(*body), state, 0.5, 100.0, phase=0.3)
    assert contact is not None
    time, velocity = exact_next_contact(Exact(*body), state, 0.5, 0.3, contact.time)
    # the error of a time is a displacement's rounding over the velocity
    assert abs(contact.time - float(time)) <= FLOW / float(velocity) + FLOW * contact.time
    assert abs(contact.velocity - float(velocity)) <= FLOW * (10.0 + w) * max(1.0, 2.0 * zeta)
    for part in np.linspace(0.02, 0.98, 25):
        assert exact_flow(Exact(*body), state, part * contact.time, 0.3)[0] < 0.5


def test_a_very_stiff_dashpot_on_a_pressed_mass_reaches_its_stop_and_rests() -> None:
    parameters = {"damping": 2e4, "force": 1.0, **stop(0.5)}
    with OscillatorFmu(parameters) as o:
        o.step(2e4)
        count, start, stuck = o.contact("count", "stick_start", "stuck")
    assert stuck
    assert count >= 1
    # x = 1 - exp(-t / 2e4), to first order in 1 / zeta^2
    assert abs(start - 2e4 * math.log(2.0)) <= 1e-3


SCALES = [1e-9, 1e-3, 1e3, 1e9]


@pytest.mark.parametrize("length", SCALES)
@pytest.mark.parametrize("time", SCALES)
@pytest.mark.parametrize("mass", [1e-9, 1e9])
def test_other_units_give_the_same_motion(length: float, time: float, mass: float) -> None:
    def run(length: float, time: float, mass: float) -> list[float]:
        parameters = {
            "mass": mass,
            "damping": 0.2 * mass / time,
            "stiffness": mass / time**2,
            "forcing.amplitude": 0.5 * mass * length / time**2,
            "forcing.angular_frequency": 1.0 / time,
            **stop(length, 0.7),
        }
        with OscillatorFmu(parameters) as o:
            o.step(40.3 * PERIOD * time)
            x, v = o.state()
            last_time, phase, velocity, impulse, count = o.contact(
                "last_time", "last_phase", "last_velocity", "impulse", "count"
            )
        unit = length / time
        return [x / length, v / unit, last_time / time, phase, velocity / unit, impulse / unit / mass, count]

    for scaled, plain in zip(run(length, time, mass), run(1.0, 1.0, 1.0), strict=True):
        assert abs(scaled - plain) <= LONG_PHASE * max(1.0, abs(plain))


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_chatter_and_sticking_are_the_same_in_other_units(scale: float) -> None:
    parameters = forced(scale, 0.2, 0.05, displacement_start=-0.1 * scale)
    with OscillatorFmu({**parameters, **stop(0.0)}) as o:
        o.step(24.0)
        start, end, time, velocity = o.contact("stick_start", "stick_end", "last_time", "last_velocity")
    # the numbers of issue and thesis sheet, see tests/reference/test_chatter_and_release.py
    assert abs(start - 2.50982609171411) <= SEQUENCE
    assert abs(end - 7.853981633974483) <= SEQUENCE
    assert abs(time - 23.64959897294654) <= 1e-10
    assert abs(velocity / scale - 0.113626292719042) <= 1e-10


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("step", [1e-9, 1e-6, 1e-3])
def test_tiny_steps_lead_where_one_step_leads(version: str, step: float) -> None:
    parameters = {**forced(displacement_start=1.0, velocity_start=0.5 * step * 1000), **stop(1.0)}
    with (
        OscillatorFmu(parameters, version=version) as many,
        OscillatorFmu(parameters, version=version) as one,
    ):
        for _ in range(3000):
            many.step(step)
        one.step(many.time)
        assert many.contact("count") == one.contact("count")
        for found, expected in zip(many.state(), one.state(), strict=True):
            assert abs(found - expected) <= PARTITION


@pytest.mark.parametrize("version", VERSIONS)
def test_one_step_of_a_million_periods_ends_where_the_first_hundred_ended(version: str) -> None:
    with OscillatorFmu({**forced(), **stop(1.0)}, version=version) as o:
        o.step(1e6 * PERIOD)
        assert abs(o.contact("last_phase")[0] - PHASE) <= LONG_PHASE


def test_one_step_of_a_million_periods_of_free_flight_decays_to_the_steady_motion() -> None:
    with OscillatorFmu({**forced(0.3, 1.0, 0.1, displacement_start=0.5), **stop(10.0)}) as o:
        o.step(1e6 * PERIOD)
        x, v = o.state()
    # at phase 0 (to 1e-10: the time of a double at 6e6 s) the steady motion at w=1 is gamma sin t, gamma = 1.5
    assert abs(x) <= 1e-8
    assert abs(v - 1.5) <= ORBIT * 10


@pytest.mark.parametrize("start", [-1e9, -1e6, -0.3, 0.0, 1e-9, 12.5, 1e6, 1e9])
def test_the_orbit_has_its_phase_at_every_start_time(start: float) -> None:
    with OscillatorFmu({**forced(), **stop(1.0)}, start_time=start) as o:
        o.step(100 * PERIOD)
        phase, time, count = o.contact("last_phase", "last_time", "count")
    assert abs(phase - PHASE) <= ORBIT
    assert start < time <= start + 100 * PERIOD
    assert count >= 95


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("seed", range(6))
def test_random_steps_lead_along_the_orbit_of_one_step(version: str, seed: int) -> None:
    chance = random.Random(seed)
    parameters = {**forced(0.5, chance.uniform(0.5, 0.65), 0.1), **stop(0.4, 0.6)}
    end = 60.0
    with (
        OscillatorFmu(parameters, version=version) as many,
        OscillatorFmu(parameters, version=version) as one,
    ):
        while many.time < end - 1e-9:
            many.step(min(end - many.time, 10.0 ** chance.uniform(-6.0, 0.7)))
        one.step(end)
        assert many.contact("count") == one.contact("count")
        assert abs(many.contact("last_time")[0] - one.contact("last_time")[0]) <= 10 * PARTITION
        for found, expected in zip(many.state(), one.state(), strict=True):
            assert abs(found - expected) <= 10 * PARTITION


@pytest.mark.parametrize("shift", [-1e-9, -1e-13, -1e-15, 0.0, 1e-15, 1e-13, 1e-9])
def test_a_step_that_ends_at_an_impact_meets_it_once(shift: float) -> None:
    parameters = {**forced(), **stop(1.0)}
    with OscillatorFmu(parameters) as o:
        o.step(30.0)
        time, count = o.contact("last_time", "count")
    with OscillatorFmu(parameters) as o:
        o.step(time + shift)
        first = o.contact("count")[0]
        o.step(30.0 - o.time)
        assert first in (count - 1, count)
        assert o.contact("count")[0] == count
        assert abs(o.contact("last_time")[0] - time) <= ORBIT


@pytest.mark.parametrize("restitution", [1.0, 0.8])
def test_an_impact_at_the_very_end_of_a_forcing_period_loses_no_row_of_periods(restitution: float) -> None:
    # zeta=0, r=1, w=1.5, stop .3: the symmetric P(1,1) hits at forcing phase 0 exactly
    w, force, position = 1.5, 0.5, 0.3
    shape = position - force / (1.0 - w * w)
    speed = abs(shape * math.tan(math.pi / w))
    parameters = forced(force, w, 0.0, displacement_start=position, velocity_start=-speed)
    switches = {"record.periods": True, "record.extrema": True}
    with OscillatorFmu({**parameters, **stop(position, restitution), **switches}, early_return=True) as o:
        o.advance(300 * PERIOD / w + 1e-3)
        rows = o.rows()
    assert len(rows) == 300
    assert np.abs(np.diff(rows[:, 1]) - PERIOD / w).max() <= 1e-12
    if restitution == 1.0:
        assert set(rows[5:, 6]) == {1.0}


def test_an_importer_that_never_empties_the_record_still_comes_to_the_end() -> None:
    parameters = {**forced(), **stop(1.0), "record.impacts": True}
    with OscillatorFmu(parameters, early_return=True) as o:
        steps = 0
        while o.time < 5000.0:
            o.step(5000.0 - o.time)
            steps += 1
            assert steps < 10
        assert o.get("record.count") + o.get("record.dropped") == o.contact("count")[0]


UNDER_TWO_SINES = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping = 0.2
[[forcing]]
amplitude = 0.5
angular_frequency = 1.0
[[forcing]]
amplitude = 1e-12
angular_frequency = {frequency!r}
[[stop]]
position = 1.0
restitution = 0.7
[record]
impacts = true
transient_periods = 300
recorded_periods = 5
"""


@pytest.mark.parametrize("frequency", [0.3, 2.0, 7.5, 300.0, 1e5])
def test_a_weak_sine_of_any_frequency_leaves_an_orbit_where_it_is(frequency: float) -> None:
    text = UNDER_TWO_SINES.format(frequency=frequency)
    impacts = PointRunner(parse_scene(text, "two_sines.toml")).run({}).impacts
    assert impacts is not None
    assert len(impacts) >= 5
    phases = np.remainder(impacts[:, 0], PERIOD)
    assert np.abs(phases - PHASE).max() <= 1e-10
