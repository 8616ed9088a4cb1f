"""A lost `campaign.json` is no loss: the parts and the dataset have all data to make it again."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.campaign_scenes import assert_same_rows, frequency_text, scene_of
from support.serial_pool import Notes, campaign_here

import vibroimpact.orchestrator.campaign.earlier_sweep as earlier_sweep
import vibroimpact.orchestrator.campaign.manifest as manifests
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis.dataset import read_flat, read_part, write_dataset
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted
from vibroimpact.orchestrator.campaign.manifest import (
    DamagedManifestError,
    carried_manifest,
    read_content,
    read_manifest,
    write_content,
    write_manifest,
)
from vibroimpact.orchestrator.campaign.manifest_copies import manifest_again
from vibroimpact.orchestrator.campaign.workers.chunks import MANIFEST
from vibroimpact.orchestrator.run import RunnerIdentity

TEXT = frequency_text(30, "up-down", milliseconds=0.001)
LONGER = TEXT.replace("start = 0.6, stop = 1.6, points = 30", "values = [0.6, 0.7, 0.8]")
IDENTITY = RunnerIdentity("fused", "x86_64", {"body": "a" * 64})


def interrupt(patch: pytest.MonkeyPatch, text: str, folder: Path, chunks: int = 4) -> None:
    """Begin or resume a campaign in chunks of five points, and stop it after some chunks."""
    with patch.context() as inner:
        inner.setattr(schedule, "FIRST_POINTS", 5)
        inner.setattr(schedule, "MOST_POINTS", 5)
        with pytest.raises(CampaignInterrupted):
            campaign_here(inner, text, folder, most_chunks=chunks)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with sound campaigns: half done, finished, and with another restitution."""
    home = tmp_path_factory.mktemp("campaigns")
    with pytest.MonkeyPatch.context() as patch:
        interrupt(patch, TEXT, home / "half")
        campaign_here(patch, TEXT, home / "done")
        interrupt(patch, TEXT.replace("restitution = 0.7", "restitution = 0.6"), home / "other", 1)
    return home


def copied(folders: Path, name: str, target: Path) -> Path:
    return shutil.copytree(folders / name, target / name)


def parts_of(folder: Path) -> list[Path]:
    return sorted((folder / "parts").glob("branch-*.nc"))


def content_of(folder: Path) -> dict[str, bytes]:
    return {os.fspath(path.relative_to(folder)): path.read_bytes() for path in parts_of(folder)}


def flipped(content: bytes) -> bytes:
    return content[:700] + bytes([content[700] ^ 4]) + content[701:]


