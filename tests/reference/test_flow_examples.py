"""The exact flow against the fresh examples of equations.md 1.3 to 1.5 and against 40 digits."""

import math

import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, stop
from support.exact_motion import Oscillator as Exact
from support.exact_motion import exact_flow
from support.tolerance import FLOW, ORBIT, PRINTED_14, ROUNDING

from vibroimpact.fmus.core import Oscillator, flow

EXAMPLES = [
    (0.02, 1.7, -1.0494943202638, -0.24039073464596),
    (1.0, 1.7, -0.32305934022499, -0.029706267746771),
    (3.0, 1.7, -0.038369425823789, -0.0021324273936735),
    (0.0, 1.0, -0.31343787805733, -0.46958904702434),
]


@pytest.mark.parametrize(("zeta", "w", "displacement", "velocity"), EXAMPLES)
def test_the_flow_meets_the_printed_examples_in_every_damping_regime(
    zeta: float, w: float, displacement: float, velocity: float
) -> None:
    # F=.8, t0=.4, x0=.2, v0=-.5, u=2.5
    x, v = flow(Oscillator(1.0, 2.0 * zeta, 1.0, 0.8, w), (0.2, -0.5), 2.5, phase=0.4 * w)
    assert abs(x - displacement) <= PRINTED_14
    assert abs(v - velocity) <= PRINTED_14


REGIMES = {
    "undamped": 0.0,
    "light": 0.02,
    "just under critical": 1.0 - 1e-12,
    "critical": 1.0,
    "just over critical": 1.0 + 1e-12,
    "over": 3.0,
    "stiff": 100.0,
    "very stiff": 1e4,
}


@pytest.mark.parametrize("zeta", REGIMES.values(), ids=REGIMES)
@pytest.mark.parametrize("w", [1e-6, 0.3, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.7, 1e3])
@pytest.mark.parametrize("duration", [1e-9, 1e-3, 0.4, 2.5, 6.0])
def test_the_flow_keeps_its_digits_in_every_regime_and_at_resonance(
    zeta: float, w: float, duration: float
) -> None:
    body = (1.0, 2.0 * zeta, 1.0, 0.8, w)
    found = flow(Oscillator(*body), (0.2, -0.5), duration, phase=0.4 * w)
    exact = exact_flow(Exact(*body), (0.2, -0.5), duration, 0.4 * w)
    # the sum has state and force; the forcing's phase w u has its own rounding
    scale = 1.0 + 0.1 * w * duration
    assert abs(float(found[0] - exact[0])) <= FLOW * scale
    assert abs(float(found[1] - exact[1])) <= FLOW * scale


@pytest.mark.parametrize("duration", [0.1, 10.0, 1e3])
def test_exact_undamped_resonance_grows_as_half_force_times_time_times_sine(duration: float) -> None:
    x, v = flow(Oscillator(1.0, 0.0, 1.0, 0.8, 1.0), (0.0, 0.0), duration)
    assert abs(x - 0.4 * duration * math.sin(duration)) <= FLOW * (1.0 + duration**2)
    assert abs(v - 0.4 * (math.sin(duration) + duration * math.cos(duration))) <= FLOW * (1.0 + duration**2)


@pytest.mark.parametrize(
    "body",
    [
        (1.0, 0.0, 0.0, 0.8, 1e-6),
        (2.0, 0.0, 0.0, 0.8, 1.3),
        (1.0, 0.5, 0.0, 0.8, 1.3),
        (1.0, 0.0, 1e-12, 0.8, 1e-6),
        (0.092, 0.6, 100.0, 3.0, 30.0),
    ],
    ids=["free, slow force", "free", "dashpot alone", "hardly a spring", "the rig"],
)
@pytest.mark.parametrize("duration", [1e-3, 1.0, 9.0])
@pytest.mark.parametrize("held", [(0.0, 0.0), (0.7, 0.0), (0.7, -0.2)])
def test_the_flow_keeps_its_digits_without_a_spring_and_under_held_inputs(
    body: tuple[float, ...], duration: float, held: tuple[float, float]
) -> None:
    found = flow(Oscillator(*body), (0.0, 0.0), duration, phase=0.3, held=held[0], held_rate=held[1])
    exact = exact_flow(Exact(*body), (0.0, 0.0), duration, 0.3, *held)
    load = body[3] / body[0] + abs(held[0]) + abs(held[1]) * duration
    reach = min(duration, 1.0 / math.sqrt(body[2] / body[0]) if body[2] else math.inf)
    assert abs(float(found[0] - exact[0])) <= 4 * FLOW * load * reach**2
    assert abs(float(found[1] - exact[1])) <= 4 * FLOW * load * reach


