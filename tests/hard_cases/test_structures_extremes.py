"""Bodies of many modes at the ends of their ranges: long, stiff, light, resonant, chattering."""

import math

import numpy as np
import pytest
from support.exact_motion import Oscillator, exact_flow, exact_next_contact
from support.reference_bodies import Body, beam, chain, uniform_chain
from support.reference_stops import Forcing
from support.reference_stops import Stop as ReferenceStop
from support.structure import DONE, IMPACT_LIMIT, Modes, Stop, Structure
from support.structure_reference import Reference
from support.tolerance import LONG_PHASE, SEQUENCE

BODIES: dict[str, tuple[Body, np.ndarray]] = {
    "one mass": (uniform_chain(1, 0.0), uniform_chain(1).shapes[-1]),
    "chain of 2": (uniform_chain(2, 0.0), uniform_chain(2).shapes[-1]),
    "odd shape": (Body(np.array([0.618, 1.618]), np.zeros((2, 2))), np.array([0.8, 0.6])),
    "beam of 8": (beam(8), beam(8).shape(1.0)),
}


@pytest.mark.parametrize(
    ("name", "impacts"),
    [
        *(pytest.param(name, 10**6, marks=pytest.mark.long) for name in ("chain of 2", "odd shape")),
        pytest.param("beam of 8", 10**5, marks=pytest.mark.long),
        *(("one mass", 10**5), ("chain of 2", 10**5), ("odd shape", 10**5), ("beam of 8", 10**4)),
    ],
)
def test_elastic_stops_keep_the_energy_of_a_body_over_its_impacts(name: str, impacts: int) -> None:
    body_modes, shape = BODIES[name]
    start = 1.0 / (1.0 + np.arange(body_modes.modes) ** 2)
    with Structure(Modes(body_modes.natural), [Stop(shape, 0.02)], 0.0, start) as body:
        energy = body.energy
        assert body.advance(1e9, most_impacts=impacts) == IMPACT_LIMIT
        # 1e-10 over 10^6 impacts: errors must not all have one sign
        assert abs(body.energy / energy - 1.0) <= 1e-10 * impacts / 1e6


def test_a_mass_pressed_to_a_stop_of_restitution_0999_comes_to_rest_when_its_flights_add_up() -> None:
    # x'' = 1 - x from the stop at 0 with speed V: back after 2 atan(V) with speed V
    r, speed = 0.999, 1.0
    expected, v = 0.0, speed
    for _ in range(60000):
        expected += 2.0 * math.atan(v)
        v *= r
    with Structure(Modes([1.0]), [Stop([1.0], 0.0, restitution=r)], 0.0, -speed) as body:
        assert body.advance(1.01 * expected, held=[1.0]) == DONE
        assert body.statuses == ("held",)
        assert body.advance(1.0, held=[-1.0]) == DONE  # lift it, so that the stick is recorded
        assert body.sticks[0, 1] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("zeta", [0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 3.0, 100.0])
def test_any_damping_meets_the_stop_when_40_digits_do(zeta: float) -> None:
    o = Oscillator(damping=2.0 * zeta, amplitude=1.0, angular_frequency=1.0)
    position = 0.3 / (1.0 + 2.0 * zeta)
    stop = Stop([1.0], position, restitution=0.8)
    with Structure(Modes([1.0], zeta, 1.0, 1.0, -2.0), [stop], -0.2 * position, 0.0) as body:
        body.advance(20.0, most_impacts=1)
        time, velocity = exact_next_contact(o, (-0.2 * position, 0.0), position, -2.0, body.impacts[0, 1])
        assert body.impacts[0, 1] == pytest.approx(float(time), rel=SEQUENCE)
        assert body.impacts[0, 3] == pytest.approx(float(velocity), rel=SEQUENCE)