QUICK = ("missing", "empty", "flipped")
DAMAGES: dict[str, Callable[[bytes], bytes | None]] = {
    "missing": lambda _: None,
    "empty": lambda _: b"",
    "cut": lambda content: content[: len(content) // 2],
    "flipped": flipped,
    "zeros": lambda content: bytes(len(content)),
    "a list": lambda _: b"[1, 2]",
    "deep": lambda _: b'{"format": ' * 100_000,
}


@pytest.mark.parametrize(
    "how", [how if how in QUICK else pytest.param(how, marks=pytest.mark.long) for how in DAMAGES]
)
def test_a_lost_manifest_is_made_again_from_the_parts_and_the_campaign_goes_on_bit_for_bit(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    half, notes = copied(folders, "half", tmp_path), Notes()
    path = half / "campaign.json"
    before = path.read_bytes()
    damaged = DAMAGES[how](before)
    path.unlink()
    if damaged is not None:
        path.write_bytes(damaged)
    assert campaign_here(monkeypatch, TEXT, half, notes=notes).resumed == 20
    state = "missing" if damaged is None else "damaged"
    assert notes.lines == [f"{path} was {state} and is made again from 4 parts."]
    assert path.read_bytes() == before
    assert_same_rows(half / "dataset.nc", folders / "done" / "dataset.nc")
    assert read_flat(half / "dataset.nc").attrs == read_flat(folders / "done" / "dataset.nc").attrs


def test_one_part_of_the_campaign_is_enough(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half, notes = copied(folders, "half", tmp_path), Notes()
    first, cut, *older = parts_of(half)
    for path in older:  # the form of version 0.2
        write_dataset(read_flat(path).assign_attrs({MANIFEST: ""}), path)
    cut.write_bytes(cut.read_bytes()[:1000])
    (half / "campaign.json").unlink()
    assert campaign_here(monkeypatch, TEXT, half, notes=notes).resumed == 15
    assert "campaign.json was missing and is made again from 1 part." in notes.lines[0]
    assert notes.lines[1].startswith(f"{cut.name} was damaged and is removed; its 5 points come again")
    assert_same_rows(half / "dataset.nc", folders / "done" / "dataset.nc")
    assert first.name.startswith("branch-")


def test_a_full_disk_while_the_manifest_is_made_again_is_one_error_and_loses_nothing(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = copied(folders, "half", tmp_path)
    (half / "campaign.json").write_bytes(b"")
    before = content_of(half)

    def full(path: Path, *_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), os.fspath(path))

    with monkeypatch.context() as patch:
        patch.setattr(manifests, "write_atomically", full)
        with pytest.raises(CampaignError, match=r"campaign\.json: .*No space left on device"):
            campaign_here(patch, TEXT, half)
    assert content_of(half) == before
    assert campaign_here(monkeypatch, TEXT, half).resumed == 20


@pytest.mark.parametrize("how", ["missing", "cut"])
def test_the_dataset_of_a_finished_campaign_tells_its_manifest(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    done, notes = copied(folders, "done", tmp_path), Notes()
    before, damaged = (done / "campaign.json").read_bytes(), DAMAGES[how](b"{}")
    (done / "campaign.json").unlink()
    if damaged is not None:
        (done / "campaign.json").write_bytes(damaged)
    assert campaign_here(monkeypatch, TEXT, done, notes=notes).resumed == 60
    assert notes.lines == [
        f"{done / 'campaign.json'} was {'missing' if how == 'missing' else 'damaged'} and is made "
        "again from dataset.nc."
    ]
    assert (done / "campaign.json").read_bytes() == before


class Killed(BaseException):
    """The end of a process in the middle of its work."""


def killed(*_: Any) -> None:
    raise Killed


@pytest.mark.parametrize(
    ("moment", "given"),
    [
        ("before the manifest", TEXT),
        ("before the manifest", LONGER),
        ("one old part is removed", LONGER),
        pytest.param("after the manifest", TEXT, marks=pytest.mark.long),
        pytest.param("after the manifest", LONGER, marks=pytest.mark.long),
        pytest.param("one old part is removed", TEXT, marks=pytest.mark.long),
    ],
)
def test_a_manifest_that_is_lost_while_a_campaign_is_extended_costs_no_computed_point(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str, given: str
) -> None:
    half = copied(folders, "half", tmp_path)
    write = write_content

    def written(path: Path, content: Any) -> None:
        if moment != "before the manifest":
            write(path, content)
            if moment == "one old part is removed":
                parts_of(half)[-1].unlink()
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(earlier_sweep, "write_content", written)
        with pytest.raises(Killed):
            campaign_here(patch, LONGER, half)
    (half / "campaign.json").unlink()
    rows = read_flat(half / "parts" / next(path.name for path in (half / "parts").glob("kept-*.nc")))
    report = campaign_here(monkeypatch, given, half)
    removed = 5 if moment == "one old part is removed" else 0
    assert report.resumed == (rows.sizes["run"] if given == LONGER else 20 - removed)
    campaign_here(monkeypatch, given, tmp_path / "undisturbed")
    assert_same_rows(half / "dataset.nc", tmp_path / "undisturbed" / "dataset.nc")


def test_an_extended_campaign_is_made_again_as_what_it_was_extended_to(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done, notes = copied(folders, "done", tmp_path), Notes()
    interrupt(monkeypatch, LONGER, done, 0)
    before = (done / "campaign.json").read_bytes()
    (done / "campaign.json").unlink()
    resumed = campaign_here(monkeypatch, LONGER, done, notes=notes).resumed
    assert resumed > 0
    assert notes.lines[0].endswith(".nc.")
    assert (done / "campaign.json").read_bytes() == before


@pytest.mark.parametrize("what", ["scene", "runner"])
def test_parts_of_two_campaigns_are_refused_by_name_and_nothing_is_touched(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    half = copied(folders, "half", tmp_path)
    stranger = parts_of(half)[2]
    if what == "scene":
        shutil.copy(parts_of(folders / "other")[0], stranger)
    else:
        content = json.loads(read_part(stranger).attrs[MANIFEST]) | {"instruction_set": "arm64"}
        write_dataset(read_flat(stranger).assign_attrs({MANIFEST: json.dumps(content)}), stranger)
    (half / "campaign.json").unlink()
    before = content_of(half)
    with pytest.raises(UsageError, match="got those of several") as caught:
        campaign_here(monkeypatch, TEXT, half)
    assert stranger.name in str(caught.value)
    assert content_of(half) == before
    assert not (half / "campaign.json").exists()


def test_a_part_of_another_scene_of_version_0_2_is_refused_by_name(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = copied(folders, "half", tmp_path)
    stranger = parts_of(half)[3]
    rows = read_flat(parts_of(folders / "other")[0])
    write_dataset(rows.assign_attrs({MANIFEST: ""}), stranger)
    (half / "campaign.json").unlink()
    with pytest.raises(UsageError, match=stranger.name):
        campaign_here(monkeypatch, TEXT, half)


def test_a_manifest_of_another_shape_in_a_part_is_none(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = copied(folders, "half", tmp_path)
    shapes = ["[]", '{"scene_hash": 1}', "[" * 100_000, '{"scene": [], "scene_text": 1, "sha256": 2}']
    for path, attribute in zip(parts_of(half), shapes, strict=True):
        write_dataset(read_flat(path).assign_attrs({MANIFEST: attribute}), path)
    (half / "campaign.json").unlink()
    with pytest.raises(UsageError, match=r"got data without campaign\.json"):
        campaign_here(monkeypatch, TEXT, half)


def text_of(points: int, remark: int = 0) -> str:
    return frequency_text(points, "up", milliseconds=0.001) + f"# {'why ' * remark}\n"


@pytest.mark.parametrize("text", [text_of(20_000), text_of(11, 5000)], ids=["long sweep", "long text"])
def test_a_part_carries_a_few_kilobytes_however_long_the_scene_is(tmp_path: Path, text: str) -> None:
    path, scene = tmp_path / "campaign.json", scene_of(text)
    write_manifest(path, scene, IDENTITY, 11)
    before, content = path.read_bytes(), read_content(path)
    carried = carried_manifest(content, scene.source)
    assert len(carried) < 8_000
    assert len(before) > 20_000
    (tmp_path / "parts").mkdir()
    part = tmp_path / "parts" / "branch-000000_runs-0000000000-0000000001.nc"
    rows = rows_in(tmp_path)
    write_dataset(rows.assign_attrs({MANIFEST: carried, "scene_hash": content["scene_hash"]}), part)
    found = manifest_again(tmp_path, scene)
    assert found is not None
    write_content(path, found[0])
    assert path.read_bytes() == before


def test_a_long_scene_has_to_be_given_again_but_for_its_comments(tmp_path: Path) -> None:
    path, scene = tmp_path / "campaign.json", scene_of(text_of(11, 5000))
    write_manifest(path, scene, IDENTITY, 11)
    content = read_content(path)
    (tmp_path / "parts").mkdir()
    attrs = {MANIFEST: carried_manifest(content, scene.source), "scene_hash": content["scene_hash"]}
    part = tmp_path / "parts" / "branch-000000_runs-0000000000-0000000001.nc"
    write_dataset(rows_in(tmp_path).assign_attrs(attrs), part)
    with pytest.raises(UsageError, match=r"branch-.*expected the scene that this campaign was started with"):
        manifest_again(tmp_path, scene_of(text_of(12, 5000)))
    found = manifest_again(tmp_path, scene_of(text_of(11)))
    assert found is not None
    write_content(path, found[0])
    manifest = read_manifest(path)
    assert manifest is not None
    assert manifest.scene_text == text_of(11)
    assert manifest.identity == IDENTITY


def rows_in(folder: Path) -> Any:
    """Return the dataset of two points."""
    with pytest.MonkeyPatch.context() as patch:
        campaign_here(patch, frequency_text(2, milliseconds=0.001), folder / "one")
    return read_flat(folder / "one" / "dataset.nc")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system")
@pytest.mark.parametrize("kind", ["pipe", "folder"])
def test_what_is_no_file_in_the_place_of_the_manifest_is_one_error(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    half = copied(folders, "half", tmp_path)
    (half / "campaign.json").unlink()
    (os.mkfifo if kind == "pipe" else os.mkdir)(half / "campaign.json")
    with pytest.raises(CampaignError, match=r"campaign\.json: expected a file that can be read and written"):
        campaign_here(monkeypatch, TEXT, half)
    assert len(parts_of(half)) == 4


@pytest.mark.parametrize(
    "content",
    [
        b"[" * 50_000_000,
        b"[" + b"[],".join([b""] * 5_000_000) + b"1]",
        b'{"a":' + b"1," * 6_000_000 + b"1}",
        b'"' + b"a" * 100_000_000 + b'"',
        b"\xff\xfe" * 20_000_000,
    ],
    ids=["nested", "lists", "numbers", "one text", "binary"],
)
@pytest.mark.long
def test_a_hostile_manifest_ends_soon(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "campaign.json").write_bytes(content)
    with pytest.raises(DamagedManifestError, match="got a damaged file"):
        read_manifest(tmp_path / "campaign.json")