@pytest.mark.parametrize("duration", [20.0, 2500.0, 4e4])
def test_a_stiff_dashpot_creeps_to_the_level_of_its_force(duration: float) -> None:
    zeta = 1e4
    x, v = flow(Oscillator(1.0, 2.0 * zeta, 1.0), (0.0, 0.0), duration, held=1.0)
    exact = exact_flow(Exact(1.0, 2.0 * zeta, 1.0), (0.0, 0.0), duration, held=1.0)
    assert abs(float(x - exact[0])) <= FLOW
    assert abs(float(v - exact[1])) <= FLOW


@pytest.mark.parametrize("version", VERSIONS)
def test_the_peak_of_the_resonance_curve_is_where_and_as_high_as_the_closed_form_says(version: str) -> None:
    # equations.md 1.3: F=.3, zeta=.04: 3.75300 at w=.998399; 3.75 at w=1
    force, zeta = 0.3, 0.04
    w = math.sqrt(1.0 - 2.0 * zeta**2)
    peak = force / (2.0 * zeta * math.sqrt(1.0 - zeta**2))
    assert abs(w - 0.998399) <= 5e-7
    assert abs(peak - 3.75300) <= 5e-6
    for frequency, height in ((w, peak), (1.0, 3.75)):
        with OscillatorFmu(forced(force, frequency, zeta), version=version) as o:
            o.step(200 * 2.0 * math.pi / frequency)
            o.set("record.extrema", True)
            o.step(2.0 * math.pi / frequency)
            assert abs(o.get("record.displacement_max") - height) <= ORBIT * height
            assert abs(o.get("record.displacement_min") + height) <= ORBIT * height


@pytest.mark.parametrize("version", VERSIONS)
def test_acceleration_is_that_of_the_equation_of_motion(version: str) -> None:
    with OscillatorFmu({**forced(0.8, 1.7, 0.02, displacement_start=0.2, velocity_start=-0.5)}) as o:
        o.step(2.5)
        x, v = o.state()
        assert abs(o.get("acceleration") - (0.8 * math.cos(1.7 * 2.5) - 0.04 * v - x)) <= ROUNDING
        assert o.get("energy.kinetic") == 0.5 * v * v
        assert o.get("energy.potential") == 0.5 * x * x


def test_the_rig_of_the_text_has_its_natural_frequency_and_damping_ratio() -> None:
    # equations.md 1.1: m=.092, c=.6, k=100 -> wn = 32.969 rad/s, zeta = .09891: read from a free decay
    with OscillatorFmu({"mass": 0.092, "damping": 0.6, "stiffness": 100.0, "velocity_start": 1.0}) as o:
        wd = 32.969 * math.sqrt(1.0 - 0.09891**2)
        o.step(2.0 * math.pi / wd)
        x, v = o.state()
    assert abs(x) <= 1e-3 / wd
    assert abs(math.log(v) + 0.09891 * 32.969 * 2.0 * math.pi / wd) <= 1e-4


def test_the_contact_acceleration_jumps_by_the_damping_of_the_velocity_jump() -> None:
    # equations.md 1.6: x''+ - x''- = 2 zeta (1 + r) V; an external law shows both sides of the impact
    parameters = {**forced(0.5, 1.0, 0.1), **stop(1.0, 0.7, law=5)}
    with OscillatorFmu(parameters, event_mode=True) as o:
        o.advance_to_event()
        before, velocity = o.get("acceleration"), o.get("velocity")
        o.answer(0.7)
        after = o.get("acceleration")
    assert abs(after - before - 0.2 * 1.7 * velocity) <= ROUNDING
