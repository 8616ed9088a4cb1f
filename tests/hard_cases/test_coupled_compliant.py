"""Compliant stops in FMUs of their own, in hard cases: stiff, slow, pressed, stateless, sampled, saved in contact.

References: the closed forms of equations.md 6.9 and 6.10, static equilibrium, and conservation of energy.
"""

from __future__ import annotations

import math
from ctypes import c_void_p
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.compliant_parts import (
    FREE,
    LAWS,
    contact_energy_error,
    coupled,
    follows,
    yielding_contact,
    yielding_stop,
)
from support.coupled_parts import VERSIONS, body, contact, events_of, external, link, part, stop
from support.saved_states import deserialize, serialize

from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.run import named_runner
from vibroimpact.orchestrator.scene import parse_scene

SAME_VERSIONS = [(v, v) for v in VERSIONS]


# ---- scales ----


@pytest.mark.parametrize(("stiffness", "tolerance"), [(1e-2, 1e-12), (1e6, 1e-11), (1e9, 1e-9), (1e15, 1e-6)])
def test_a_spring_of_any_stiffness_gives_the_energy_back(stiffness: float, tolerance: float) -> None:
    # a contact at time 1 that lasts about 1 / w: rounding of its times is 1e-16, so that of energies is about w 1e-16
    run = coupled("kelvin_voigt", {"stiffness": stiffness})
    run.importer.advance(2.0 + math.pi / math.sqrt(stiffness))
    assert abs(run.values("velocity")[0] + 1.0) <= tolerance
    assert abs(run.residual()) <= tolerance
    run.importer.free()


@pytest.mark.parametrize("speed", [1e-9, 1e-6, 1e-3, 1e3])
def test_a_ball_at_any_speed_takes_the_same_number_of_steps(speed: float) -> None:
    start: dict[str, Value] = {"stiffness": 0.0, "displacement_start": 1.0 - speed, "velocity_start": speed}
    run = coupled("hertz", LAWS["hertz"], start)
    run.importer.advance(1.0 + 10.0 * 3.2181 * (1.0 / (1e12 * speed)) ** 0.2)
    assert abs(run.values("velocity")[0] / speed + 1.0) <= 1e-5
    assert 25 <= run.importer.steps <= 45
    run.importer.free()


@pytest.mark.parametrize(("mass", "tolerance"), [(1e-9, 1e-8), (1e9, 1e-11)])
def test_light_and_heavy_masses_are_turned_round(mass: float, tolerance: float) -> None:
    # the light mass goes 3e-7 m into a stop at 1 m; rounding of a displacement, 1e-16, is 3e-10 of the depth per step
    run = coupled("kelvin_voigt", {"stiffness": 1e4}, {**FREE, "mass": mass})
    run.importer.advance(2.0 + 4.0 * math.sqrt(mass / 1e4))
    assert abs(run.values("velocity")[0] + 1.0) <= tolerance
    run.importer.free()


# ---- pressed, grazing, between two stops ----


@pytest.mark.parametrize("versions", SAME_VERSIONS, ids="+".join)
@pytest.mark.parametrize("law", LAWS)
def test_a_mass_put_on_the_surface_at_rest_is_held_where_the_force_is(
    law: str, versions: tuple[str, str]
) -> None:
    start: dict[str, Value] = {
        "displacement_start": 1.0,
        "stiffness": 0.0,
        "damping": 50.0,
        "forcing.amplitude": 3.0,
    }
    run = coupled(law, LAWS[law], start, versions=versions)
    run.importer.advance(1.0)
    displacement, force = run.values("displacement", "contact[1].force")
    depth = 3.0 / 1e4 if law == "kelvin_voigt" else (3.0 / 1e6) ** (2.0 / 3.0)
    assert displacement - 1.0 == pytest.approx(depth, rel=1e-9)
    assert force == pytest.approx(3.0, rel=1e-9)
    run.importer.free()


@pytest.mark.parametrize("law", ["hertz", "hunt_crossley"])
def test_a_stop_at_zero_is_met_within_a_rounding_of_the_flight(law: str) -> None:
    # the contact is at -1e-34 m, less than rounding of its position: the next step would lack its force
    scene = (
        "[body]\nmass = 0.2\nstiffness = 0.5\ndamping = 0.05\ndisplacement_start = -0.02\nvelocity_start = -0.5\n"
        f'[[stop]]\nlaw = "{law}"\nposition = 0.0\nstiffness = 17722.0\n'
        '[[stop]]\nlaw = "hertz"\nposition = -0.05\nside = "lower"\nstiffness = 3366.0\n'
        "[record]\nrecorded_time = 1.05\n"
    )
    fused = final_velocity(scene)
    for macro_step in (0.05626365760272898, 0.0816438, 0.021082):
        coupled_there = final_velocity(f'{scene}[execution]\nhow = "coupled"\nmacro_step = {macro_step!r}\n')
        assert coupled_there == pytest.approx(fused, abs=1e-5)


