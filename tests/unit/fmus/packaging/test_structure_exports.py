"""Exports of a Structure: a description of its contacts, and its modes in the resources alone."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from support.component_fmu import VERSIONS, stop

import vibroimpact as vi
from vibroimpact.fmus.packaging.check import check_fmu, kinds_of
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    Experiment,
    lean,
    model_description,
)
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.members import component_of, edition_of
from vibroimpact.fmus.packaging.structure_file import structure_file


def shown(modes: int, contacts: int = 2) -> ComponentDescription:
    """Return the Structure as exports of this size describe it, apart from what they leave out."""
    return component_of("Structure").with_repeats(
        {"mode": modes, "contact": contacts, "sine": 0, "signal": 0}
    )


def described(component: ComponentDescription, fmi: str) -> str:
    return model_description(component, fmi, edition_of(Experiment(), dated=False))


def exported(path: Path, modes: int, contacts: int, fmi: str, **options: Any) -> Path:
    """Write an FMU of random modes with a stop at each contact."""
    draw = np.random.default_rng(modes)
    arrays = {
        "mode.angular_frequency": np.sort(draw.uniform(10.0, 100.0, modes)),
        "mode.damping_ratio": np.full(modes, 0.01),
        "mode.contact_shape": draw.normal(size=(contacts, modes)),
        **{
            f"mode.{name}": draw.normal(size=modes) for name in ("observed_shape", "forcing", "base", "force")
        },
    }
    starts: dict[str, float] = {"forcing.amplitude": 1.0, "forcing.angular_frequency": 20.0}
    for k in range(1, contacts + 1):
        starts |= stop(0.003, 0.6, k=k)
    content = structure_file(arrays)
    return export_fmu(
        "Structure",
        path,
        modes=modes,
        contacts=contacts,
        fmi=fmi,
        starts=starts,
        structure=content,
        **options,
    )


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_description_does_not_grow_with_the_modes(fmi: str) -> None:
    for external in (False, True):
        few, many = (described(lean(shown(modes), external=external), fmi) for modes in (8, 64))
        assert many.replace('max="64" start="64"', 'max="8" start="8"') == few


@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_largest_structure_has_less_than_100_kb_of_resources(tmp_path: Path, fmi: str) -> None:
    path = exported(tmp_path / "largest.fmu", 64, 32, fmi, stop_time=0.05)
    with zipfile.ZipFile(path) as archive:
        sizes = {member.filename: member for member in archive.infolist()}
    resources = [member for name, member in sizes.items() if name.startswith("resources/")]
    xml = sizes["modelDescription.xml"]
    assert sum(member.file_size for member in resources) < 100_000
    assert sum(member.compress_size for member in (*resources, xml)) < 50_000
    assert xml.file_size < 300_000
    assert check_fmu(path) == ()
    assert validate_fmu(str(path)) == []
    assert kinds_of(path) == f"FMI {fmi}: co-simulation"


def test_a_description_grows_with_contacts_and_states_and_not_with_their_square() -> None:
    for fmi in VERSIONS:
        contacts = [len(described(lean(shown(1, number)), fmi)) for number in (8, 16, 32)]
        modes = [len(described(lean(shown(number), model_exchange=True), fmi)) for number in (16, 32, 64)]
        for first, second, third in (contacts, modes):
            assert third - second < 2.2 * (second - first)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_export_may_have_its_states_and_moves_alike_by_an_integrator(tmp_path: Path, fmi: str) -> None:
    path = exported(tmp_path / "both.fmu", 3, 2, fmi, model_exchange=True)
    plain = exported(tmp_path / "plain.fmu", 3, 2, fmi)
    assert kinds_of(path) == f"FMI {fmi}: co-simulation, model exchange"
    assert validate_fmu(str(path)) == []
    assert read_description(path).numberOfContinuousStates == 6
    stepped, lone, integrated = (
        fmpy.simulate_fmu(
            str(each), fmi_type=kind, stop_time=2.0, output_interval=0.01, relative_tolerance=1e-9,
            output=["displacement", "contact[1].count", "contact[2].count"],
        )
        for each, kind in (
            (path, "CoSimulation"), (plain, "CoSimulation"), (path, "ModelExchange"),
        )
    )  # fmt: skip
    assert stepped.tobytes() == lone.tobytes()
    assert stepped["contact[1].count"][-1] + stepped["contact[2].count"][-1] > 5
    assert integrated["contact[1].count"][-1] == stepped["contact[1].count"][-1]
    rows = np.searchsorted(integrated["time"], stepped["time"] - 1e-9)
    size = float(np.ptp(stepped["displacement"]))
    assert integrated["displacement"][rows] == pytest.approx(stepped["displacement"], abs=1e-4 * size)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_only_what_depends_on_an_input_may_lack_a_list_of_its_knowns(tmp_path: Path, fmi: str) -> None:
    path = exported(tmp_path / "many.fmu", 2, 16, fmi, external=True)
    description = read_description(path)
    inputs = {v.name for v in description.modelVariables if v.causality == "input"}
    follows = {u.variable.name: {k.name for k in u.dependencies} & inputs for u in description.outputs}
    listed = {u.variable.name: u.dependencies for u in description.initialUnknowns}
    assert {name for name, knowns in listed.items() if knowns is None} == {
        n for n, of in follows.items() if of
    }
    applied = {f"contact[{k}].applied_force" for k in range(1, 17)}  # they all move what a stop holds
    assert follows["contact[3].force"] == {"force", "base_acceleration", *applied}
    assert not follows["contact[3].displacement"]
    of_contact = [known.name for known in listed["contact[3].displacement"]]
    assert not inputs & set(of_contact)
    assert "contact[3].position" in of_contact
    assert not any(name.startswith(("contact[4]", "stop[4]")) for name in of_contact)


KINDS: dict[str, dict[str, Any]] = {
    "growing": {"damping_ratio": [0.02, -0.01, 0.02]},
    "coupled": {"damping_matrix": [[0.4, 0.1, 0.0], [0.1, 0.3, -0.1], [0.0, -0.1, 0.5]]},
    "free": {"frequencies": [0.0, 3.1, 9.0]},
}


@pytest.mark.parametrize(("fmi", "full"), [("3.0", False), ("2.0", False), ("3.0", True)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_of_given_modes_moves_in_fmpy_as_its_run(
    tmp_path: Path, kind: str, fmi: str, full: bool
) -> None:
    rate, steps = 64.0, 96
    body = {
        **{"name": "board", "kind": "modes", "frequencies": [1.2, 3.1, 9.0], "damping_ratio": 0.01},
        "shapes": {"tip": [2.0, -1.5, 1.1], "middle": [0.7, 1.4, 0.2]},
        "velocity_start": [0.02, -0.05, 0.04],
        **KINDS[kind],
    }
    scene = vi.Scene.from_dict(
        {
            "body": [body],
            "stop": [
                {"at": "board.tip", "position": 4e-3, "restitution": 0.7},
                {"at": "board.middle", "position": -2e-3, "side": "lower", "restitution": 0.6},
            ],
            "record": {
                "recorded_time": 2.0,
                "time_series": {"rate": rate, "variables": ["displacement", "contact_displacement[2]"]},
            },
        }
    )
    samples = vi.run(scene, progress=False).vibroimpact.samples()
    path = vi.export_fmu(scene, tmp_path / "board.fmu", fmi=fmi, full=full)
    found = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", step_size=1.0 / rate, output_interval=1.0 / rate,
        stop_time=steps / rate, output=["displacement", "contact[2].displacement", "contact[1].count"],
    )  # fmt: skip
    assert found["contact[1].count"][-1] > 1
    for ours, theirs in (
        ("displacement", "displacement"),
        ("contact_displacement_2", "contact[2].displacement"),
    ):
        expected = samples[ours].values[: steps + 1]
        np.testing.assert_allclose(found[theirs], expected, atol=1e-11 * np.abs(expected).max())
