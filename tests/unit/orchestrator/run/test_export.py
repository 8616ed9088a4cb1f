"""A scene's body as an FMU: what FMPy makes of its default run is what the scene's own run is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from support.command_line import in_this_process
from support.component_fmu import VERSIONS
from support.places import EXAMPLES

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.orchestrator.campaign import run_scene
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene, load_scene

BODIES: dict[str, dict[str, Any]] = {
    "oscillator": {"body": {"mass": 2.0, "stiffness": 8.0, "damping_ratio": 0.02}},
    "chain": {"body": {"kind": "chain", "masses": [1.0, 2.0, 1.5], "stiffnesses": [40.0, 20.0, 30.0]}},
    "beam": {
        "body": {
            "kind": "beam",
            "modes": 4,
            "length": 0.25,
            "youngs_modulus": 7e10,
            "density": 2700.0,
            "width": 0.02,
            "thickness": 0.002,
            "damping_ratio": 0.01,
        }
    },
}
FORCING: dict[str, tuple[Any, float]] = {
    "oscillator": (3.0, 1.7),
    "chain": ([0.0, 1.0, 0.5], 2.0),
    "beam": (0.5, 150.0),
}
GAP = {"oscillator": 0.2, "chain": 0.05, "beam": 0.004}


def scene_of(kind: str, **stop: Any) -> Scene:
    amplitude, angular_frequency = FORCING[kind]
    period = 2.0 * np.pi / angular_frequency
    return Scene.from_dict(
        {
            **BODIES[kind],
            "forcing": {"amplitude": amplitude, "angular_frequency": angular_frequency},
            "stop": [{"position": GAP[kind], "law": "restitution", "restitution": 0.6, **stop}],
            "record": {
                "recorded_periods": 8,
                "time_series": {"rate": 100.0 / period, "variables": ["displacement", "velocity"]},
            },
        }
    )


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("kind", BODIES)
def test_fmpy_makes_of_the_export_what_the_scene_is(tmp_path: Path, kind: str, fmi: str) -> None:
    scene = scene_of(kind)
    path = export_scene(scene, tmp_path / "rig.fmu", fmi=fmi)
    assert check_fmu(path) == ()
    run_scene(scene, tmp_path / "run.nc")
    found = open_dataset(tmp_path / "run.nc")
    assert found["impact_count"].item() > 3
    series = found.vibroimpact.samples()
    names = ["displacement", "velocity"]
    done = simulate_fmu(str(path), output=names, output_interval=float(scene.period or 0.0) / 100.0)
    description = read_description(path)
    assert float(description.defaultExperiment.stopTime) == pytest.approx(8 * scene.period)
    for name in names:
        ours = series[name].values
        scale = np.abs(ours).max()
        assert np.abs(done[name][: len(ours)] - ours).max() <= 1e-9 * scale


def test_the_command_exports_a_scene_with_a_key_changed(tmp_path: Path) -> None:
    target = tmp_path / "rig.fmu"
    done = in_this_process(
        "fmu", "export", EXAMPLES / "single_run.toml", "--set", "stop[1].restitution=0.25", "-o", target
    )
    assert done.returncode == 0, done.stderr
    starts = {v.name: v.start for v in read_description(target).modelVariables}
    scene = load_scene(EXAMPLES / "single_run.toml")
    assert float(starts["contact[1].restitution"]) == 0.25
    assert float(starts["forcing.angular_frequency"]) == scene.value("forcing.angular_frequency")


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            {
                "component": {"a": {"fmu": "Oscillator"}},
                "record": {"recorded_time": 1.0},
            },
            "expected the scene of one body, with [body], got components",
        ),
    ],
)
def test_a_scene_that_is_not_one_body_is_refused(tmp_path: Path, tables: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as caught:
        export_scene(Scene.from_dict(tables), tmp_path / "x.fmu")
    assert said in str(caught.value)
    assert not (tmp_path / "x.fmu").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["oscillator", "--set", "mass"],
            "--set: expected NAME=VALUE, got 'mass'. For example: --set mass=2",
        ),
        (["oscillator", "--set", "mas=2"], "Did you mean mass?"),
        (
            [str(EXAMPLES / "single_run.toml"), "--contacts", "2"],
            "--contacts: a scene says how many there are",
        ),
        ([str(EXAMPLES / "two_oscillators.toml")], "expected the scene of one body"),
        (["user-contact-law", "--law", "x.py", "--full"], "--full: a contact law has none of its own"),
        (
            ["user-contact-law", "--law", "x.py", "--set", "mass=2"],
            "--set: a contact law has none of its own",
        ),
    ],
)
def test_a_misuse_of_the_command_is_one_line(tmp_path: Path, arguments: list[str], said: str) -> None:
    done = in_this_process("fmu", "export", *arguments, "-o", tmp_path / "x.fmu")
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "x.fmu").exists()
