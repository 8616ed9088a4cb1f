"""Bodies of other tools, whose force is constant over a step, in contact with compliant stops.

References: energy, closed forms of equations.md 6.9 and 6.10, static equilibrium, and the same run coupled otherwise.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.compliant_parts import LAWS, yielding_stop
from support.coupled_parts import EXCHANGES, VERSIONS, body, part, values
from support.held_parts import foreign_contact, held

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import StopContactSpec

ELASTIC = {"kelvin_voigt": {"stiffness": 1e4}, "hertz": {"stiffness": 1e6}}
ROLLS = {"v": 1.0}
"""A free unit mass that reaches a stop at 1 m after 1 s, at 1 m/s."""


# ---- energy ----


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
@pytest.mark.parametrize("law", ELASTIC)
def test_a_lossless_contact_of_a_foreign_mass_keeps_its_energy_at_thirty_steps(
    tmp_path: Path, law: str, states: bool, version: str
) -> None:
    stop = yielding_stop("s", law, ELASTIC[law], version=version)
    run = held(tmp_path, [stop], ROLLS, states=states, version=version)
    _, velocity = run.motion(2.0)
    assert velocity**2 == pytest.approx(1.0, abs=1e-10)
    assert abs(run.residual()) <= 1e-11
    assert [event.time for event in run.events] == pytest.approx([1.0], abs=1e-12)
    assert 40 <= run.importer.steps <= 60
    run.importer.free()


@given(
    mass=st.floats(1e-3, 1e3),
    speed=st.floats(1e-2, 1e2),
    frequency=st.floats(1e1, 1e4),
    spring=st.sampled_from([0.0, 3.0]),
    steps=st.sampled_from([8.0, 15.0, 30.0]),
)
@settings(max_examples=25, deadline=None)
def test_any_lossless_contact_keeps_the_energy_of_any_mass_that_can_go_back(
    tmp_path_factory: pytest.TempPathFactory,
    mass: float,
    speed: float,
    frequency: float,
    spring: float,
    steps: float,
) -> None:
    # it reaches a stop at a tenth of its way, with a spring of its own or without
    stiffness, own, way = mass * frequency**2, spring * mass, 0.1 * speed
    run = held(
        tmp_path_factory.getbasetemp(),
        [yielding_stop("s", "kelvin_voigt", {"stiffness": stiffness}, way)],
        {"m": mass, "k": own, "v": speed},
        contacts=[foreign_contact(mass=None)],
        macro_step=0.02,
        contact_steps=steps,
    )
    displacement, velocity = run.motion(0.3 + math.pi / frequency)
    pressed = max(0.0, displacement - way)
    energy = mass * velocity**2 + own * displacement**2 + stiffness * pressed**2
    assert energy == pytest.approx(mass * speed**2, rel=1e-8)
    run.importer.free()


@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
def test_a_mass_between_two_stops_of_one_force_input_keeps_its_energy(tmp_path: Path, states: bool) -> None:
    stops = [
        yielding_stop("s", "hertz", ELASTIC["hertz"], 1.0),
        yielding_stop("l", "kelvin_voigt", ELASTIC["kelvin_voigt"], -1.0, "lower"),
    ]
    run = held(tmp_path, stops, ROLLS, states=states, macro_step=0.3)
    _, velocity = run.motion(40.0)
    assert len(run.events) == 20
    assert velocity**2 == pytest.approx(1.0, abs=1e-9)
    run.importer.free()


def test_a_mass_pressed_between_two_stops_at_once_keeps_its_energy(tmp_path: Path) -> None:
    stops = [
        yielding_stop("s", "hertz", ELASTIC["hertz"], -1e-3),
        yielding_stop("l", "hertz", ELASTIC["hertz"], 1e-3, "lower"),
    ]
    run = held(tmp_path, stops, ROLLS)

    def energy(x: float, v: float) -> float:
        return 0.5 * v * v + 0.4e6 * (max(0.0, x + 1e-3) ** 2.5 + max(0.0, 1e-3 - x) ** 2.5)

    assert energy(*run.motion(0.3)) == pytest.approx(energy(0.0, 1.0), rel=1e-8)
    run.importer.free()


@pytest.mark.parametrize("macro_step", [0.05, 0.01])
def test_the_residual_of_a_mass_that_cannot_go_back_is_the_energy_that_it_has_gained(
    tmp_path: Path, macro_step: float
) -> None:
    # with a spring of its own the accelerations in a step are predicted, and the true ones differ
    stop = yielding_stop("s", "hertz", ELASTIC["hertz"], 0.1)
    run = held(tmp_path, [stop], {"v": 2.0, "k": 100.0}, states=False, macro_step=macro_step)
    displacement, velocity = run.motion(2.0)
    gained = 0.5 * (velocity**2 + 100.0 * displacement**2) - 2.0
    assert run.residual() == pytest.approx(gained, rel=1e-3)
    assert 1e-8 < abs(gained) < 1e-4
    run.importer.free()


# ---- laws with losses ----


@pytest.mark.parametrize("ratio", [0.1, 0.75])
def test_a_dashpot_takes_what_its_closed_form_says_to_the_second_order_of_the_step(
    tmp_path: Path, ratio: float
) -> None:
    stop = yielding_stop("s", "kelvin_voigt", {"stiffness": 1e4, "damping": 200.0 * ratio})
    exact = math.exp(-2.0 * ratio * math.acos(ratio) / math.sqrt(1.0 - ratio**2))
    errors = []
    for steps in (15.0, 60.0):
        run = held(tmp_path, [stop], ROLLS, contact_steps=steps)
        errors.append(abs(run.motion(1.5)[1] + exact))
        assert abs(run.residual()) <= 1e-11
        run.importer.free()
    assert errors[0] <= 2e-3
    assert errors[1] <= errors[0] / 12.0


@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
def test_a_mass_put_on_the_surface_is_held_where_the_force_is(tmp_path: Path, states: bool) -> None:
    stop = yielding_stop("s", "kelvin_voigt", {"stiffness": 1e4, "damping": 100.0})
    run = held(tmp_path, [stop], {"x": 1.0, "load": 3.0}, states=states)
    displacement, velocity = run.motion(0.25)  # the free oscillation has decayed to e^-12.5
    assert displacement - 1.0 == pytest.approx(3e-4, rel=1e-5)
    assert abs(velocity) <= 1e-6
    run.importer.free()


# ---- arrivals ----


def test_a_body_that_is_in_and_out_again_within_a_step_is_seen(tmp_path: Path) -> None:
    # thrown up at 1 m/s against gravity: 0.051 m high at 0.102 s, in one step; a stop at 0.05 m
    stop = yielding_stop("s", "kelvin_voigt", {"stiffness": 1e4}, 0.05)
    run = held(tmp_path, [stop], {"v": 1.0, "load": -9.81}, macro_step=0.2)
    displacement, velocity = run.motion(0.2)
    assert len(run.events) == 1
    assert run.events[0].time == pytest.approx((1.0 - math.sqrt(1.0 - 0.981)) / 9.81, abs=1e-12)
    assert 0.5 * velocity**2 + 9.81 * displacement == pytest.approx(0.5, abs=1e-10)
    run.importer.free()


def test_a_lower_stop_is_an_upper_one_in_a_mirror(tmp_path: Path) -> None:
    ends = []
    for sign, side in ((1.0, "upper"), (-1.0, "lower")):
        stop = yielding_stop("s", "hunt_crossley", LAWS["hunt_crossley"], sign, side)
        run = held(tmp_path, [stop], {"v": sign})
        displacement, velocity = run.motion(2.0)
        ends.append((sign * displacement, sign * velocity))
        run.importer.free()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
def test_the_surface_of_a_stop_that_does_not_say_it_is_found_by_asking(tmp_path: Path, states: bool) -> None:
    stop = yielding_stop("s", "hertz", ELASTIC["hertz"])
    contacts = [foreign_contact(side="upper")]
    run = held(tmp_path, [stop], ROLLS, contacts=contacts, states=states)
    _, velocity = run.motion(2.0)
    assert velocity**2 == pytest.approx(1.0, abs=1e-9)
    assert run.events[0].time == pytest.approx(1.0, abs=1e-11)
    run.importer.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_stop_of_another_tool_is_a_stop_too(tmp_path: Path, version: str) -> None:
    stop = part("s", fmu_factory.buffer(tmp_path, version), gap=1.0, c=20.0)
    contact = foreign_contact(
        side="upper", stop_displacement="d", stop_velocity="u", stop_force="push", mass=None
    )
    run = held(tmp_path, [stop], ROLLS, contacts=[contact], version=version, contact_steps=60.0)
    _, velocity = run.motion(1.5)
    ratio = 0.1
    exact = math.exp(-2.0 * ratio * math.acos(ratio) / math.sqrt(1.0 - ratio**2))
    assert velocity == pytest.approx(-exact, rel=1e-4)
    assert run.energy.names == ("s.push -> b.f",)
    assert abs(run.residual()) <= 1e-11
    run.importer.free()


# ---- the mass ----


@pytest.mark.parametrize("scheme", [0, 1, 2], ids=["exact flow", "symplectic Euler", "explicit Euler"])
def test_a_trial_step_finds_the_mass_and_leaves_no_trace(tmp_path: Path, scheme: int) -> None:
    stop = yielding_stop("s", "hertz", ELASTIC["hertz"])
    own = {"m": 3.7, "k": 2.0, "v": 2.0, "scheme": float(scheme), "inner_step": 1e-3}
    ends = []
    for mass in (None, 3.7):
        run = held(tmp_path, [stop], own, contacts=[foreign_contact(mass=mass)])
        ends.append(run.motion(2.0))
        found = run.importer.contacts.held[0].mass
        assert found == pytest.approx(3.7, rel=1e-6)
        run.importer.free()
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


@pytest.mark.parametrize(
    ("force", "got"),
    [
        ("base_acceleration", "an effective mass of -1 kg"),
        ("contact[1].applied_restitution", "one that does not change"),
    ],
)
def test_a_body_whose_velocity_does_not_grow_with_its_force_is_an_error(force: str, got: str) -> None:
    importer = Importer(
        [body("b", {"velocity_start": 1.0}), yielding_stop("s", "hertz", ELASTIC["hertz"], 0.5)],
        contacts=[StopContactSpec("b", "displacement", "velocity", force, "s")],
        macro_step=0.1,
    )
    importer.begin()
    with pytest.raises(ComponentError) as caught:
        importer.advance(2.0)
    assert f"b.velocity: expected a velocity that grows with the force {force}, got {got}" in str(
        caught.value
    )
    importer.free()


def test_a_rigid_stop_has_no_force_for_a_body_that_cannot_go_back(tmp_path: Path) -> None:
    stop = yielding_stop("s", "restitution", {"restitution": 0.7})
    with pytest.raises(
        ComponentError, match=r"b: expected a body that can save its state.*is found by going back"
    ):
        held(tmp_path, [stop], ROLLS, states=False)


# ---- the importer around it ----


def test_the_exchange_makes_no_difference_to_a_contact(tmp_path: Path) -> None:
    ends = []
    for exchange in EXCHANGES:
        stop = yielding_stop("s", "hertz", ELASTIC["hertz"])
        run = held(tmp_path, [stop], {"v": 2.0, "k": 1.0}, exchange=exchange)
        ends.append(run.motion(2.0))
        run.importer.free()
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)
    assert ends[2] == pytest.approx(ends[0], rel=1e-12)


def test_a_run_sampled_in_contact_is_the_run_bit_for_bit(tmp_path: Path) -> None:
    ends = []
    for sampled in (False, True):
        stop = yielding_stop("s", "kelvin_voigt", ELASTIC["kelvin_voigt"])
        run = held(tmp_path, [stop], ROLLS)
        sampler = Sampler(run.importer, [("b", "x"), ("b", "f")], 7919.0)
        run.motion(0.99)
        if sampled:
            sampler.begin(0.99, 1.06)
        ends.append(run.motion(2.0))
        if sampled:
            rows = np.array(sampler.rows)
            inside = rows[:, 1] > 1.0 + 1e-3
            assert np.count_nonzero(inside) > 200
            # a held force is the mean over the step
            np.testing.assert_allclose(rows[inside, 2], -1e4 * (rows[inside, 1] - 1.0), atol=6.0)
        run.importer.free()
    assert ends[0] == ends[1]


def test_a_run_begun_again_is_the_same_run(tmp_path: Path) -> None:
    run = held(tmp_path, [yielding_stop("s", "hertz", ELASTIC["hertz"])], ROLLS)
    first = run.motion(2.0), run.residual()
    run.importer.begin()
    assert (run.motion(2.0), run.residual()) == first
    run.importer.free()


def test_a_body_of_ours_may_be_a_foreign_one(tmp_path: Path) -> None:
    # the body is an FMU of FMI 3.0 with event mode; its spring turns it round after the contact
    start = {"stiffness": 4.0, "velocity_start": 3.0}
    contact = StopContactSpec("b", "displacement", "velocity", "force", "s")
    importer = Importer(
        [body("b", start), yielding_stop("s", "hertz", ELASTIC["hertz"])],
        contacts=[contact],
        macro_step=0.1,
    )
    energy = InterfaceEnergy(importer, [])
    importer.begin()
    energy.begin([])
    importer.advance(7.0)
    displacement, velocity = values(importer, "b", "displacement", "velocity")
    assert velocity**2 + 4.0 * displacement**2 == pytest.approx(9.0, rel=1e-9)
    assert energy.names == ("s.applied_force -> b.force",)
    assert abs(energy.residuals()[0]) <= 1e-9
    importer.free()


def test_a_body_that_starts_pressed_in_takes_the_energy_of_the_spring_with_it(tmp_path: Path) -> None:
    stop = yielding_stop("s", "kelvin_voigt", ELASTIC["kelvin_voigt"])
    run = held(tmp_path, [stop], {"x": 1.01}, macro_step=0.01)
    _, velocity = run.motion(0.1)
    assert velocity == pytest.approx(-1.0, rel=1e-9)  # 1e4 * .01^2 = 1
    assert run.importer.contacts.remarks() == []
    run.importer.free()


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("stall", "expected steps that advance, got 100 without progress at time 0.04"),
        ("error", "fmi3DoStep returned error at time 0.04"),
    ],
)
def test_a_body_that_fails_in_a_contact_says_where(tmp_path: Path, fault: str, said: str) -> None:
    # y of y' = u serves as displacement and velocity at once: pressed from the start
    faulty = part("b", fmu_factory.faulty(tmp_path), fault=fault, fault_time=0.05)
    stop = yielding_stop("s", "kelvin_voigt", {"stiffness": 100.0, "damping": 0.1}, -0.5)
    contact = StopContactSpec("b", "y", "y", "u", "s", 1.0)
    importer = Importer([faulty, stop], contacts=[contact], macro_step=0.01)
    importer.begin()
    with pytest.raises(ComponentError) as caught:
        importer.advance(0.3)
    assert said in str(caught.value)
    importer.free()
