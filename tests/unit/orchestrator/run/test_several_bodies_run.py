"""Several bodies run as one structure: the motion of one chain, of components, of stops; momentum and energy."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from fmpy import simulate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.summary import fused_form
from vibroimpact.orchestrator.run.window import in_keys_of
from vibroimpact.orchestrator.scene import Scene

BEFORE_CHAOS = 30
"""Number of impacts of the damper after which chaos parts two forms that differ by rounding."""
TABLES: dict[str, Any] = {
    "body": [
        {"name": "a", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        {
            "name": "b",
            "kind": "chain",
            "masses": [0.5, 0.4],
            "stiffnesses": [1.0, 0.7],
            "dampings": [0.1, 0.07],
        },
    ],
    "link": [{"between": ["a", "b.1"], "stiffness": 0.3, "damping": 0.03}],
    "contact": [{"between": ["a", "b.2"], "restitution": 0.7, "clearance": 0.2}],
    "forcing": {"at": "a", "amplitude": 1.0, "angular_frequency": 1.1},
    "record": {"transient_periods": 20, "recorded_periods": 5},
}


def run(**changes: Any) -> xr.Dataset:
    return vi.run(Scene.from_dict(TABLES | changes))


def example(name: str, **values: Any) -> xr.Dataset:
    return vi.run(Scene.from_file(EXAMPLES / f"{name}.toml").with_values(values))


def assert_same_impacts(ours: xr.Dataset, theirs: xr.Dataset, count: int) -> None:
    assert min(ours.sizes["impact"], theirs.sizes["impact"]) >= count
    for name in ("impact_time", "impact_velocity", "impact_impulse"):
        one, other = ours[name].values[:count], theirs[name].values[:count]
        assert one == pytest.approx(other, abs=1e-9 * np.abs(other).max()), name
    assert ours.impact_contact.values[:count].tolist() == theirs.impact_contact.values[:count].tolist()


def test_a_chain_that_is_split_into_bodies_and_links_meets_its_stop_as_before() -> None:
    masses, stiffnesses, dampings = [1.0, 0.5, 0.8], [2.0, 1.0, 1.5], [0.1, 0.02, 0.2]
    parts = [
        {"name": f"m{i}", "mass": masses[i], "stiffness": 0.0, "displacement_start": 0.1 * i}
        for i in range(3)
    ]
    ends = ["ground", "m0", "m1", "m2"]
    links = [
        {"between": ends[i : i + 2], "stiffness": stiffnesses[i], "damping": dampings[i]} for i in range(3)
    ]
    stop = {"position": 0.6, "restitution": 0.8}
    record = {
        "recorded_periods": 12,
        "time_series": {"rate": 5, "variables": ["displacement", "acceleration"]},
    }
    force = {"amplitude": 1.0, "angular_frequency": 0.9}
    split = Scene.from_dict(
        {
            **{"body": parts, "link": links, "stop": [stop | {"at": "m2"}], "record": record},
            "forcing": force | {"at": "m1"},
        }
    )
    chain = {"kind": "chain", "masses": masses, "stiffnesses": stiffnesses, "dampings": dampings}
    whole = Scene.from_dict(
        {
            **{"body": chain | {"displacement_start": [0.0, 0.1, 0.2]}, "stop": [stop], "record": record},
            "forcing": force | {"amplitude": [0.0, 1.0, 0.0]},
        }
    )
    assert split.body.is_coupled
    ours, theirs = vi.run(split), vi.run(whole)
    assert_same_impacts(ours, theirs, theirs.sizes["impact"])
    for name in ("displacement", "acceleration", "displacement_max", "strobe_velocity"):
        assert ours[name].values == pytest.approx(theirs[name].values, abs=1e-9), name


def test_a_base_that_moves_is_the_inertia_of_all_bodies() -> None:
    chain = {"kind": "chain", "masses": [1.0, 0.5], "stiffnesses": 2.0, "dampings": 0.02}
    record = {
        "recorded_periods": 8,
        "time_series": {"rate": 5, "variables": ["displacement", "acceleration"]},
    }
    common = {
        "forcing": {"kind": "base_acceleration", "amplitude": 0.5, "angular_frequency": 1.1},
        "record": record,
    }
    stop = {"position": 0.3, "restitution": 0.6}
    whole = vi.run(Scene.from_dict({"body": chain, "stop": [stop], **common}))
    still = {"name": "far", "mass": 1.0, "stiffness": 1.0}
    two = {"body": [chain | {"name": "near"}, still], "stop": [stop | {"at": "near"}], **common}
    ours = vi.run(Scene.from_dict(two))
    assert_same_impacts(ours, whole, whole.sizes["impact"])
    assert ours.acceleration.values == pytest.approx(whole.acceleration.values, abs=1e-9)


def test_a_ball_in_a_cavity_moves_as_its_components_until_chaos_parts_them() -> None:
    fused = example("impact_damper_cavity")
    coupled = example("impact_damper_cavity_coupled")
    assert_same_impacts(fused, coupled, BEFORE_CHAOS)


def test_the_cradle_passes_on_each_impact_as_its_components_do() -> None:
    fused = example("newtons_cradle_fused")
    assert_same_impacts(fused, example("newtons_cradle"), 32)
    assert fused.impact_contact.values[:8].tolist() == [1, 2, 3, 4, 4, 3, 2, 1]
    assert fused.impact_velocity.values == pytest.approx(np.full(32, 0.1 * np.sqrt(9.81)), rel=1e-12)


def test_buildings_pound_as_their_components_do_until_they_chatter() -> None:
    fused = example("pounding_fused", **{"record.recorded_periods": 3})
    masses = {"stiff": [30e3, 25e3], "soft": [30e3, 30e3, 25e3]}
    forces = {
        f'component.{name}.parameters."forcing.amplitude[{i}]"': -1.32 * mass
        for name, row in masses.items()
        for i, mass in enumerate(row, start=1)
    }
    assert_same_impacts(fused, example("pounding", **forces, **{"record.recorded_time": 2.0}), 20)


def test_a_contact_with_a_very_heavy_body_is_a_stop() -> None:
    ball = {"name": "ball", "mass": 1.0, "stiffness": 1.0, "velocity_start": 1.0}
    law = {"law": "hunt_crossley", "stiffness": 50.0, "damping": 0.2}
    record = {"recorded_time": 20.0}
    wall = {"name": "wall", "mass": 1e14, "stiffness": 0.0}
    pair = {"body": [ball, wall], "contact": [law | {"between": ["ball", "wall"], "clearance": 0.3}]}
    stop = {
        "body": {key: value for key, value in ball.items() if key != "name"},
        "stop": [law | {"position": 0.3}],
    }
    ours, theirs = (vi.run(Scene.from_dict(each | {"record": record})) for each in (pair, stop))
    assert ours.sizes["impact"] == theirs.sizes["impact"] >= 3
    for name in ("impact_time", "impact_velocity", "impact_peak_force"):
        assert ours[name].values == pytest.approx(theirs[name].values, rel=1e-7), name


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_elastic_free_bodies_keep_their_energy_and_their_momentum(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 5))
    masses, velocities = random.uniform(0.2, 2.0, count), random.uniform(-1.0, 1.0, count)
    names = [f"m{i}" for i in range(count)]
    bodies = [
        {"name": name, "mass": mass, "stiffness": 0.0, "velocity_start": velocity}
        for name, mass, velocity in zip(names, masses.tolist(), velocities.tolist(), strict=True)
    ]
    pairs = list(pairwise(names))
    contacts = [{"between": list(pair), "restitution": 1.0, "clearance": 0.1} for pair in pairs]
    link = {"between": [names[0], names[-1]], "stiffness": float(random.uniform(0.5, 5.0))}
    scene = Scene.from_dict(
        {"body": bodies, "contact": contacts, "link": [link], "record": {"recorded_time": 20.0}}
    )
    found = vi.run(scene)
    assembly = scene.body.assembly
    q, p = found.final_state.values.reshape(2, -1)
    energy = 0.5 * (p @ p + (assembly.frequencies * q) @ (assembly.frequencies * q))
    assert energy == pytest.approx(0.5 * masses @ velocities**2, rel=1e-9)
    assert masses @ (assembly.shapes @ p) == pytest.approx(masses @ velocities, abs=1e-11)
    x = assembly.shapes @ q
    assert all(x[i] - x[i + 1] <= 0.1 + 1e-9 for i in range(count - 1))


def test_restitution_turns_the_relative_velocity_and_keeps_momentum() -> None:
    bodies = [
        {"name": "a", "mass": 2.0, "stiffness": 0.0, "velocity_start": 1.0},
        {"name": "b", "mass": 1.0, "stiffness": 0.0},
    ]
    contact = {"between": ["a", "b"], "restitution": 0.5, "clearance": 0.3}
    scene = Scene.from_dict({"body": bodies, "contact": [contact], "record": {"recorded_time": 1.0}})
    found = vi.run(scene)
    assert found.impact_time.values == pytest.approx([0.3])
    assert found.impact_impulse.values == pytest.approx([1.0])
    velocities = scene.body.assembly.shapes @ found.final_state.values[2:]
    assert velocities == pytest.approx([0.5, 1.0])


@pytest.mark.parametrize("damping", [0.03, 0.2])
@pytest.mark.parametrize(
    "sweep",
    [
        {"forcing.angular_frequency": [1.0, 1.1, 1.2]},
        {"body[1].mass": [0.9, 1.1], "link[1].stiffness": [0.3, 0.4]},
        {"contact[1].clearance": [0.1, 0.3]},
        {"link[1].damping": [0.03, 0.1]},
    ],
)
def test_points_in_lanes_are_those_of_fused_runs(sweep: dict[str, list[float]], damping: float) -> None:
    link = TABLES["link"][0] | {"damping": damping}
    scene = Scene.from_dict(TABLES | {"link": [link]}).with_sweep(sweep)
    assert goes_by_lanes(scene)
    lanes, fused = vi.run(scene), vi.run(scene.with_values({"execution.how": "fused"}))
    assert (lanes.outcome == 0).all()
    assert (lanes.impact_count > 0).all()
    assert lanes.impact_count.equals(fused.impact_count)
    assert lanes.final_state.values == pytest.approx(fused.final_state.values, abs=1e-11)
    assert (
        (lanes.final_state.values != fused.final_state.values).any(axis=-1).all()
    )  # lanes have left no point


@pytest.mark.parametrize("damping", [0.0, 0.002])
def test_a_ball_that_is_free_in_a_cavity_moves_in_lanes_as_in_fused_runs(damping: float) -> None:
    changes = {
        "body[2].damping": damping,
        "body[1].displacement_start": 0.02,
        "body[2].velocity_start": 0.5,
        "record": {"transient_periods": 1, "recorded_periods": 4},
    }
    plain = Scene.from_file(EXAMPLES / "impact_damper_cavity.toml").with_values(changes)
    scene = plain.with_sweep(
        {"contact[1].restitution": [0.6, 0.8, 0.95], "forcing.amplitude": [0.001, 0.002]}
    )
    assert goes_by_lanes(scene)
    lanes, fused = vi.run(scene), vi.run(scene.with_values({"execution.how": "fused"}))
    assert (lanes.impact_count > 4).all()
    assert lanes.impact_count.equals(fused.impact_count)
    for name in ("final_state", "impact_velocity", "displacement_max", "strobe_velocity"):
        assert lanes[name].values == pytest.approx(fused[name].values, abs=1e-9), name
    assert (lanes.final_state.values != fused.final_state.values).any()  # lanes have left no point


def test_a_branch_carries_the_modes_from_point_to_point() -> None:
    axis = {"start": 1.0, "stop": 1.1, "points": 4, "path": "up"}
    scene = Scene.from_dict(TABLES).with_sweep({"forcing.angular_frequency": axis})
    found = vi.run(scene)
    first = vi.run(scene.with_sweep({}).with_values({"forcing.angular_frequency": 1.0}))
    assert found.final_state.values.reshape(4, -1)[0].tolist() == first.final_state.values.tolist()
    assert (found.outcome == 0).all()


@pytest.mark.parametrize("damping", [0.03, 0.2])
def test_the_orbit_of_a_structure_is_the_motion_of_its_run(damping: float) -> None:
    long = {"transient_periods": 300, "recorded_periods": 4}
    scene = Scene.from_dict(TABLES | {"record": long, "link": [TABLES["link"][0] | {"damping": damping}]})
    assert scene.body.is_coupled == (damping == 0.2)
    motion = vi.run(scene)
    stable = [orbit for orbit in vi.find_orbits(scene) if orbit.is_stable]
    velocities = np.sort(np.unique(motion.impact_velocity.values.round(8)))
    assert [np.sort(orbit.velocities).round(8).tolist() for orbit in stable] == [velocities.tolist()]


def test_a_dashpot_between_bodies_leaves_orbits_and_exponents() -> None:
    link = TABLES["link"][0] | {"damping": 0.2}
    long = {"transient_periods": 300, "recorded_periods": 150}
    scene = Scene.from_dict(TABLES | {"link": [link], "record": long})
    (orbit,) = vi.find_orbits(scene, 2, 1)
    assert orbit.is_stable
    # the exponents of a periodic run, per impact, are those of the multipliers
    expected = np.log(np.abs(orbit.multipliers)) / len(orbit.phases)
    assert vi.lyapunov(vi.run(scene)).lyapunov_exponent.values == pytest.approx(expected, abs=1e-7)
    # det of the monodromy: r^2 at each impact, and the trace of the damping in between
    trace = np.trace(scene.body.assembly.damping) * orbit.body.period
    assert expected.sum() == pytest.approx(2.0 * np.log(0.7) - trace / 2.0, abs=1e-10)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"body": [*TABLES["body"], {"name": "c", "mass": 1.0, "stiffness": 0.0, "damping": 0.1}]},
            "body: expected no damping of bodies that no spring",
        ),
        (
            {
                "contact": [
                    {"between": ["a", "b"], "law": "kelvin_voigt", "stiffness": 1.0, "relaxation_time": 1.0}
                ]
            },
            "contact[1].relaxation_time: expected",
        ),
    ],
)
def test_orbits_refuse_by_name_what_they_cannot_follow(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(UsageError) as refused:
        vi.find_orbits(Scene.from_dict(TABLES | changes))
    assert expected in str(refused.value)


def test_a_body_that_nothing_touches_changes_no_orbit() -> None:
    alone = {"body": [*TABLES["body"], {"name": "c", "mass": 1.0, "stiffness": 0.0}]}
    (orbit,) = vi.find_orbits(Scene.from_dict(TABLES | alone))
    (expected,) = vi.find_orbits(Scene.from_dict(TABLES))
    assert orbit.velocities == pytest.approx(expected.velocities, rel=1e-12)


@pytest.mark.parametrize("damping", [0.02, 0.2])
def test_the_orbit_of_a_ball_in_a_cavity_is_the_motion_of_its_run(damping: float) -> None:
    long = {"transient_periods": 600, "recorded_periods": 2}
    bodies = [{"name": "frame", "mass": 1.0, "stiffness": 1.0, "damping": 0.1}]
    bodies += [{"name": "far", "mass": 0.5, "stiffness": 3.0}]
    bodies += [{"name": "ball", "mass": 0.1, "stiffness": 0.0, "velocity_start": 0.4}]
    pairs = ["frame", "ball"], ["ball", "frame"]
    scene = Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": bodies,
            "link": [{"between": ["frame", "far"], "stiffness": 0.3, "damping": damping}],
            "contact": [{"between": each, "restitution": 0.5, "clearance": 0.4} for each in pairs],
            "forcing": {"at": "frame", "amplitude": 0.3, "angular_frequency": 1.4},
            "record": long,
        }
    )
    run = vi.run(scene)
    impacts = run.vibroimpact.impacts()
    (orbit,) = vi.find_orbits(scene)  # one impact a period gives the ball momentum: no P(1,1)
    assert (orbit.name, orbit.is_stable) == ("P(2,1)", True)
    assert np.sort(impacts.impact_velocity.values[:2]) == pytest.approx(np.sort(orbit.velocities), abs=1e-10)
    assert np.sort(impacts.impact_phase.values[:2]) == pytest.approx(orbit.phases, abs=1e-10)
    assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-9)
    period = orbit.phases[0] + np.array([0.0, 2.0 * np.pi])
    assert np.ptp(orbit.at(period)[0]) == pytest.approx(0.0, abs=1e-12)
    recorded = vi.run(scene.with_values({"record": long | {"recorded_periods": 40, "impacts": True}}))
    expected = np.sort(np.log(np.abs(orbit.multipliers)) / 2.0)
    assert np.sort(vi.lyapunov(recorded).lyapunov_exponent.values) == pytest.approx(expected, abs=1e-9)
    assert vi.energies(recorded).identity_error < 1e-12


def test_messages_of_the_engine_have_the_names_of_the_scene() -> None:
    stops = [
        {"at": "a", "position": 1.0, "restitution": 0.5, "velocity": -0.1},
        {"at": "b.1", "side": "lower", "position": -3.0, "restitution": 0.5},
        {"at": "a", "side": "lower", "position": -1.0, "restitution": 0.5},
    ]
    said = str(run(stop=stops, forcing=TABLES["forcing"] | {"amplitude": 0.1}).message.item())
    assert "stop[1], stop[3]: expected room between their stops, of which one moves" in said
    scene = Scene.from_dict(TABLES | {"stop": stops})
    assert in_keys_of(scene, "contact[4].position: expected room between it and contact[3]") == (
        "contact[1].clearance: expected room between it and stop[3]"
    )
    assert in_keys_of(scene, "contact[5].restitution of no contact") == "contact[5].restitution of no contact"


def test_components_that_meet_only_each_other_have_a_fused_form() -> None:
    for name in ("newtons_cradle", "pounding", "impact_damper_cavity_coupled"):
        assert "[[body]]" in fused_form(Scene.from_file(EXAMPLES / f"{name}.toml")), name
    others = ("two_oscillators", "impact_damper_cavity", "coupled_p11")
    assert [fused_form(Scene.from_file(EXAMPLES / f"{name}.toml")) for name in others] == [""] * 3


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_exported_structure_moves_as_its_scene_in_another_tool(fmi: str, tmp_path: Path) -> None:
    series = {"rate": 10, "variables": ["displacement", "contact_displacement[1]"]}
    scene = Scene.from_dict(TABLES | {"record": {"recorded_periods": 6, "time_series": series}})
    ours = vi.run(scene)
    file = export_scene(scene, tmp_path / "structure.fmu", fmi=fmi)
    names = {"displacement": "displacement", "contact[1].displacement": "contact_displacement_1"}
    theirs = simulate_fmu(file, stop_time=float(ours.time[-1]), output_interval=0.1, output=list(names))
    count = min(len(theirs), ours.sizes["sample"])
    assert count > 300
    assert ours.sizes["impact"] > 5
    for name, stored in names.items():
        assert theirs[name][:count] == pytest.approx(ours[stored].values[:count], abs=1e-9), name


def test_a_figure_names_the_lines_by_their_points() -> None:
    series = {"rate": 5, "variables": ["displacement", "contact_displacement[1]"]}
    found = run(record=TABLES["record"] | {"time_series": series})
    assert found.displacement.attrs["long_name"] == "displacement of a"
    legend = vi.draw(found).axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()][:2] == ["a", "a relative to b.2"]
