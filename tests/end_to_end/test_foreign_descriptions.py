"""Descriptions with the faults of other tools, in `run` and `fmu check` alike: refused, warned about or remarked on."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import fmu_factory
from support.command_line import in_this_process
from support.fmu_factory import GAIN_SCENE, redescribed

from vibroimpact.analysis.dataset import read_flat

REMARK = ('causality="parameter" variability="tunable" initial="exact"', 'causality="parameter"')
DANGLING = ('<Unknown index="2" dependencies="1"/>', '<Unknown index="2" dependencies="7"/>')
REFUSED = ('name="b"', 'name="k"')


def scene_with(folder: Path, *changes: tuple[str, str]) -> Path:
    redescribed(fmu_factory.gain(folder), folder / "g.fmu", *changes)
    (folder / "s.toml").write_text(GAIN_SCENE)
    return folder / "s.toml"


def test_a_remark_changes_no_number_and_is_counted_by_a_run(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, REMARK)
    done = in_this_process("run", scene, "-o", tmp_path / "r.nc", "--strict")
    assert done.returncode == 0, done.stderr
    assert "note: g.fmu: 1 remark on its description; no number depends on them." in done.stderr
    assert read_flat(tmp_path / "r.nc").g_y.values.tolist() == pytest.approx([6.0] * 11)
    checked = in_this_process("fmu", "check", tmp_path / "g.fmu", "--strict")
    assert checked.returncode == 0, checked.stderr
    assert "remark: variables k, b: expected a variability" in checked.stdout
    assert "1 FMU checked: " in checked.stdout


def test_a_doubt_is_said_and_strict_refuses_it(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, DANGLING)
    warning = "may run wrong: {}variable y: expected dependencies in Outputs/Unknown that are there"
    done = in_this_process("run", scene, "-o", tmp_path / "r.nc")
    assert done.returncode == 0, done.stderr
    assert f"note: {warning.format('g.fmu: ')}" in done.stderr
    checked = in_this_process("fmu", "check", tmp_path / "g.fmu")
    assert checked.returncode == 0, checked.stderr
    assert warning.format("") in checked.stdout
    for command in (
        ("run", scene, "-o", tmp_path / "other.nc"),
        ("check", scene),
        ("fmu", "check", tmp_path / "g.fmu"),
    ):
        refused = in_this_process(*command, "--strict")
        assert refused.returncode == 2
        assert "variable y: expected dependencies" in refused.stderr
    assert not (tmp_path / "other.nc").exists()


def test_what_has_no_way_round_is_refused_by_both(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, REFUSED)
    for command in (("run", scene, "-o", tmp_path / "r.nc"), ("fmu", "check", tmp_path / "g.fmu")):
        refused = in_this_process(*command)
        assert refused.returncode == 2
        assert "variable k: expected names of one variable each, got them twice." in refused.stderr


def test_an_fmu_for_model_exchange_alone_is_one_problem(tmp_path: Path) -> None:
    changes = (('<CoSimulation modelIdentifier="Gain" canHandleVariableCommunicationStepSize="true"/>',
                '<ModelExchange modelIdentifier="Gain"/>'),)  # fmt: skip
    scene = scene_with(tmp_path, *changes)
    only = GAIN_SCENE.replace('"g.fmu"', '"g.fmu"\nrun_as = "co_simulation"')
    scene.write_text(only.replace("g.y", "g.no_such"))
    refused = in_this_process("check", scene)
    assert refused.returncode == 2
    (line,) = refused.stderr.strip().splitlines()
    assert 'got "co_simulation" for g.fmu, which has model exchange only' in line


def test_a_library_of_another_name_is_named(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, ('modelIdentifier="Gain"', 'modelIdentifier="Model"'))
    refused = in_this_process("fmu", "check", tmp_path / "g.fmu")
    assert refused.returncode == 2
    assert "/Gain." in refused.stderr
    assert "must have one name" in refused.stderr
    assert scene.exists()
