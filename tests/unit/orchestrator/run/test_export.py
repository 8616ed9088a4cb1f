"""A scene's body as an FMU: its numbers are the start values, its record the default experiment."""

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
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.scene.keys import dataset_name


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_default_run_takes_as_long_as_the_scene_records(tmp_path: Path, fmi: str) -> None:
    # tests/exchange compares the run itself with the scene's run, in other tools
    scene = load_scene(EXAMPLES / "single_run.toml")
    path = export_scene(scene, tmp_path / "rig.fmu", fmi=fmi)
    assert check_fmu(path) == ()
    periods = scene.record.transient_periods + scene.record.recorded_periods
    experiment = read_description(path).defaultExperiment
    assert float(experiment.stopTime) == pytest.approx(periods * scene.period)
    assert 20 * float(experiment.stepSize) <= 1.01 * scene.period
    names = {v.name for v in read_description(path).modelVariables}
    assert f"contact[{len(scene.stops)}].law" in names
    assert f"contact[{len(scene.stops) + 1}].law" not in names


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


BODIES: dict[str, dict[str, Any]] = {
    "oscillator": {"mass": 2.0, "stiffness": 8.0, "damping_ratio": 0.05},
    "chain": {"kind": "chain", "masses": [1.0, 2.0, 1.5], "stiffnesses": [40.0, 20.0, 30.0]},
    "beam": {"kind": "beam", "modes": 3, "length": 0.25, "mass_per_length": 0.1, "frequency": 1.0},
}


@pytest.mark.parametrize("angular_frequency", [0.0, 3.0])
@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("kind", BODIES)
def test_an_export_on_a_shaken_base_has_the_absolute_acceleration_of_its_dataset(
    tmp_path: Path, kind: str, fmi: str, angular_frequency: float
) -> None:
    names = ["acceleration", *(["acceleration[1]", "acceleration[2]"] if kind == "chain" else [])]
    record: dict[str, Any] = {"time_series": {"rate": 128.0, "variables": names}}
    record |= {"recorded_periods": 2} if angular_frequency else {"recorded_time": 4.0}
    forcing = {"kind": "base_acceleration", "amplitude": 5.0, "angular_frequency": angular_frequency}
    stop = {"position": 0.3, "restitution": 0.6}
    scene = Scene.from_dict({"body": BODIES[kind], "forcing": forcing, "stop": [stop], "record": record})
    run_scene(scene, tmp_path / "run.nc")
    samples = open_dataset(tmp_path / "run.nc").vibroimpact.samples()
    ours = np.column_stack([samples[dataset_name(name)].values for name in names])
    path = export_scene(scene, tmp_path / "rig.fmu", fmi=fmi)
    step, last = 1.0 / 128.0, len(ours) - 1
    found = simulate_fmu(str(path), output=names, step_size=step, output_interval=step, stop_time=last * step)
    theirs = np.column_stack([found[name] for name in names])
    if kind != "beam":  # springs at rest accelerate no mass; a few modes of a beam cannot show that
        assert theirs[0] == pytest.approx(np.zeros(len(names)), abs=1e-10)
    assert np.abs(ours).max() > 5.0
    assert theirs == pytest.approx(ours, abs=1e-9 * np.abs(ours).max())


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
