"""An export is as large as it is described, and as small as it is told: fewer modes and contacts are the same body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tomli_w

import vibroimpact as vi
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.scene import Scene

STOP = {
    "contact[1].law": 1,
    "contact[1].location": 1.0,
    "contact[1].position": 1e-3,
    "contact[1].restitution": 0.7,
    "modal_velocity_start[1]": 1.0,
}
OUTPUTS = ("displacement", "velocity", "contact[1].count", "contact[1].impulse")


def samples(fmu: Path, parameters: dict[str, object], run_as: str = "auto") -> list[bytes]:
    """Return the bits of the samples of a run."""
    document = {
        "component": {"b": {"fmu": fmu.name, "parameters": parameters, "run_as": run_as}},
        "record": {"recorded_time": 0.05, "rate": 2000, "variables": [f"b.{name}" for name in OUTPUTS]},
        "execution": {"guard": False},
    }
    (fmu.parent / "s.toml").write_text(tomli_w.dumps(document))
    made = vi.run(Scene.from_file(fmu.parent / "s.toml"))
    names = {one.attrs.get("component_variable"): one for one in made.data_vars.values()}
    assert float(names["b.contact[1].count"].values[-1]) > 2
    return [np.asarray(names[f"b.{name}"].values).tobytes() for name in OUTPUTS]


@pytest.mark.parametrize("fmi", ["3.0", pytest.param("2.0", marks=pytest.mark.long)])
def test_an_export_of_16_modes_set_to_4_is_an_export_of_4_modes_to_the_bit(tmp_path: Path, fmi: str) -> None:
    large = export_fmu("Beam", tmp_path / "large.fmu", fmi=fmi, modes=16, contacts=5)
    small = export_fmu("Beam", tmp_path / "small.fmu", fmi=fmi, modes=4, contacts=1)
    assert samples(large, {**STOP, "modes": 4}) == samples(small, {**STOP})
    assert samples(large, {**STOP, "modes": 5}) != samples(small, {**STOP})


@pytest.mark.parametrize("run_as", ["co_simulation", "model_exchange"])
def test_a_scene_sets_structural_parameters_in_configuration_mode(tmp_path: Path, run_as: str) -> None:
    second = {"contact[2].law": 1, "contact[2].location": 0.5, "contact[2].position": 1e-5}
    large = export_fmu(
        "Beam", tmp_path / "large.fmu", modes=4, contacts=2, starts={**STOP, **second}, structural=True
    )
    small = export_fmu("Beam", tmp_path / "small.fmu", modes=4, contacts=1, starts=STOP)
    found = samples(large, {"contacts": 1}, run_as=run_as)
    assert found == samples(small, {}, run_as=run_as)
    assert found != samples(large, {}, run_as=run_as)
