"""Scenes of chains, beams and compliant stops: reading, messages on mistakes, parameters of their FMUs."""

from __future__ import annotations

import numpy as np
import pytest
from support.scenes import BEAM, CHAIN, YIELDING, changed, problems_of, scene_of, swept

from vibroimpact.analysis.dataset import Outcome, check
from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign.workers.chunks import carried_attributes, carried_state
from vibroimpact.orchestrator.run.dataset import dataset_of
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters, state_variables
from vibroimpact.orchestrator.run.points import independent_points
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody
from vibroimpact.orchestrator.scene.models import KelvinVoigtStop

# Reading.


def test_a_number_in_place_of_an_array_of_a_chain_is_the_same_for_all_elements() -> None:
    each = scene_of(changed(CHAIN, "dampings = 0.1", "dampings = [0.1, 0.1, 0.1]"))
    assert float_parameters(scene_of(CHAIN), None) == float_parameters(each, None)


def test_the_observed_mass_is_that_of_the_first_stop_unless_the_scene_says_another() -> None:
    assert integer_parameters(scene_of(CHAIN))["observed_mass"] == 2
    other = changed(CHAIN, "dampings = 0.1", "dampings = 0.1\nobserved_mass = 1")
    assert integer_parameters(scene_of(other))["observed_mass"] == 1
    free = changed(CHAIN, "[[stop]]\nposition = 0.1\nmass = 2\nrestitution = 0.7\n", "")
    assert integer_parameters(scene_of(free))["observed_mass"] == 3


def test_a_chain_on_a_moving_base_is_driven_by_the_inertia_of_each_mass() -> None:
    text = changed(CHAIN, "amplitude = [0.5, 0.0, 0.1]", 'kind = "base_acceleration"\namplitude = 2.0')
    floats = float_parameters(scene_of(text), None)
    assert [floats[f"forcing.amplitude[{i}]"] for i in (1, 2, 3)] == [-2.0, -4.0, -1.0]


@pytest.mark.parametrize(
    ("boundary", "sensor", "observed", "forced"),
    [
        ("clamped-free", "", 1.0, 1.0),
        ("clamped-free", "[sensor]\nlocation = 0.3\n", 0.3, 1.0),
        ("clamped-clamped", "", 0.8, 0.5),
        ("pinned-pinned", "[sensor]\nlocation = 0.3\n", 0.3, 0.5),
    ],
)
def test_a_beam_is_observed_and_forced_where_it_moves(
    boundary: str, sensor: str, observed: float, forced: float
) -> None:
    text = changed(BEAM, "modes = 3", f'modes = 3\nboundary = "{boundary}"') + sensor
    floats = float_parameters(scene_of(text), None)
    assert (floats["sensor_location"], floats["forcing_location"]) == (observed, forced)


def test_a_beam_of_rigidity_and_mass_per_length_needs_no_section() -> None:
    section = "width = 0.02\nthickness = 0.002\nyoungs_modulus = 70e9\ndensity = 2700\n"
    text = changed(BEAM, section, "flexural_rigidity = 0.9\nmass_per_length = 0.1\n")
    floats = float_parameters(scene_of(text), None)
    assert (floats["flexural_rigidity"], floats["mass_per_length"]) == (0.9, 0.1)
    assert "width" not in floats


@pytest.mark.parametrize(
    ("law", "number", "floats"),
    [
        ("restitution = 0.7\nyield_velocity = 0.1", 1, {"restitution": 0.7, "yield_velocity": 0.1}),
        (YIELDING, 2, {"stiffness": 1e4, "damping": 2.0, "relaxation_time": 0.0}),
        ('law = "hertz"\nstiffness = 1e6', 3, {"stiffness": 1e6}),
        (
            'law = "hunt_crossley"\nstiffness = 1e6\ndamping = 0.3',
            4,
            {"stiffness": 1e6, "damping": 0.3, "exponent": 1.5},
        ),
    ],
)
def test_each_law_tells_the_fmu_its_number_and_its_own_parameters(
    law: str, number: int, floats: dict[str, float]
) -> None:
    scene = scene_of(changed(CHAIN, "restitution = 0.7", law))
    assert integer_parameters(scene)["contact[1].law"] == number
    given = {
        name.removeprefix("contact[1]."): value
        for name, value in float_parameters(scene, None).items()
        if name.startswith("contact[1].")
    }
    assert given == {"position": 0.1, **floats}


