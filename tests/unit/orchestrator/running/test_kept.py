"""Scenes that stay open: a second run finds the scene open, and earlier runs make no difference."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.campaign_scenes import frequency_text, scene_of

import vibroimpact as vi
from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.running import kept
from vibroimpact.orchestrator.running.kept import MOST_KEPT, opened_scene

TEXT = frequency_text(2).partition("[sweep]")[0]


@pytest.fixture(autouse=True)
def none_kept() -> Iterator[None]:
    """Begin and end each test without an open scene."""
    kept._kept.close()
    yield
    kept._kept.close()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[PointRunner]:
    """Return the list of opened runners, in the order of opening."""
    runners: list[PointRunner] = []
    make = PointRunner.__init__

    def noted(runner: PointRunner, *arguments: object, **options: object) -> None:
        make(runner, *arguments, **options)  # type: ignore[arg-type]  # as they were given
        runners.append(runner)

    monkeypatch.setattr(PointRunner, "__init__", noted)
    return runners


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> list[PointRunner]:
    """Return the list of closed runners, in the order of closing."""
    runners: list[PointRunner] = []
    close = PointRunner.close

    def noted(runner: PointRunner) -> None:
        close(runner)
        runners.append(runner)

    monkeypatch.setattr(PointRunner, "close", noted)
    return runners


def test_a_scene_is_opened_once_by_its_content(opened: list[PointRunner]) -> None:
    ends = [vi.run(scene_of(TEXT), progress=False) for _ in range(3)]
    assert len({float(end.final_displacement.item()) for end in ends}) == 1
    assert len(opened) == 1
    vi.run(scene_of(TEXT).with_values({"body.mass": 2.0}), progress=False)
    assert len(opened) == 2


def test_the_sign_of_a_zero_is_content(opened: list[PointRunner]) -> None:
    scene = scene_of(TEXT)
    for start in (0.0, -0.0):
        vi.run(scene.at({"body.velocity_start": start}), progress=False)
    assert len(opened) == 2


def test_a_component_that_was_built_anew_is_opened_anew(opened: list[PointRunner]) -> None:
    vi.run(scene_of(TEXT), progress=False)
    fmu = fmu_path("Oscillator")
    before = fmu.stat()
    os.utime(fmu, ns=(before.st_atime_ns, before.st_mtime_ns + 1))
    vi.run(scene_of(TEXT), progress=False)
    os.utime(fmu, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert len(opened) == 2


def test_a_few_scenes_stay_open_and_the_oldest_is_closed(closed: list[PointRunner]) -> None:
    scene = scene_of(TEXT)
    for number in range(MOST_KEPT + 2):
        vi.run(scene.with_values({"body.mass": 1.0 + number}), progress=False)
    assert [runner.scene.body.mass for runner in closed] == [1.0, 2.0]
    kept._kept.close()
    assert len(closed) == MOST_KEPT + 2


def test_a_scene_in_use_is_not_given_to_another_thread(opened: list[PointRunner]) -> None:
    with opened_scene(scene_of(TEXT)) as one, opened_scene(scene_of(TEXT)) as other:
        assert one.runner is not other.runner
    assert len(opened) == 2
    with opened_scene(scene_of(TEXT)):
        assert len(opened) == 2


def test_threads_that_run_one_scene_get_its_results() -> None:
    scene = scene_of(frequency_text(20))
    expected = vi.run(scene, progress=False).final_displacement.values.tolist()
    with ThreadPoolExecutor(4) as threads:
        found = threads.map(
            lambda _: vi.run(scene, progress=False).final_displacement.values.tolist(), range(8)
        )
    assert all(one == expected for one in found)


def test_a_run_that_fails_or_is_interrupted_leaves_nothing_open(
    closed: list[PointRunner], monkeypatch: pytest.MonkeyPatch
) -> None:
    failing = scene_of(frequency_text(3)).with_sweep({"forcing.angular_frequency": [1.0, 1e-308]})
    assert 3 in vi.run(failing, progress=False).outcome.values
    assert len(closed) == 1

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(PointRunner, "rows", interrupted)
    with pytest.raises(KeyboardInterrupt):
        vi.run(scene_of(TEXT), progress=False)
    assert len(closed) == 2


PROGRAM = """
import os, sys
import vibroimpact as vi
from vibroimpact.orchestrator.running import kept
scene = vi.Scene.from_file(sys.argv[1])
end = vi.run(scene, progress=False).final_displacement.values.tolist()
if "fork" in sys.argv:
    pid = os.fork()
    if pid == 0:
        assert not kept._kept._opened
        again = vi.run(scene, progress=False).final_displacement.values.tolist()
        os._exit(0 if again == end and len(kept._kept._opened) == 1 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    assert vi.run(scene, progress=False).final_displacement.values.tolist() == end
print(len(kept._kept._opened))
"""


@pytest.mark.parametrize("how", ["ends", "fork"] if hasattr(os, "fork") else ["ends"])
def test_a_process_that_ends_closes_its_scenes_and_a_fork_has_none(tmp_path: Path, how: str) -> None:
    (tmp_path / "scene.toml").write_text(frequency_text(3))
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "scene.toml"), how]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")
