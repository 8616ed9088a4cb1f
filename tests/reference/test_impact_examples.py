"""Impacts, contact times and landmarks against the fresh examples of equations.md 1.6 to 1.8 and 2.1."""

import math

import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, stop
from support.tolerance import FLOW, ORBIT, PRINTED_14, ROUNDING

from vibroimpact.analysis.landmarks import ImpactOscillator, grazing_frequencies
from vibroimpact.fmus.core import Oscillator, next_contact


@pytest.mark.parametrize("version", VERSIONS)
def test_impulse_and_energy_loss_are_those_of_newtons_law(version: str) -> None:
    # equations.md 1.6: m=.05 kg, r=.8, V=.3 m/s: J=.027 N s, loss .00081 J
    parameters = {"mass": 0.05, "stiffness": 0.0, "velocity_start": 0.3, **stop(0.1, 0.8)}
    with OscillatorFmu(parameters, version=version) as o:
        before = o.get("energy.kinetic")
        o.step(1.0)
        assert abs(o.get("contact[1].impulse") - 0.027) <= ROUNDING
        assert abs(before - o.get("energy.kinetic") - 0.00081) <= ROUNDING
        assert abs(o.get("velocity") + 0.24) <= ROUNDING


def test_an_elastic_stop_raises_the_natural_frequency_by_the_printed_ratio() -> None:
    # equations.md 1.7: a/x_max = .25 -> w_ni/w_n = 1.72285878782861
    parameters = {"displacement_start": -1.0, **stop(0.25, 1.0)}
    with OscillatorFmu({**parameters, "record.impacts": True}, early_return=True) as o:
        o.advance(40.0)
        times = o.rows()[:, 1]
    ratio = 2.0 * math.pi * (len(times) - 1) / (times[-1] - times[0])
    assert abs(ratio - 1.72285878782861) <= PRINTED_14
    assert abs(ratio - math.pi / math.acos(-0.25)) <= ORBIT


def test_the_steady_motion_just_reaches_the_stop_at_the_printed_grazing_frequencies() -> None:
    # equations.md 1.8: F=.3, a=.8, zeta=.04
    found = grazing_frequencies(ImpactOscillator(1.0, 0.08, 1.0, 0.3, 0.8, 0.7))
    for w, printed in zip(found, (0.793989120319545, 1.16755354344638), strict=True):
        assert abs(w - printed) <= PRINTED_14
        assert abs(steady_peak(0.3, w, 0.04) - 0.8) <= 10 * ORBIT


def test_the_grazing_force_of_the_text_just_reaches_the_stop() -> None:
    # equations.md 1.8: F_graze(1.4) = .773209001499459 at a=.8, zeta=.04
    assert abs(steady_peak(0.773209001499459, 1.4, 0.04) - 0.8) <= 10 * ORBIT


def steady_peak(force: float, w: float, zeta: float) -> float:
    with OscillatorFmu(forced(force, w, zeta)) as o:
        o.step(200 * 2.0 * math.pi / w)
        o.set("record.extrema", True)
        o.step(2.0 * math.pi / w)
        return float(o.get("record.displacement_max"))


def test_the_next_contact_of_the_text_is_found_by_core_and_fmu() -> None:
    # equations.md 2.1: zeta=.03, w=1.6, F=.9, a=.4, r=.6, impact at t=.7 with V=.5, 40-digit computation
    time, velocity = 4.7793611823626821, 1.9325431806445353
    body = Oscillator(1.0, 0.06, 1.0, 0.9, 1.6)
    contact = next_contact(body, (0.4, -0.3), 0.4, 10.0, phase=1.6 * 0.7)
    assert contact is not None
    assert abs(0.7 + contact.time - time) <= FLOW
    assert abs(contact.velocity - velocity) <= FLOW
    parameters = forced(0.9, 1.6, 0.03, displacement_start=0.4, velocity_start=-0.3)
    with OscillatorFmu({**parameters, **stop(0.4, 0.6)}, start_time=0.7) as o:
        o.step(4.2)
        found, speed = o.contact("last_time", "last_velocity")
    assert abs(found - time) <= FLOW
    assert abs(speed - velocity) <= FLOW


def test_the_jacobian_of_the_text_comes_out_of_the_flow_to_the_next_impact() -> None:
    # equations.md 4.1, same case: [[.0810496002056, -.221282127392], [.192084286754, .375262107981]]
    def image(time: float, velocity: float) -> tuple[float, float]:
        body = Oscillator(1.0, 0.06, 1.0, 0.9, 1.6)
        contact = next_contact(body, (0.4, -0.6 * velocity), 0.4, 10.0, phase=1.6 * time)
        assert contact is not None
        return time + contact.time, contact.velocity

    h = 1e-5
    columns = []
    for shift in ((h, 0.0), (0.0, h)):
        up, down = image(0.7 + shift[0], 0.5 + shift[1]), image(0.7 - shift[0], 0.5 - shift[1])
        columns.append([(up[i] - down[i]) / (2.0 * h) for i in range(2)])
    printed = [[0.0810496002056, 0.192084286754], [-0.221282127392, 0.375262107981]]
    for column, expected in zip(columns, printed, strict=True):
        for value, exact in zip(column, expected, strict=True):
            assert abs(value - exact) <= 1e-9  # truncation h^2 and rounding 1e-15/h