def test_two_stops_of_one_side_share_a_place_if_the_nearer_one_yields() -> None:
    bumper = f"[[stop]]\nposition = 0.05\nmass = 2\n{YIELDING}\n"
    assert len(scene_of(CHAIN + bumper).stops) == 2


def test_the_tolerance_of_nonlinear_contacts_is_told_to_the_fmu_where_the_scene_gives_one() -> None:
    text = CHAIN + "[execution]\ncontact_tolerance = 1e-8\n"
    assert float_parameters(scene_of(text), None)["contact_tolerance"] == 1e-8
    assert "contact_tolerance" not in float_parameters(scene_of(CHAIN), None)
    (line,) = problems_of(text.replace("1e-8", "0"))
    assert line.startswith("execution.contact_tolerance: expected 0 < tolerance <= 0.01, got 0.")
    general = (
        '[component.a]\nfmu = "Chain"\n[record]\nrecorded_time = 1.0\n[execution]\ncontact_tolerance = 1e-8\n'
    )
    (line,) = problems_of(general)
    assert line.endswith("Give it to the component: parameters = { contact_tolerance = 1e-8 }.")


def test_a_body_may_start_pressed_into_a_stop_that_yields() -> None:
    text = changed(changed(CHAIN, "position = 0.1", "position = -0.1"), "restitution = 0.7", YIELDING)
    assert isinstance(scene_of(text).stops[0], KelvinVoigtStop)


# Messages on mistakes.


def test_a_stop_of_a_beam_held_at_both_ends_needs_a_location() -> None:
    text = changed(BEAM, "modes = 3", 'modes = 3\nboundary = "clamped-clamped"')
    (line,) = problems_of(changed(text, "location = 0.8\n", ""))
    assert line.startswith("stop[1].location: expected a number between 0 and 1, got nothing. Add location")


def test_stops_on_both_sides_of_one_mass_leave_room_and_those_of_different_masses_need_not() -> None:
    lower = '[[stop]]\nposition = 0.2\nmass = {}\nside = "lower"\nrestitution = 1\n'
    text = changed(CHAIN, "dampings = 0.1", "dampings = 0.1\ndisplacement_start = [0.3, 0.1, 0.0]")
    problems = problems_of(text + lower.format(2))
    assert any(line.startswith("stop[1].position: expected the upper stop[1] above") for line in problems)
    assert len(scene_of(text + lower.format(1)).stops) == 2


def test_chains_and_beams_have_at_most_eight_stops() -> None:
    stops = "".join(f"[[stop]]\nposition = {k}\nlocation = 0.{k}\nrestitution = 1\n" for k in range(1, 9))
    (line,) = problems_of(BEAM + stops)
    assert line == "stop: expected at most 8 stops, got 9. Remove [[stop]] tables."


# Sweeps.


def test_elements_and_scalars_of_every_table_are_swept() -> None:
    scene = scene_of(
        swept(
            changed(CHAIN, "restitution = 0.7", YIELDING),
            '"body.masses[2]" = { values = [2.0, 3.0] }',
            '"body.dampings" = { values = [0.1, 0.2] }',
            '"forcing.amplitude[3]" = { values = [0.1, 0.4] }',
            '"stop[1].stiffness" = { values = [1e4, 1e5] }',
        )
    )
    point = {axis.key: axis.values[1] for axis in scene.sweep}
    floats = float_parameters(scene.at(point), None)
    names = ("mass[2]", "damping[3]", "forcing.amplitude[3]", "contact[1].stiffness", "mass[1]")
    assert [floats[name] for name in names] == [3.0, 0.2, 0.4, 1e5, 1.0]
    assert [scene.sweep_coordinate_name(key) for key in point] == [
        "masses_2",
        "dampings",
        "amplitude_3",
        "stiffness",
    ]
    assert [scene.value(key) for key in point] == [2.0, 0.1, 0.1, 1e4]


