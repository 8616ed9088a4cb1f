"""A lost or damaged `campaign.json`, made again from the other files of a campaign.

Each part carries the manifest (`manifest.carried_manifest`), and so do the rows kept from an earlier sweep. The dataset
of a finished campaign has the same facts among its attributes. Files of several campaigns are refused by name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vibroimpact.analysis.dataset import read_part
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.fmus.errors import DatasetError, UsageError, VibroimpactError
from vibroimpact.fmus.messages import WITH_OUTPUT, message
from vibroimpact.orchestrator.campaign.formats import has_dataset
from vibroimpact.orchestrator.campaign.manifest import (
    DAMAGE,
    FORMAT,
    Content,
    DamagedManifestError,
    Manifest,
    content_hash,
    flat_scene,
    read_manifest,
    scene_hash,
    values_of,
    write_content,
)
from vibroimpact.orchestrator.campaign.parts import Note, own_files
from vibroimpact.orchestrator.campaign.stores.seals import FINISHED, SEALS, read_sealed, seals_in
from vibroimpact.orchestrator.campaign.workers.chunks import MANIFEST
from vibroimpact.orchestrator.run import OTHER_ENGINE
from vibroimpact.orchestrator.scene import Scene, parse_scene

_CHANGING = ("continued_with", "sha256")
"""Keys in which parts of one campaign may differ, if other builds of the components went on with it."""
_RUNNER = ("execution", "instruction_set", "fmu_hashes", "engine")
"""Keys that stay the same when a campaign is extended to another sweep."""


@dataclass(frozen=True, slots=True)
class _Copy:
    """The manifest in a file with `runs` runs; `None` in it stands for values that the scene has."""

    path: AnyPath
    content: Content
    runs: int

    @property
    def scene_hash(self) -> str:
        return str(self.content["scene_hash"])

    @property
    def shared(self) -> str:
        """The keys that all parts of one campaign share, as text."""
        return json.dumps({key: value for key, value in self.content.items() if key not in _CHANGING})

    @property
    def runner(self) -> list[Any]:
        engine = {"engine": OTHER_ENGINE}
        return [(engine | self.content).get(key) for key in _RUNNER]

    @property
    def builds(self) -> list[Any]:
        return list(self.content.get("continued_with", ()))

    def is_of_campaign(self, other: _Copy, *, any_sweep: bool) -> bool:
        """Return whether two files belong to one campaign; one of them may list fewer of its builds."""
        is_same = self.runner == other.runner if any_sweep else self.shared == other.shared
        return is_same and all(was == now for was, now in zip(self.builds, other.builds, strict=False))


@dataclass(slots=True)
class _Folder:
    """The sound files in a folder of parts: with a copy of the manifest, or (older) only with the hash of a scene."""

    parts: list[_Copy] = field(default_factory=list)
    kept: list[_Copy] = field(default_factory=list)
    older: list[tuple[AnyPath, str]] = field(default_factory=list)


def manifest_of_folder(home: AnyPath, scene: Scene, note: Note) -> Manifest | None:
    """Return the manifest of a folder, made again from its copies where it is lost; None for a new campaign.

    Raises
    ------
    UsageError
        The manifest is damaged or missing, and cannot be made again from the data that are there.
    """
    path, damage = home / "campaign.json", None
    try:
        manifest = read_manifest(path)
    except DamagedManifestError as error:
        manifest, damage = None, error
    made = manifest_again(home, scene) if manifest is None else None
    if made is not None:
        content, origin = made
        write_content(path, content)
        note(f"{path} was {'damaged' if damage else 'missing'} and is made again from {origin}.")
        manifest = read_manifest(path)
    if manifest is None and damage is not None:
        raise damage
    parts = home / "parts"
    if manifest is None and ((parts.is_dir() and own_files(parts)) or has_dataset(home)):
        raise UsageError(
            message(
                f"{home}: expected an empty folder or one of a campaign, got data without campaign.json. "
                "Choose another folder",
                WITH_OUTPUT,
                ".",
            )
        )
    return manifest


def manifest_again(home: AnyPath, scene: Scene) -> tuple[Content, str] | None:
    """Return the manifest in the files of a campaign, and the files in words; None where no file has it.

    `home` is the folder of the campaign, and `scene` is the scene of the present command. UsageError: the files belong
    to several campaigns, or the manifest needs another scene for its left-out values.
    """
    there = _read(home / "parts", home / SEALS)
    finished = _finished(home / "dataset.nc", scene)
    chosen = _chosen(there, finished, scene_hash(scene))
    if chosen is None:
        return None
    count = sum(copy.shared == chosen.shared for copy in there.parts)
    origin = "1 part" if count == 1 else f"{count} parts" if count else chosen.path.name
    return _completed(chosen, scene), origin


def _read(folder: AnyPath, seals: AnyPath) -> _Folder:
    found = _Folder()
    for path in [*seals_in(seals), seals / FINISHED]:
        try:
            seal = read_sealed(path)
        except DatasetError:
            continue  # the resumed campaign names and removes it
        content = _content_in(seal["attrs"])
        if content is not None:
            found.parts.append(_Copy(path, content, seal.get("runs", 0)))
    for path in sorted(own_files(folder)) if folder.is_dir() else ():
        try:
            part = read_part(path)
        except DatasetError:
            continue  # the resumed campaign names and removes it
        content = _content_in(part.attrs)
        if content is None:
            found.older.append((path, str(part.attrs.get("scene_hash"))))
        else:
            copies = found.kept if path.name.startswith("kept-") else found.parts
            copies.append(_Copy(path, content, len(part.run_index)))
    return found


def _content_in(attrs: Mapping[str, Any]) -> Content | None:
    """Return the manifest among the attributes of a part; None in a part of version 0.2 or older."""
    try:
        content: Content = json.loads(str(attrs[MANIFEST]))
        shapes = {"scene": dict | None, "scene_text": str | None, "sha256": str}
        fits = all(isinstance(content[key], shape) for key, shape in shapes.items())
        fits &= isinstance(content.get("continued_with", []), list)
        return content if fits and content["scene_hash"] == attrs["scene_hash"] else None
    except DAMAGE:
        return None


def _finished(path: AnyPath, scene: Scene) -> _Copy | None:
    """Return the manifest from the dataset of a finished campaign; None for any other dataset."""
    if not path.is_file():
        return None
    try:
        part = read_part(path)
        runs = len(part.run_index)
        return _Copy(path, _content_of_dataset(part.attrs, runs, scene), runs)
    except (VibroimpactError, *DAMAGE):
        return None


def _content_of_dataset(attrs: Mapping[str, Any], runs: int, scene: Scene) -> Content:
    text = str(attrs["scene"])
    content: Content = {
        "format": FORMAT,
        "scene_hash": str(attrs["scene_hash"]),
        "runs": runs,
        "execution": str(attrs["execution"]),
        "instruction_set": str(attrs["instruction_set"]),
        "fmu_hashes": json.loads(str(attrs["fmu_hashes"])),
        "engine": int(attrs.get("engine_version", OTHER_ENGINE)),
        "versions": json.loads(str(attrs["versions"])),
        "git_commit": str(attrs["git_commit"]),
        "scene": flat_scene(parse_scene(text, scene.source)),
        "scene_text": text,
    }
    if "continued_with" in attrs:
        content["continued_with"] = json.loads(str(attrs["continued_with"]))
    return content | {"sha256": content_hash(content)}


def _chosen(there: _Folder, finished: _Copy | None, given: str) -> _Copy | None:
    """Return the copy of the manifest to which a folder belongs; None where no file has a copy.

    During an extension, the folder has the parts of the earlier sweep and the rows kept for the new sweep. The folder
    belongs to the new sweep if its scene is given, else to the earlier sweep.
    """
    begins = [copy for copy in there.kept if copy.scene_hash == given]
    kept = sorted(there.kept, key=lambda copy: -copy.runs)
    candidates = begins or there.parts or ([finished] if finished is not None else kept)
    if not candidates:
        return None
    first = candidates[0]
    _refuse_several(first, there, extended=bool(begins))
    same = [copy for copy in (*there.parts, *there.kept) if copy.shared == first.shared]
    return max([first, *same], key=lambda copy: len(copy.builds))


def _refuse_several(first: _Copy, there: _Folder, *, extended: bool) -> None:
    """Raise UsageError unless all files in a folder of parts belong to one campaign."""
    strangers = [copy.path for copy in there.kept if not copy.is_of_campaign(first, any_sweep=True)]
    for copy in there.parts:
        known = copy.is_of_campaign(first, any_sweep=extended)
        if not known or not copy.is_of_campaign(there.parts[0], any_sweep=False):
            strangers.append(copy.path)
    if not extended:
        strangers += [path for path, hashed in there.older if hashed != first.scene_hash]
    if strangers:
        more = f" and {len(strangers) - 1} more" if len(strangers) > 1 else ""
        raise UsageError(
            f"{first.path.parent.parent}: expected files of one campaign, to make campaign.json again, got those of "
            f"several: {first.path.name} is not of the campaign of {strangers[0].name}{more}. Move the files of the "
            "other campaign away, or put a copy of campaign.json back."
        )


def _completed(copy: _Copy, scene: Scene) -> Content:
    """Return a manifest with the values that its copy leaves to the scene; UsageError for another scene."""
    content = dict(copy.content)
    if content["scene_text"] is None and scene_hash(scene) == content["scene_hash"]:
        content |= {"scene": flat_scene(scene), "scene_text": scene.text}
        return content | {"sha256": content_hash(content)}  # comments and title may differ
    if content["scene"] is not None:
        values = content["scene"].items()
        known = values_of(content["scene_text"], scene.source) if None in content["scene"].values() else {}
        content["scene"] = {key: known.get(key) if value is None else value for key, value in values}
    if content["sha256"] != content_hash(content):
        raise UsageError(
            f"{copy.path}: expected the scene that this campaign was started with, to make campaign.json again, got "
            "another one. Give that scene, or put a copy of campaign.json back."
        )
    return content