@pytest.mark.parametrize("detuning", [0.0, 1e-12, -1e-12, 1e-9, -1e-6])
def test_undamped_resonance_grows_as_40_digits_say_until_the_stop(detuning: float) -> None:
    o = Oscillator(amplitude=1.0, angular_frequency=1.0 + detuning)
    modes = Modes([1.0, 3.0], 0.0, [1.0, 0.0], 1.0 + detuning)
    with Structure(modes, [Stop([1.0, 1.0], 10.0)], 0.0, 0.0) as body:
        body.advance(100.0, most_impacts=1)
        time, velocity = exact_next_contact(o, (0.0, 0.0), 10.0, 0.0, body.impacts[0, 1])
        assert body.impacts[0, [1, 3]] == pytest.approx([float(time), float(velocity)], rel=SEQUENCE)


def test_one_step_of_a_million_periods_and_ten_million_periods_of_steps_end_on_the_same_orbit() -> None:
    period = 2.0 * math.pi / 0.7
    modes = Modes([1.0, 3.0], 0.05, [0.3, 0.2], 0.7)
    transient = Structure(modes, [Stop([1.0, 0.5], 5.0)], 1.0, 0.0)
    transient.advance(200.0 * period)
    orbit = transient.displacement
    for step, steps in ((1e6, 1), (1e6, 10)):
        with Structure(modes, [Stop([1.0, 0.5], 5.0)], 1.0, 0.0) as body:
            for _ in range(steps):
                assert body.advance(step * period) == DONE
            # rounding of a time of 10^7 periods moves the phase by 1e-9
            drift = 0.7 * body.time * 2.3e-16
            assert np.abs(body.displacement - orbit).max() <= LONG_PHASE + drift
            assert len(body.impacts) == 0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 40.0, 1e9])
@pytest.mark.parametrize("law", ["restitution", "kelvin_voigt"])
def test_displacements_in_nanometres_or_volts_are_the_same_motion(unit: float, law: str) -> None:
    natural, shape = np.array([1.0, 2.7, 6.1]), np.array([1.0, -0.7, 0.5])
    stop = Stop(shape, 0.1 * unit, law=law, restitution=0.7, stiffness=100.0, damping=1.0)
    modes = Modes(natural, 0.02, np.array([1.0, 0.2, 0.1]) * unit, 1.3)
    with Structure(modes, [stop], 0.0, np.array([1.0, 0.3, 0.2]) * unit) as body:
        assert body.advance(8.0) == DONE
        found = body.displacement / unit, len(body.impacts)
    modes = Modes(natural, 0.02, [1.0, 0.2, 0.1], 1.3)
    stop = Stop(shape, 0.1, law=law, restitution=0.7, stiffness=100.0, damping=1.0)
    with Structure(modes, [stop], 0.0, [1.0, 0.3, 0.2]) as body:
        body.advance(8.0)
        assert found[1] == len(body.impacts)
        assert np.abs(found[0] - body.displacement).max() <= 1e-11


@pytest.mark.parametrize("mass", [1e-9, 1e9])
def test_light_and_heavy_chains_are_the_unit_chain_on_another_clock(mass: float) -> None:
    def impacts(m: float) -> np.ndarray:
        body_modes = chain([m, m], [1.0, 1.0], [0.0, 0.0])
        start = np.linalg.solve(body_modes.shapes, [0.3, -0.2])
        with Structure(
            Modes(body_modes.natural, 0.02), [Stop(body_modes.shapes[1], 0.1, restitution=0.9)], start
        ) as body:
            assert body.advance(30.0 * math.sqrt(m)) == DONE
            return body.impacts[:, [1, 3]] * np.array([1.0 / math.sqrt(m), math.sqrt(m)])

    assert np.abs(impacts(mass) - impacts(1.0)).max() <= 1e-11