def test_a_beam_is_swept_in_length_damping_ratios_and_locations() -> None:
    keys = {
        "body.length": "length",
        "body.damping_ratio[3]": "damping_ratio[3]",
        "forcing.location": "forcing_location",
        "stop[1].location": "contact[1].location",
    }
    scene = scene_of(swept(BEAM, *(f'"{key}" = {{ values = [0.5, 0.7] }}' for key in keys)))
    floats = float_parameters(scene.at(dict.fromkeys(keys, 0.7)), None)
    assert [floats[name] for name in keys.values()] == [0.7] * 4
    one = changed(BEAM, "damping_ratio = [0.01, 0.02, 0.03]\n", "")
    ratio = scene_of(swept(one, '"body.damping_ratio" = { values = [0.1, 0.2] }'))
    assert float_parameters(ratio, None)["damping_ratio[2]"] == 0.1


def test_a_swept_element_of_a_property_may_be_a_path() -> None:
    (axis,) = scene_of(swept(BEAM, '"body.damping_ratio[1]" = { values = [0.1], path = "up" }')).sweep
    assert axis.continuation


def test_a_start_state_of_one_mass_is_no_path() -> None:
    text = changed(CHAIN, "dampings = 0.1", "dampings = 0.1\nvelocity_start = [0, 0, 0]")
    (line,) = problems_of(swept(text, '"body.velocity_start[2]" = { values = [0, 1], path = "up" }'))
    assert line.startswith('sweep."body.velocity_start[2]".path: expected "independent" for a start state')


def test_an_element_that_is_not_there_is_misuse() -> None:
    for key in ("body.masses[4]", "body.masses", "stop[1].stiffness", "sensor.location"):
        with pytest.raises(UsageError, match="expected"):
            scene_of(CHAIN).value(key)
    with pytest.raises(UsageError, match="expected"):
        scene_of(CHAIN).at({"body.masses[4]": 1.0})


# The carried state of a continuation.


def test_the_state_of_a_structure_is_all_its_displacements_then_all_its_velocities() -> None:
    assert state_variables(scene_of(CHAIN)) == (
        *("displacement[1]", "displacement[2]", "displacement[3]"),
        *("velocity[1]", "velocity[2]", "velocity[3]"),
    )
    assert state_variables(scene_of(BEAM))[:2] == ("modal_displacement[1]", "modal_displacement[2]")


def test_a_carried_state_is_the_start_state_at_forcing_phase_zero_bit_for_bit() -> None:
    state = (0.1, 0.05, -0.3, 1.0, -2.0, 3.0)
    floats = float_parameters(
        scene_of(changed(CHAIN, "frequency = 0.9", "frequency = 0.9\nphase = 1.0")), state
    )
    names = [f"{name}_start[{i}]" for name in ("displacement", "velocity") for i in (1, 2, 3)]
    assert tuple(floats[name] for name in names) == state
    assert floats["forcing.phase"] == 0.0


def test_a_stop_that_moved_into_a_chain_moves_its_mass_alone() -> None:
    floats = float_parameters(scene_of(CHAIN), (0.3, 0.4, -0.3, 1.0, -2.0, 3.0))
    names = [f"{name}_start[{i}]" for name in ("displacement", "velocity") for i in (1, 2, 3)]
    carried = [floats[name] for name in names]
    assert carried == pytest.approx([0.3, 0.1, -0.3, 1.0, 0.0, 3.0], abs=1e-13)
    assert carried[1] <= 0.1


