"""A scene's body as an FMU: its numbers are the start values, its record the default experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.command_line import in_this_process
from support.component_fmu import VERSIONS
from support.places import EXAMPLES

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene, load_scene


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_default_run_takes_as_long_as_the_scene_records(tmp_path: Path, fmi: str) -> None:
    # that it is the scene's own run is tested with other tools, in tests/exchange
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
