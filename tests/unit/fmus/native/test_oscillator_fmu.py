"""The Oscillator FMU beyond test_body_fmus.py: its orbit, chatter, and release when answered."""

import math

import pytest
from fmpy.fmi1 import FMICallException
from support.component_fmu import EXTERNAL, LOWER, OscillatorFmu, forced, stop
from support.tolerance import ORBIT, PARTITION, ROUNDING

SCENE = {**forced(), **stop(1.0)}
COUPLED = {**forced(), **stop(1.0, 0.7, law=EXTERNAL)}


def test_stops_without_room_between_them_are_refused() -> None:
    crossed = {**SCENE, **stop(2.0, side=LOWER, k=2), "displacement_start": 1.0}
    with OscillatorFmu(crossed, initialize=False) as o:
        with pytest.raises(FMICallException):
            o.initialize()
        assert len(o.messages) == 1


def test_an_answered_external_law_settles_on_the_orbit_of_the_restitution_law() -> None:
    with OscillatorFmu(COUPLED, event_mode=True) as o:
        for _ in range(60):
            o.advance_to_event()
            o.answer(0.7)
        assert abs(o.get("contact[1].last_phase") - 0.3665212101960540571) <= ORBIT


def test_an_answered_external_law_chatters_sticks_and_is_released() -> None:
    parameters = {**forced(1.0, 0.2, 0.05, displacement_start=-0.1), **stop(0.0, 0.7, law=EXTERNAL)}
    with OscillatorFmu(parameters, event_mode=True) as o:
        events = 0
        while o.time < 20.0:
            o.step(20.0 - o.time)
            if o.needs_event:
                o.fmu.enterEventMode()
                o.answer(0.7)
                events += 1
                assert events < 200
        assert abs(o.get("contact[1].stick_start") - 2.50982609171411) <= 1e-12
        assert abs(o.get("contact[1].stick_end") - 7.853981633974483) <= 1e-12


def test_in_fmi_2_a_contact_is_announced_stepped_back_to_and_answered() -> None:
    with OscillatorFmu(COUPLED, version="2.0") as o, OscillatorFmu(SCENE) as fused:
        for _ in range(30):
            while True:
                saved, before = o.serialized(), o.time
                o.step(0.5)
                event = o.get("contact[1].event_time")
                if not math.isnan(event):
                    break
            with pytest.raises(FMICallException):
                o.step(0.5)  # it has passed through the stop: only a return is valid
            o.restore(saved)
            o.time = before
            if event > before:
                o.step(event - before)
            assert o.get("displacement") == 1.0
            o.set("contact[1].applied_restitution", 0.7)
        fused.step(o.time - 0.5)
        assert abs(fused.get("contact[1].last_time") - o.get("contact[1].last_time")) <= PARTITION
        assert abs(fused.get("contact[1].last_velocity") - o.get("contact[1].last_velocity")) <= PARTITION


def test_the_outputs_follow_an_input_set_between_steps() -> None:
    with OscillatorFmu({"displacement_start": 0.5}) as o:
        assert o.get("acceleration") == -0.5
        o.set("force", 2.0)
        assert o.get("acceleration") == 1.5
        o.set("base_acceleration", 1.0)
        # absolute acceleration: the relative one is 2 - .5 - 1
        assert abs(o.get("acceleration") - 1.5) <= ROUNDING


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_a_step_has_the_damping_of_the_amplitude_that_it_begins_with(slope: float) -> None:
    mass, stiffness, time, ratio = 2.0, 800.0, 0.1, 0.002 + slope
    parameters = {"mass": mass, "stiffness": stiffness, "damping": 0.16, "displacement_start": 1.0}
    with OscillatorFmu({**parameters, "amplitude.damping_slope": slope}) as o:
        o.step(time)
        found = o.get("displacement")
    natural = math.sqrt(stiffness / mass)
    damped = natural * math.sqrt(1.0 - ratio**2)
    swing = math.cos(damped * time) + ratio * natural / damped * math.sin(damped * time)
    assert found == pytest.approx(math.exp(-ratio * natural * time) * swing, abs=ROUNDING)
