"""Several bodies where decisions are hardest: no room, extreme masses and springs, all modes and contacts in use."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.cut_recordings import in_one_run
from support.drawn_structures import ENERGIES

import vibroimpact as vi
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.scene import Scene

MOST_BODIES = 33
"""Free masses in a row with the 32 contacts between them."""
SERIES = {"rate": 10.0, "variables": [f"energy.{name}" for name in ENERGIES]}


def oscillator(name: str, mass: float = 1.0, stiffness: float = 0.0, **further: float) -> dict[str, Any]:
    return {"name": name, "mass": mass, "stiffness": stiffness, **further}


def run(bodies: list[dict[str, Any]], contacts: list[dict[str, Any]], **tables: Any) -> xr.Dataset:
    record = {"recorded_time": 20.0, "time_series": SERIES}
    return vi.run(Scene.from_dict({"body": bodies, "contact": contacts, "record": record} | tables))


def energy_error(found: xr.Dataset) -> float:
    kinetic, potential, work, loss, contact = (found[f"energy_{name}"].values for name in ENERGIES)
    energy = kinetic + potential
    balance = energy - energy[0] - work + loss + contact
    return float(np.abs(balance).max() / energy.max())


def test_a_row_of_bodies_with_all_contacts_passes_on_each_impact() -> None:
    names = [f"m{i}" for i in range(MOST_BODIES)]
    bodies = [oscillator(name, velocity_start=float(name == "m0")) for name in names]
    contacts = [{"between": list(pair), "restitution": 1.0, "clearance": 0.5} for pair in pairwise(names)]
    found = run(bodies, contacts)
    assert found.impact_contact.values.tolist() == list(range(1, MOST_BODIES))
    assert found.impact_time.values == pytest.approx(0.5 * np.arange(1, MOST_BODIES), rel=1e-13)
    assert energy_error(found) < 1e-13


@pytest.mark.parametrize("room", [1e-3, 1e-6, 1e-9])
def test_a_ball_in_a_narrow_cavity_moves_with_its_frame(room: float) -> None:
    """A dead ball with little room is a mass on the frame, within the room."""
    bodies = [oscillator("frame", 1.0, 1.0, velocity_start=1.0), oscillator("ball", 0.5, velocity_start=1.0)]
    cavity = [
        {"between": between, "restitution": 0.0, "clearance": room}
        for between in (["frame", "ball"], ["ball", "frame"])
    ]
    record = {"recorded_time": 3.0, "time_series": {"rate": 20.0}, "observed": ["frame", ["ball", "frame"]]}
    found = run(bodies, cavity, record=record)
    one = np.sqrt(1.0 / 1.5)
    assert found.displacement_frame.values == pytest.approx(
        np.sin(one * found.time.values) / one, abs=4.0 * room + 1e-12
    )
    assert np.abs(found.displacement_ball_frame.values).max() <= room + 1e-14


@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 1e6, 1e12])
def test_masses_far_apart_keep_their_energy(ratio: float) -> None:
    bodies = [oscillator("light", ratio, velocity_start=1.0), oscillator("heavy", 1.0)]
    contacts = [{"between": ["light", "heavy"], "restitution": 1.0, "clearance": 0.1}]
    found = run(bodies, contacts)
    assert found.impact_time.values == pytest.approx([0.1], rel=1e-12)
    assert found.impact_impulse.values == pytest.approx([2.0 * ratio / (1.0 + ratio)], rel=1e-9)
    assert energy_error(found) < 1e-12


@pytest.mark.parametrize("stiffness", [1e-9, 1e9])
def test_a_very_soft_or_stiff_link_keeps_the_energy(stiffness: float) -> None:
    bodies = [
        oscillator("a", 1.0, 1.0, velocity_start=1.0),
        oscillator("b", 1.0, 1.5, velocity_start=0.4),
        oscillator("c", 0.3, 2.0),
    ]
    contacts = [{"between": ["b", "c"], "restitution": 1.0, "clearance": 0.05}]
    found = run(bodies, contacts, link=[{"between": ["a", "b"], "stiffness": stiffness}])
    assert found.sizes["impact"] > 3
    assert energy_error(found) < 1e-9


def test_two_masses_of_one_chain_hit_each_other() -> None:
    bodies = [{"name": "chain", "kind": "chain", "masses": [1.0, 0.5], "stiffnesses": [1.0, 0.8]}]
    contacts = [{"between": ["chain.1", "chain.2"], "restitution": 0.7, "clearance": 0.05}]
    force = {"at": "chain.1", "amplitude": 0.5, "angular_frequency": 1.1}
    record = {"recorded_periods": 6, "time_series": SERIES}
    found = run(bodies, contacts, forcing=force, record=record)
    assert found.sizes["impact"] > 3
    assert energy_error(found) < 1e-10


def test_a_ball_that_chatters_to_rest_on_a_moving_body_stays_within_its_clearance() -> None:
    bodies = [oscillator("table", 1.0, 4.0, damping=0.1), oscillator("ball", 0.2, 0.3)]
    contacts = [{"between": ["ball", "table"], "restitution": 0.4, "clearance": 0.01}]
    force = {"at": "ball", "amplitude": 0.4, "angular_frequency": 0.2}
    names = [*SERIES["variables"], "contact_displacement[1]"]
    record = {"recorded_periods": 3, "time_series": {"rate": 10.0, "variables": names}}
    found = run(bodies, contacts, forcing=force, record=record)
    assert found.sizes["stick"] > 0
    assert found.contact_displacement_1.values.max() <= 0.01 + 1e-13
    assert energy_error(found) < 1e-9


def test_a_run_that_is_cut_at_the_instant_of_a_release_goes_on() -> None:
    """The force that holds the contact is then rounding: its release and its next decision must read it alike."""
    bodies = [
        oscillator("a", 0.428, 17.746, damping=-0.418, velocity_start=0.033),
        oscillator("b", 2.282, 1.0, damping=0.223, velocity_start=-0.817),
        {"name": "c", "kind": "beam", "length": 1.0, "mass_per_length": 1.92, "flexural_rigidity": 0.948}
        | {"boundary": "clamped-free", "modes": 1, "damping_ratio": 0.02},
    ]
    contacts: list[dict[str, Any]] = [
        {"between": ["a", "b"], "clearance": 0.042, "restitution": 0.5},
        {"between": ["c.0.3", "a"], "clearance": 0.117, "restitution": 1.0},
        {"between": ["b", "c.0.55"], "clearance": 1e-9, "law": "kelvin_voigt", "stiffness": 10.0},
    ]
    link = {"between": ["a", "c.0.55"], "stiffness": 4.294}
    tables = {"body": bodies, "contact": contacts, "link": [link], "record": {"recorded_time": 4.8}}
    scene = Scene.from_dict(tables)
    end = float(vi.run(scene).stick_end.values[0])
    driver = driver_of(scene, "fused")
    driver.watch(contacts=len(scene.stops))
    try:
        for step in range(-3, 4):
            cut = end + step * np.spacing(end)
            parts = in_one_run(driver, scene, [0.0, cut, 4.8])
            assert len(np.concatenate([part.sticks for part in parts])) == 1
    finally:
        driver.close()


def test_a_body_at_rest_without_load_has_one_rest() -> None:
    """Rounding of its speed, with damping that feeds energy, is no force that lets it go."""
    bodies = [oscillator("a", 2.321), oscillator("b", 0.483, damping=-0.316, velocity_start=0.295)]
    stop = {"at": "b", "side": "upper", "position": 0.482, "restitution": 0.0}
    force = {"signal": "table", "at": "a", "times": [0.5, 1.0], "values": [0.4, 1.3]}
    scene = {"body": bodies, "stop": [stop], "forcing": force, "record": {"recorded_time": 8.0}}
    found = vi.run(Scene.from_dict({"scene": {"units": "nondimensional"}} | scene))
    assert found.sizes["stick"] == 1
    assert found.stick_start.item() == found.impact_time.item()
    assert np.isnan(found.stick_end.item())


def test_a_contact_that_pulls_lets_a_rest_without_load_go_at_once() -> None:
    """Two points of a beam rest on each other without load until a ball parts them by a Hertz contact."""
    beam = {"name": "c", "kind": "beam", "length": 1.0, "mass_per_length": 1.673, "flexural_rigidity": 1.036}
    bodies = [oscillator("a", 1.02, velocity_start=0.112), beam | {"boundary": "clamped-pinned", "modes": 1}]
    contacts = [
        {"between": ["a", "c.0.55"], "clearance": 0.075, "law": "hertz", "stiffness": 1000.0},
        {"between": ["c.0.3", "c.0.55"], "clearance": 0.0, "restitution": 1.0},
    ]
    found = run(bodies, contacts, scene={"units": "nondimensional"}, record={"recorded_time": 1.0})
    assert found.stick_start.values.tolist() == [0.0]
    assert found.stick_end.item() == pytest.approx(0.075 / 0.112, abs=1e-12)