def final_velocity(text: str) -> float:
    runner = named_runner(parse_scene(text, "scene.toml"), "vibroimpact.orchestrator.run:PointRunner")
    try:
        return runner.run({}).final_velocity
    finally:
        runner.close()


def test_a_mass_on_the_surface_that_is_drawn_away_leaves_at_once() -> None:
    start: dict[str, Value] = {"displacement_start": 1.0, "stiffness": 0.0, "forcing.amplitude": -2.0}
    for law, parameters in LAWS.items():
        run = coupled(law, parameters, start)
        run.importer.advance(3.0)
        assert run.values("displacement")[0] == pytest.approx(1.0 - 9.0, rel=1e-12)
        run.importer.free()


@pytest.mark.parametrize("excess", [-1e-9, 1e-4, 1e-8, 1e-12])
def test_a_peak_over_the_surface_by_next_to_nothing_changes_next_to_nothing(excess: float) -> None:
    # x = (1 + excess) sin t, from its start upwards; a soft stop takes at most the work of the stop's depth
    for law, parameters in LAWS.items():
        run = coupled(law, parameters, {"velocity_start": 1.0 + excess})
        run.importer.advance(math.pi)
        displacement, velocity = run.values("displacement", "velocity")
        energy = 0.5 * (displacement**2 + velocity**2) / (0.5 * (1.0 + excess) ** 2)
        assert 1.0 - 4.0 * max(excess, 1e-12) <= energy <= 1.0 + 1e-12
        run.importer.free()


@pytest.mark.parametrize("versions", SAME_VERSIONS, ids="+".join)
def test_a_mass_between_two_springs_keeps_its_energy_over_a_hundred_contacts(
    versions: tuple[str, str],
) -> None:
    importer = Importer(
        [
            body("b", {**FREE, **follows(1.0), **follows(-1.0, "lower", k=2)}, versions[0]),
            yielding_stop("high", "kelvin_voigt", {"stiffness": 1e4}, 1.0, "upper", versions[1]),
            yielding_stop("low", "kelvin_voigt", {"stiffness": 400.0}, -1.0, "lower", versions[1]),
        ],
        [*yielding_contact("b", "high", 1), *yielding_contact("b", "low", 2)],
    )
    importer.begin()
    cycle = 4.0 + math.pi / 100.0 + math.pi / 20.0
    importer.advance(50.0 * cycle)
    count = importer.components["b"].group("Int64", ["contact[1].count", "contact[2].count"]).get()
    displacement, velocity = importer.components["b"].group("Float64", ["displacement", "velocity"]).get()
    assert list(count) == [50, 50]
    assert (displacement, velocity) == pytest.approx((0.0, 1.0), abs=1e-10)
    importer.free()


def test_a_rigid_stop_and_one_that_yields_meet_the_same_body() -> None:
    importer = Importer(
        [
            body("b", {**FREE, **external(1.0), **follows(-1.0, "lower", k=2)}),
            stop("high", 0.5),
            yielding_stop("low", "kelvin_voigt", LAWS["kelvin_voigt"], -1.0, "lower"),
        ],
        [*contact("b", "high", 1), *yielding_contact("b", "low", 2)],
    )
    importer.begin()
    events = events_of(importer)
    importer.advance(10.0)
    # back from the first at 1/2, and from the second at e/2 (equations.md 6.9, damping ratio .1)
    ratio = 0.1
    e = math.exp(-2.0 * ratio * math.acos(ratio) / math.sqrt(1.0 - ratio * ratio))
    assert importer.components["b"].group("Float64", ["velocity"]).get()[0] == pytest.approx(
        0.5 * e, rel=1e-12
    )
    assert [event.time for event in events] == pytest.approx([1.0, 5.0], rel=1e-13)
    importer.free()


# ---- a foreign stop, without slopes and without states ----


def test_a_contact_that_begins_a_rounding_inside_does_not_let_go_at_once() -> None:
    # at its third touch-down the tip of this beam is 1e-308 m inside the stop
    scene = """
    [body]
    kind = "beam"
    length = 1.0
    mass_per_length = 1.0
    flexural_rigidity = 1.0
    modes = 5
    damping_ratio = 0.02
    velocity_start = [1.0]
    [[stop]]
    position = 0.1
    location = 0.8
    law = "hunt_crossley"
    stiffness = 26175.217073755448
    damping = 2.0
    exponent = 1.0
    [forcing]
    amplitude = 1.0
    phase = 1.0
    angular_frequency = 0.0
    [record]
    recorded_time = 1.8
    """
    coupled_there = final_velocity(f'{scene}[execution]\nhow = "coupled"\nmacro_step = 0.11153293440025046\n')
    assert coupled_there == pytest.approx(final_velocity(scene), abs=1e-4)


