"""Scenes run whole in this process: their rows equal those of a campaign, with or without a file."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaign_scenes import frequency_text, scene_of

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.orchestrator.guard import GuardedRunner
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.running import open_scene, run_scene


class Counted(Progress):
    """Keeps the number of points done at a time."""

    def __init__(self) -> None:
        super().__init__()
        self.totals: list[int] = []
        self.steps: list[int] = []

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Keep the total."""
        self.totals.append(total)

    def advance(self, points: int) -> None:
        """Keep the step."""
        self.steps.append(points)


def test_a_scene_is_opened_as_it_says_in_this_process_or_in_one_of_its_own() -> None:
    text = frequency_text(3)
    with open_scene(scene_of(text)) as plain, open_scene(scene_of(text), execution="coupled") as coupled:
        assert isinstance(plain, PointRunner)
        assert coupled.execution == "coupled"
    with open_scene(scene_of(f"{text}\n[execution]\nhow = 'coupled'\nguard = true\n")) as guarded:
        assert isinstance(guarded, GuardedRunner)


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_progress_is_told_of_every_point_of_a_sweep(tmp_path: Path, path: str) -> None:
    progress, scene = Counted(), scene_of(frequency_text(5, path))
    found = run_scene(scene, tmp_path / "run.nc", progress=progress)
    assert progress.totals == [scene.runs]
    assert sum(progress.steps) == scene.runs == found.sizes["run"]
    assert read_flat(tmp_path / "run.nc").run_index.values.tolist() == list(range(scene.runs))


def test_progress_is_not_told_of_a_single_run(tmp_path: Path) -> None:
    progress = Counted()
    run_scene(scene_of(frequency_text(2).partition("[sweep]")[0]), tmp_path / "run.nc", progress=progress)
    assert not progress.totals
    assert not progress.steps
