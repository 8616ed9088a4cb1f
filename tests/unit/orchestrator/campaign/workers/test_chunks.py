import math
from pathlib import Path

import numpy as np
import pytest
from support.busy_runner import BrittleRunner, BusyRunner, run_busy
from support.campaign_scenes import amplitude_text, assert_same_rows, frequency_text, plane_text, scene_of

from vibroimpact.analysis.dataset import Outcome, read_flat, write_dataset
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.orchestrator.campaign.manifest import scene_hash
from vibroimpact.orchestrator.campaign.parts import (
    StoredPart,
    compact,
    list_parts,
    remove_temporary_files,
    unfit_parts,
)
from vibroimpact.orchestrator.campaign.schedule import gaps_between
from vibroimpact.orchestrator.campaign.workers.chunks import (
    Chunk,
    Work,
    get_ready,
    points_of,
    run_chunk,
    write_crashed,
)
from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.scene.sweep import expand

BUSY = "support.busy_runner:BusyRunner"


def work_in(folder: Path, text: str, runner: str = BUSY) -> Work:
    folder.mkdir(exist_ok=True)
    return Work(scene_of(text), str(folder), runner, scene_hash(scene_of(text)))


def run_all(work: Work, chunks: list[tuple[int, int]], branch_length: int) -> list[Path]:
    """Run chunks one after the other, each from the state that the chunk before handed on."""
    carried, paths = None, []
    for first, stop in chunks:
        result = run_chunk(work, Chunk(first // branch_length, first, stop, carried))
        carried = result.carried
        paths.append(Path(work.parts_folder, result.chunk.part_name))
    return paths


@pytest.mark.parametrize("path", ["independent", "up", "down", "up-down"])
def test_rows_do_not_depend_on_how_runs_are_cut_into_chunks(tmp_path: Path, path: str) -> None:
    text = plane_text(7, 2, path, milliseconds=0.01)
    length = 14 if path == "independent" else 7
    runs = 28 if path == "up-down" else 14
    cut = sorted({*range(0, runs, 3), *range(0, runs, length)})
    stops = [*cut[1:], runs]
    fine = run_all(work_in(tmp_path / "fine", text), list(zip(cut, stops, strict=True)), length)
    coarse = run_all(work_in(tmp_path / "coarse", text), [(0, runs)], length)
    compact(fine, tmp_path / "fine.nc", DatasetForm(scene_of(text)), {})
    compact(coarse, tmp_path / "coarse.nc", DatasetForm(scene_of(text)), {})
    assert_same_rows(tmp_path / "fine.nc", tmp_path / "coarse.nc")
    assert read_flat(tmp_path / "fine.nc").attrs == read_flat(tmp_path / "coarse.nc").attrs
    run_busy(scene_of(text), tmp_path / "run.nc")
    assert_same_rows(tmp_path / "run.nc", tmp_path / "coarse.nc")


def test_a_branch_goes_on_from_the_state_of_the_run_before(tmp_path: Path) -> None:
    scene = scene_of(frequency_text(3, "up", milliseconds=0.01))
    points = points_of(expand(scene), Chunk(0, 0, 3))
    records, carried = BusyRunner(scene).rows(points)
    assert isinstance(records, list)
    before = (records[0].final_displacement, records[0].final_velocity)
    alone = BusyRunner(scene).run(points.place(1).point.values, before)
    assert alone.final_displacement == records[1].final_displacement
    assert carried == (records[2].final_displacement, records[2].final_velocity)


def test_a_failed_run_hands_on_the_state_it_was_given() -> None:
    text = frequency_text(2, "up", milliseconds=0.01).replace("amplitude = 0.5", "amplitude = -0.5")
    scene = scene_of(text)
    second = points_of(expand(scene), Chunk(0, 1, 2))
    records, carried = BrittleRunner(scene).rows(second, (0.25, 1.5))
    assert isinstance(records, list)
    assert [record.outcome for record in records] == [Outcome.error]
    assert "the step failed" in records[0].message
    assert math.isnan(records[0].final_displacement)
    assert carried == (0.25, 1.5)


def test_a_chunk_of_failed_runs_merges_with_any_other(tmp_path: Path) -> None:
    work = work_in(tmp_path / "parts", amplitude_text(20, start=-0.9), "support.busy_runner:BrittleRunner")
    paths = run_all(work, [(0, 5), (5, 20)], 20)
    compact(paths, tmp_path / "all.nc", DatasetForm(work.scene), {})
    outcome = read_flat(tmp_path / "all.nc")["outcome"].values
    assert (outcome[:10] == Outcome.error).all()
    assert (outcome[10:] == Outcome.ok).all()


def test_a_chunk_over_its_time_ends_after_a_point(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(50, milliseconds=5.0))
    result = run_chunk(work, Chunk(0, 0, 50, most_seconds=0.02))
    assert 1 <= result.chunk.count < 50
    assert read_flat(tmp_path / result.chunk.part_name).sizes["run"] == result.chunk.count


def test_a_crashed_run_is_a_row_and_hands_on_the_state_it_was_given(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(5, "up"))
    result = write_crashed(work, Chunk(0, 2, 3, (0.5, 0.25)), "it kills")
    assert result.carried == (0.5, 0.25)
    rows = read_flat(tmp_path / result.chunk.part_name)
    assert rows["outcome"].values.tolist() == [Outcome.crash]
    assert rows["message"].values.tolist() == ["it kills"]


def test_a_worker_with_another_runner_than_the_campaign_refuses_its_chunk(tmp_path: Path) -> None:
    text = frequency_text(5)
    work = Work(scene_of(text), str(tmp_path), BUSY, "", RunnerIdentity("busy", "another", {}))
    with pytest.raises(CampaignError, match="expected the runner that the campaign began with"):
        run_chunk(work, Chunk(0, 0, 5))


def test_a_part_that_cannot_be_written_is_one_clear_message(tmp_path: Path) -> None:
    work = Work(scene_of(frequency_text(5, milliseconds=0.01)), str(tmp_path / "absent"), BUSY)
    with pytest.raises(CampaignError, match="the results of 5 points could not be written: No such file"):
        run_chunk(work, Chunk(0, 0, 5))


def test_a_worker_that_got_ready_leaves_nothing_in_the_folder(tmp_path: Path) -> None:
    identity = get_ready(work_in(tmp_path, frequency_text(5)))
    assert identity.execution == "busy"
    assert not list(tmp_path.iterdir())


def listed(work: Work) -> tuple[list[StoredPart], list[str]]:
    notes: list[str] = []
    return list_parts(Path(work.parts_folder), work.scene_hash, notes.append), notes


def test_resuming_finds_sound_parts_and_the_state_each_hands_on(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(10, "up", milliseconds=0.01))
    run_all(work, [(0, 4), (4, 9)], 10)
    parts, notes = listed(work)
    assert not notes
    assert [(part.chunk.first, part.chunk.stop) for part in parts] == [(0, 4), (4, 9)]
    rows = read_flat(parts[1].path)
    assert parts[1].carried == (rows["final_displacement"].values[-1], rows["final_velocity"].values[-1])
    (gap,) = gaps_between(parts, 10)
    assert (gap.first, gap.stop, gap.start) == (9, 10, parts[1].carried)


def test_a_part_that_holds_runs_of_another_is_removed(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(10, milliseconds=0.01))
    run_all(work, [(0, 6), (4, 8)], 10)
    parts, _ = listed(work)
    assert [(part.chunk.first, part.chunk.stop) for part in parts] == [(0, 6)]
    assert len(list(tmp_path.iterdir())) == 1


def test_a_part_under_a_wrong_name_is_removed_with_a_note(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(10, milliseconds=0.01))
    (path,) = run_all(work, [(0, 5)], 10)
    path.rename(tmp_path / Chunk(0, 5, 10).part_name)
    parts, notes = listed(work)
    assert not parts
    assert len(notes) == 1
    assert "5 points come again" in notes[0]


def test_a_part_of_another_scene_is_removed_with_a_note(tmp_path: Path) -> None:
    run_all(work_in(tmp_path, frequency_text(10, milliseconds=0.02)), [(0, 5)], 10)
    parts, notes = listed(work_in(tmp_path, frequency_text(10, milliseconds=0.01)))
    assert not parts
    assert "expected a part of this scene" in notes[0]


def test_only_files_of_a_killed_writer_are_taken_away(tmp_path: Path) -> None:
    left = f".{Chunk(0, 0, 5).part_name}.17.0123abcd.tmp"
    others = [".dataset.nc.17.0123abcd.tmp.bak", ".x.nc.1.tmp", "mine.txt", "notes.tmp"]
    for name in (left, ".dataset.nc.17.0123abcd.tmp", *others):
        (tmp_path / name).touch()
    remove_temporary_files(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == others


def test_parts_that_do_not_fit_are_named_with_the_reason(tmp_path: Path) -> None:
    text = frequency_text(10, milliseconds=0.01)
    work = work_in(tmp_path, text)
    sound, cut, foreign = run_all(work, [(0, 3), (3, 6), (6, 10)], 10)
    cut.write_bytes(cut.read_bytes()[:-2000])
    rows = read_flat(foreign)
    write_dataset(
        rows.drop_vars("final_phase").assign(final_phase=rows.final_phase.assign_attrs(units="m")), foreign
    )
    unfit = dict(unfit_parts([sound, cut, foreign], scene_of(text)))
    assert list(unfit) == [cut, foreign]
    assert "final_phase: expected units 'rad'" in unfit[foreign]


def test_the_dataset_of_a_campaign_says_where_it_comes_from(tmp_path: Path) -> None:
    text = frequency_text(3, milliseconds=0.01, title="where from")
    run_busy(scene_of(text), tmp_path / "run.nc")
    attrs = read_flat(tmp_path / "run.nc").attrs
    assert attrs["scene"] == text
    assert attrs["title"] == "where from"
    assert (attrs["execution"], attrs["instruction_set"]) == ("busy", "none")
    assert {"versions", "fmu_hashes", "git_commit", "seed"} <= attrs.keys()


def test_angles_and_states_keep_every_bit_on_their_way_through_a_part(tmp_path: Path) -> None:
    work = work_in(tmp_path, frequency_text(3, "up", milliseconds=0.01))
    carried = (math.nextafter(0.1, 1.0), -5e-324)
    write_crashed(work, Chunk(0, 1, 2, carried), "")
    (part,) = listed(work)[0]
    assert part.carried is not None
    assert np.array_equal(np.array(part.carried).view(np.int64), np.array(carried).view(np.int64))
