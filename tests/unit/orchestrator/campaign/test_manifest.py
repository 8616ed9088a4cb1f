import json
from pathlib import Path

import pytest
from support.campaign_scenes import frequency_text, scene_of

from vibroimpact.analysis.files.folder_lock import locked_folder
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.campaign.home import answer_question, refuse_blind_workers
from vibroimpact.orchestrator.campaign.manifest import (
    Manifest,
    add_build,
    differences,
    flat_scene,
    read_content,
    read_manifest,
    refuse_other_runner,
    refuse_other_scene,
    runner_differences,
    scene_hash,
    write_content,
    write_manifest,
)
from vibroimpact.orchestrator.run import RunnerIdentity

TEXT = frequency_text(11, "up")
LOWER_STOP = "[[stop]]\nposition = -1.0\nside = 'lower'\nrestitution = 1.0\n"
IDENTITY = RunnerIdentity("fused", "x86_64", {"body": "a" * 64})


def written(folder: Path, text: str = TEXT) -> Manifest:
    write_manifest(folder / "campaign.json", scene_of(text), IDENTITY, 11)
    manifest = read_manifest(folder / "campaign.json")
    assert manifest is not None
    return manifest


def test_layout_and_comments_do_not_make_another_scene() -> None:
    same = "# a comment\n" + TEXT.replace("stiffness = 1.0", "stiffness   =  1.00")
    assert scene_hash(scene_of(same)) == scene_hash(scene_of(TEXT))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("restitution = 0.7", "restitution = 0.8", "stop[1].restitution was 0.7, is 0.8"),
        ("mass = 1.0", "mass = 2.0", "body.mass was 1.0, is 2.0"),
        ("points = 11", "points = 12", "angular_frequency.values was 11 values from 0.6 to 1.6, is 12"),
        ('path = "up"', 'path = "down"', 'sweep.forcing.angular_frequency.path was "up", is "down"'),
        ("[record]", f"{LOWER_STOP}[record]", "stop[2].position was absent, is -1.0"),
    ],
)
def test_a_changed_scene_is_refused_with_the_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    manifest = written(tmp_path)
    assert old in TEXT
    different = differences(manifest.scene, flat_scene(scene_of(TEXT.replace(old, new))))
    with pytest.raises(UsageError) as caught:
        refuse_other_scene(tmp_path / "campaign.json", different)
    assert message in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_the_same_scene_is_not_refused(tmp_path: Path) -> None:
    assert not differences(written(tmp_path).scene, flat_scene(scene_of(TEXT)))
    assert not runner_differences(written(tmp_path), IDENTITY)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (RunnerIdentity("batch", "x86_64", IDENTITY.fmu_hashes), 'execution was "fused", is "batch"'),
        (RunnerIdentity("fused", "arm64", IDENTITY.fmu_hashes), 'instruction_set was "x86_64", is "arm64"'),
        (RunnerIdentity("fused", "x86_64", {"body": "b" * 64}), "fmu_hashes.body was"),
    ],
)
def test_results_of_two_kinds_are_never_mixed(tmp_path: Path, other: RunnerIdentity, message: str) -> None:
    different = runner_differences(written(tmp_path), other)
    with pytest.raises(UsageError) as caught:
        refuse_other_runner(tmp_path / "campaign.json", different)
    assert message in str(caught.value)


def test_a_build_that_is_added_is_known_and_the_manifest_sound(tmp_path: Path) -> None:
    other = RunnerIdentity("fused", "x86_64", {"body": "b" * 64})
    written(tmp_path)
    add_build(tmp_path / "campaign.json", other, 8)
    manifest = read_manifest(tmp_path / "campaign.json")
    assert manifest is not None
    assert not runner_differences(manifest, other)
    assert not runner_differences(manifest, IDENTITY)
    assert runner_differences(manifest, RunnerIdentity("fused", "x86_64", {"body": "c" * 64}))


def test_versions_of_packages_are_told_and_no_part_of_what_a_campaign_is(tmp_path: Path) -> None:
    path = tmp_path / "campaign.json"
    written(tmp_path)
    content = read_content(path)
    before = {name: "0.2.0" for name in content["versions"]}
    assert before.keys() >= {"vibroimpact", "numpy"}
    write_content(path, content | {"versions": before, "git_commit": "unknown"})
    manifest = read_manifest(path)
    assert manifest is not None
    assert not differences(manifest.scene, flat_scene(scene_of(TEXT)))
    assert not runner_differences(manifest, IDENTITY)


def test_a_folder_without_a_manifest_has_none(tmp_path: Path) -> None:
    assert read_manifest(tmp_path / "campaign.json") is None


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": 1}', "\x00\x01"])
def test_a_damaged_manifest_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "campaign.json").write_text(content)
    with pytest.raises(UsageError, match="expected the manifest of a campaign"):
        read_manifest(tmp_path / "campaign.json")


@pytest.mark.parametrize("builds", ["x", [1], [{}], [{"fmu_hashes": 5}], {"a": 1}])
def test_builds_of_another_shape_are_damage(tmp_path: Path, builds: object) -> None:
    path = tmp_path / "campaign.json"
    scene = scene_of(TEXT)
    identity = RunnerIdentity("fused", "x86_64", {"body": "0"})
    write_manifest(path, scene, identity, 1, builds)  # type: ignore[arg-type]  # as another program might write it
    with pytest.raises(UsageError, match="got a damaged file"):
        read_manifest(path)


def test_a_manifest_of_a_later_format_is_refused(tmp_path: Path) -> None:
    written(tmp_path)
    content = json.loads((tmp_path / "campaign.json").read_text()) | {"format": 99}
    (tmp_path / "campaign.json").write_text(json.dumps(content))
    with pytest.raises(UsageError, match="expected format 2, got 99"):
        read_manifest(tmp_path / "campaign.json")


def test_a_folder_is_locked_once_and_free_again_afterwards(tmp_path: Path) -> None:
    refused = pytest.raises(UsageError, match="another campaign is running")
    with locked_folder(tmp_path), refused, locked_folder(tmp_path):
        pytest.fail("the folder was locked twice")
    with locked_folder(tmp_path):
        pass


class Pool:
    """Workers, one of which sees another folder."""

    def __init__(self, elsewhere: Path) -> None:
        self.elsewhere = elsewhere

    def call_everywhere(self, function: object, folder: str, name: str) -> dict[str, str]:
        return {
            "tcp://near:1": answer_question(folder, name),
            "tcp://far:2": answer_question(str(self.elsewhere), name),
        }


def test_workers_that_do_not_see_the_folder_are_refused_by_name(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "here", tmp_path / "there"
    folder.mkdir()
    elsewhere.mkdir()
    with pytest.raises(UsageError, match="got 1 that do not: tcp://far:2"):
        refuse_blind_workers(Pool(elsewhere), folder)  # type: ignore[arg-type]
    assert not list(folder.iterdir())
    refuse_blind_workers(Pool(folder), folder)  # type: ignore[arg-type]
