"""`vibroimpact accuracy` and `effects`: tables, datasets, figures, a tuned scene; and their refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES
from support.still_clock import stop_the_clock

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_measured
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy import AccuracyOfScene

FREE = """# rings down
[body]
mass = 1.0
stiffness = 4.0     # N/m
damping = 0.1
displacement_start = 1.0

[record]
recorded_time = 3.0
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "free.toml"
    path.write_text(FREE)
    return path


def test_accuracy_leaves_a_table_a_dataset_a_figure_and_a_tuned_scene(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_the_clock(monkeypatch)
    study, figure, tuned = (scene.with_name(name) for name in ("study.nc", "study.png", "tuned.toml"))
    options = ["--tolerance", "1e-6", "-o", str(study), "--figure", str(figure)]
    done = in_this_process("accuracy", str(scene), *options, "--write", str(tuned))
    assert done.returncode == 0, done.stderr
    assert "Take fused: a relative error" in done.stdout
    assert figure.stat().st_size > 10_000
    with open_measured(study) as found:
        assert found.attrs["chosen"] == "fused"
    assert "# N/m" in tuned.read_text()
    assert vi.Scene.from_file(tuned).execution.how == "fused"
    drawn = in_this_process("plot", str(study), "-o", str(scene.with_name("again.png")))
    assert drawn.returncode == 0, drawn.stderr


def test_effects_leave_a_table_a_dataset_and_a_figure(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stop_the_clock(monkeypatch)
    parts, figure = scene.with_name("parts.nc"), scene.with_name("parts.svg")
    done = in_this_process("effects", str(scene), "-o", str(parts), "--figure", str(figure))
    assert done.returncode == 0, done.stderr
    assert "damping" in done.stdout
    assert "Absent from the scene, and not simulated: forcing, " in done.stdout
    with open_measured(parts) as found:
        assert set(found["name"].values) == {"damping", "record of impacts"}
    assert in_this_process("plot", str(parts), "-o", str(scene.with_name("p.png"))).returncode == 0


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--tolerance", "1e-20"], "--tolerance: expected a relative error of 1.4e-14 or more, as double"),
        (["--tolerance", "3e-14"], "or more, to which the reference is known, got 3e-14"),
        (["--budget", "inf"], "--budget: expected a finite processor time of 10 s or more, got inf"),
        (["--tolerance", "0"], "expected a relative error > 0, got 0.0"),
        (["--of", "phase"], "expected all, impact_time"),
        (["--write", "t.toml"], "expected a tolerance to tune for, got none"),
        (["-o", "study.txt"], "expected a name ending in .nc"),
        (["--set", "body.mass=-1"], "body.mass"),
    ],
)
def test_misuse_of_accuracy_is_one_line(
    scene: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], expected: str
) -> None:
    monkeypatch.chdir(scene.parent)
    done = in_this_process("accuracy", str(scene), *options)
    assert done.returncode == 2
    assert expected in done.stderr
    assert sorted(path.name for path in scene.parent.iterdir()) == ["free.toml"]


@pytest.mark.parametrize("command", ["accuracy", "effects"])
def test_a_replay_that_names_no_recording_is_one_line(command: str) -> None:
    done = in_this_process(command, str(EXAMPLES / "recordings" / "board.toml"))
    assert done.returncode == 2
    assert "replay.recordings: expected a recording, got none. Name it in the scene" in done.stderr


def test_an_output_that_holds_something_else_is_kept(scene: Path) -> None:
    run = scene.with_name("run.nc")
    vi.run(scene, run, progress=False)
    before = run.read_bytes()
    for command in ("accuracy", "effects"):
        done = in_this_process(command, str(scene), "-o", str(run))
        assert done.returncode == 2
        assert "one that holds something else" in done.stderr
    assert run.read_bytes() == before


def test_in_a_terminal_the_table_grows(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stop_the_clock(monkeypatch)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    study = AccuracyOfScene(Scene.from_text(FREE))
    with study.shown():
        whole(study)
    said = capsys.readouterr().out
    assert said.index("fused") < said.index("CVode")