def test_a_stateless_spring_is_off_at_its_first_contact_by_the_first_step_alone(tmp_path: Path) -> None:
    # force = 1e4 (x - 1), FMI 2.0, no states: no step can be repeated; the slopes come from the previous step
    steps, w = 30, 100.0
    importer = Importer(
        [body("b", {**FREE, **follows(1.0)}), part("g", fmu_factory.gain(tmp_path), k=w * w, b=-w * w)],
        [link("b.contact[1].displacement", "g.u"), link("g.y", "b.contact[1].applied_force")],
        macro_step=math.pi / w / steps,
    )
    importer.begin()
    importer.advance(1.5)
    velocity = float(importer.components["b"].group("Float64", ["velocity"]).get()[0])
    # a first step h' <= h goes into the stop without force: later the stop returns (w h')^2 / 2 that it never took
    assert 0.0 <= velocity**2 - 1.0 <= (math.pi / steps) ** 2
    importer.free()


# ---- sampled, saved ----


@pytest.mark.parametrize("versions", SAME_VERSIONS, ids="+".join)
@pytest.mark.parametrize("slopes", [True, False])
def test_a_run_sampled_in_contact_is_the_run_bit_for_bit_and_its_samples_lie_on_the_law(
    versions: tuple[str, str], slopes: bool
) -> None:
    ends = []
    for sampled in (False, True):
        run = coupled("kelvin_voigt", {"stiffness": 1e4}, versions=versions, slopes=slopes)
        names = ("contact[1].displacement", "contact[1].force")
        sampler = Sampler(run.importer, [("b", name) for name in names], 7919.0)
        run.importer.advance(0.99)
        if sampled:
            sampler.begin(0.99, 1.06)
        run.importer.advance(2.0)
        ends.append(run.values("displacement", "velocity"))
        if sampled:
            rows = np.array(sampler.rows)
            inside = rows[:, 1] > 1.0 + 1e-3
            assert np.count_nonzero(inside) > 200
            np.testing.assert_allclose(rows[inside, 2], 1e4 * (rows[inside, 1] - 1.0), rtol=1e-9)
            expected = 1.0 + np.sin(100.0 * (rows[inside, 0] - 1.0)) / 100.0
            np.testing.assert_allclose(rows[inside, 1], expected, rtol=0.0, atol=1e-12)
        run.importer.free()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("inside", [True, False], ids=["own law", "law of another FMU"])
def test_a_state_saved_in_the_middle_of_a_contact_goes_on_bit_for_bit(law: str, inside: bool) -> None:
    settings: dict[str, Value] = {**FREE, **follows(1.0)}
    if inside:
        settings |= {"contact[1].law": law} | {f"contact[1].{n}": v for n, v in LAWS[law].items()}
    importer = Importer(
        [body("b", settings), yielding_stop("s", law, LAWS[law])],
        [] if inside else yielding_contact("b", "s"),
    )
    importer.begin()
    importer.advance(1.004)
    owner = importer.components["b"]
    motion = owner.group("Float64", ["displacement", "velocity", "contact[1].force"])
    assert motion.get()[2] > 10.0
    instance, slot = owner.instance, c_void_p()
    assert isinstance(instance, Instance3)
    instance.save(slot)
    ends = []
    for state in (slot, slot, deserialize(instance, serialize(instance, slot))):
        instance.restore(state)
        for i in range(40):
            instance.step(1.004 + i * 1e-3, 1e-3)
        ends.append(tuple(motion.get()))
    assert ends[0] == ends[1] == ends[2]
    assert ends[0][2] == 0.0  # it has separated
    importer.free()


def test_a_run_begun_again_is_the_same_run() -> None:
    run = coupled("hunt_crossley", LAWS["hunt_crossley"], {"velocity_start": 1.7}, slopes=False)
    ends = []
    for _ in range(2):
        run.importer.advance(9.0)
        ends.append(run.values("displacement", "velocity"))
        run.importer.begin()
    assert ends[0] == ends[1]
    run.importer.free()


def test_an_importer_that_is_told_no_steps_at_all_refuses() -> None:
    with pytest.raises(Exception, match="contact_steps: expected a number > 0, got 0"):
        contact_energy_error("kelvin_voigt", {"stiffness": 1e4}, contact_steps=0)