def test_a_stop_that_moved_into_a_beam_pushes_it_along_the_mobility_of_the_contact() -> None:
    # reference: the shapes of the modes; the change of each mode is proportional to its shape at the stop
    scene = scene_of(BEAM)
    assert isinstance(scene.body, BeamBody)
    state = (0.01, 0.002, -0.001, 0.3, -0.2, 0.1)
    floats = float_parameters(scene, state)
    q = np.array([floats[f"modal_displacement_start[{j}]"] for j in (1, 2, 3)])
    p = np.array([floats[f"modal_velocity_start[{j}]"] for j in (1, 2, 3)])
    shape = beam_modes("clamped_free", 3).shapes(0.8)[0]
    assert shape @ q == pytest.approx(0.001, rel=1e-11)
    assert shape @ q <= 0.001
    assert shape @ p == pytest.approx(0.0, abs=1e-14)
    for before, after in ((state[:3], q), (state[3:], p)):
        change = (after - np.array(before)) / shape
        assert change == pytest.approx([change[0]] * 3, rel=1e-9)


def test_a_stop_that_yields_is_pressed_in_by_what_it_moved() -> None:
    scene = scene_of(changed(CHAIN, "restitution = 0.7", YIELDING))
    assert isinstance(scene.body, ChainBody)
    floats = float_parameters(scene, (0.3, 0.4, -0.3, 1.0, -2.0, 3.0))
    assert (floats["displacement_start[2]"], floats["velocity_start[2]"]) == (0.4, -2.0)


@pytest.mark.parametrize("state", [(0.1, -0.2), tuple(0.1 * k for k in range(12))])
def test_a_part_keeps_the_carried_state_bit_for_bit(state: tuple[float, ...]) -> None:
    assert carried_state(carried_attributes(state)) == state
    assert carried_state({}) is None


# Datasets.


def test_swept_parameters_of_stops_and_loads_have_the_units_of_their_law() -> None:
    uniform = changed(BEAM, "amplitude = 0.05", 'kind = "uniform"\namplitude = 0.05')
    nonlinear = changed(uniform, "restitution = 0.6", 'law = "hunt_crossley"\nstiffness = 1e6\ndamping = 0.1')
    keys = ("forcing.amplitude", "stop[1].stiffness", "stop[1].damping", "body.density", "stop[1].exponent")
    scene = scene_of(swept(nonlinear, *(f'"{key}" = {{ values = [1.0] }}' for key in keys)))
    record = empty_record(scene, Outcome.error, "", 0.0)
    dataset = dataset_of(scene, independent_points(dict.fromkeys(keys, np.ones(1)), 1), [record], {})
    check(dataset)
    units = {
        name: dataset[name].attrs["units"]
        for name in ("amplitude", "stiffness", "damping", "density", "exponent")
    }
    assert units == {
        "amplitude": "N m-1",
        "stiffness": "1",
        "damping": "s m-1",
        "density": "kg m-3",
        "exponent": "1",
    }
    assert dataset["stiffness"].attrs["long_name"] == "stiffness in N/m^exponent"
    assert dataset["final_state"].shape == (1, 6)
    assert np.isnan(dataset["final_state"].values).all()


def test_a_surface_that_lags_is_refused_where_the_stop_is_an_fmu_of_its_own() -> None:
    scene = f"""
    [body]
    mass = 1.0
    stiffness = 1.0
    [[stop]]
    position = 1.0
    {YIELDING}
    relaxation_time = 0.1
    [record]
    recorded_time = 1.0
    """
    scene_of(scene)
    (line,) = problems_of(scene + '[execution]\nhow = "coupled"\n')
    assert line == (
        'stop[1].relaxation_time: expected a surface that relaxes at once beside how = "coupled", got a time. '
        'Run it fused: how = "fused", or relaxation_time = 0.'
    )