def against_reference(
    body_modes: Body, stops: list[tuple[np.ndarray, float, float, int]], forcing: Forcing, end: float
) -> tuple[Structure, Reference]:
    n = body_modes.modes
    coupled = not np.allclose(body_modes.damping, np.diag(np.diag(body_modes.damping)))
    zeta = np.diag(body_modes.damping) / (2.0 * body_modes.natural)
    coupling = body_modes.damping if coupled else None
    modes = Modes(body_modes.natural, zeta, forcing.force, forcing.angular_frequency, forcing.phase, coupling)
    sides = {1: "upper", -1: "lower"}
    body = Structure(modes, [Stop(s, a, restitution=r, side=sides[d]) for s, a, r, d in stops], 0.0, 0.0)
    reference = Reference(
        body_modes,
        [ReferenceStop(s, a, r, d) for s, a, r, d in stops],
        forcing,
        np.zeros(n),
        np.zeros(n),
    )
    assert body.advance(end, most_impacts=5000) == DONE
    return body, reference.advance(end)


@pytest.mark.parametrize("kind", ["classical", "coupled"])
def test_a_chain_that_chatters_sticks_and_is_hit_elsewhere_follows_dop853(kind: str) -> None:
    # mass 3 comes to rest on its stop while mass 1 keeps hitting another: incomplete and complete chatter
    dampings = [0.1, 0.1, 0.1] if kind == "classical" else [0.3, 0.0, 0.05]
    body_modes = chain([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], dampings)
    forcing = Forcing(body_modes.shapes.T @ np.array([0.6, 0.0, 0.9]), 0.25)
    stops = [(body_modes.shapes[2], 0.1, 0.6, 1), (body_modes.shapes[0], -0.2, 0.7, -1)]
    body, reference = against_reference(body_modes, stops, forcing, 45.0)
    assert len(body.sticks) >= 1
    q, p = reference.state(45.0)
    assert np.abs(body.displacement - q).max() <= 1e-7
    assert np.abs(body.velocity - p).max() <= 1e-7
    ended = [s for s in reference.sticks if not math.isnan(s.end)]
    assert len(ended) == len(body.sticks)
    for mine, theirs in zip(body.sticks, ended, strict=True):
        assert mine[1] == pytest.approx(theirs.start, abs=1e-7)
        assert mine[2] == pytest.approx(theirs.end, abs=1e-7)


def test_64_modes_with_stops_at_both_sides_stay_bounded_and_outside_of_them() -> None:
    cantilever = beam(64, damping_ratio=0.01)
    tip, middle = cantilever.shape(1.0), cantilever.shape(0.5)
    stops = [Stop(tip, 0.01, restitution=0.8), Stop(middle, -0.01, side="lower", restitution=0.8)]
    with Structure(Modes(cantilever.natural, 0.01, 3.0 * tip, 3.0), stops, 0.0, 0.0, energies=True) as body:
        for _ in range(60):
            assert body.advance(0.005, most_impacts=5000) == DONE
            size = np.abs(tip * body.displacement).sum()
            assert tip @ body.displacement <= 0.01 + 1e-12 * size
            assert middle @ body.displacement >= -0.01 - 1e-12 * size
            left = body.energy - body.forcing_work + body.damping_loss + body.contact_loss
            assert abs(left) <= 1e-9 * (abs(body.forcing_work) + 1e-3)


def test_a_held_input_that_changes_between_steps_is_the_flow_of_each_piece() -> None:
    o, state, phase = Oscillator(damping=0.1, amplitude=0.5, angular_frequency=0.8), (0.2, 0.1), 0.3
    with Structure(Modes([1.0], 0.05, 0.5, 0.8, phase), [Stop([1.0], 50.0)], *state) as body:
        for load, slope in ((1.0, 0.0), (-2.0, 0.5), (0.3, -0.1)):
            assert body.advance(1.7, held=[load], held_rate=[slope]) == DONE
            end = exact_flow(o, state, 1.7, phase, load, slope)
            state, phase = (float(end[0]), float(end[1])), phase + 0.8 * 1.7
            assert [body.displacement[0], body.velocity[0]] == pytest.approx(state, abs=1e-14)
