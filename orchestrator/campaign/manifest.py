"""`campaign.json`: scene, components and machine at the start of a campaign, so that it resumes only with the same.

A resumed campaign is bit-identical to an uninterrupted one. That holds only for the same scene, the same
components, the same way of running and the same instruction set; anything else is refused here.

Each part carries the manifest, too, in one attribute of a few kB (`carried_manifest`). `manifest_copies` makes
`campaign.json` again from this attribute. Long values are left out: they are in the text of the scene, and a SHA-256
verifies them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from vibroimpact.analysis.dataset.provenance import git_commit, versions
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.object_paths import AnyPath, bounded_bytes, raise_outage
from vibroimpact.fmus.errors import SceneError, UsageError, VibroimpactError
from vibroimpact.fmus.messages import WITH_OUTPUT, message
from vibroimpact.orchestrator.run import OTHER_ENGINE, RunnerIdentity
from vibroimpact.orchestrator.run.provenance import provenance
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import SpacedValues

NAME = "campaign.json"
FORMAT, STORE_FORMAT = 2, 3
_FORMATS = (1, FORMAT, STORE_FORMAT)
"""Format 1, of version 0.1, has no hash of itself, and its title counts in `scene_hash`. Format 3 has a store."""
NO_EFFECT = ("title",)
"""Keys without effect on any result: a campaign goes on when they change."""
MOST_CARRIED_TEXT = 8192
"""Length of a scene's text, characters, above which a part carries neither text nor values, only their hash."""
MOST_CARRIED_VALUE = 256
"""Length of a value as JSON, characters, above which a part leaves the value to the text of the scene."""
DAMAGE = (ValueError, LookupError, TypeError, AttributeError, RecursionError)
"""Errors by content that has not the shape of a manifest."""
_LONGEST = 60  # characters of a value in a message
_MOST_DIFFERENCES = 5
_LARGEST = 96 * 2**20
"""Largest size of a manifest that is read, bytes; four axes of a million values are below."""
_MOST_OF = {b",": 4_500_000, b"[": 100_000, b"{": 100_000, b":": 1_000_000}
"""Largest number of each character in a manifest that is read; parsing more would take above 300 MB of memory."""

Content = dict[str, Any]
"""Content of `campaign.json`."""


class DamagedManifestError(UsageError):
    """The file of a manifest does not have the content that was written."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """The scene and the runner at the start of a campaign."""

    scene: Mapping[str, Any]
    """Every number and word of the scene by its key; comments and layout of the file do not count."""
    scene_hash: str
    """SHA-256 of the keys of `scene` that affect results; every part of the campaign has it."""
    scene_text: str
    """TOML text of the scene."""
    runs: int
    """Number of runs of the campaign."""
    identity: RunnerIdentity
    """Identity of the runner at the start."""
    continued_with: tuple[Mapping[str, Any], ...] = ()
    """Other builds of the components that went on with the campaign, each as written by `add_build`."""
    shard_points: int = 0
    """Number of points of a shard of the campaign's store; 0: its dataset is a file."""

    def attributes(self, scene: Scene) -> dict[str, Any]:
        """Return the global attributes of the campaign's dataset: the runner at its start, and other builds."""
        found = provenance(scene, self.identity)
        if self.continued_with:
            found["continued_with"] = json.dumps(self.continued_with)
        return found


def flat_scene(scene: Scene) -> dict[str, Any]:
    """Return a scene as one value for each key, in a fixed order.

    >>> from vibroimpact.orchestrator.scene import parse_scene
    >>> text = "[body]\\nmass = 2  # heavy\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
    >>> flat_scene(parse_scene(text, "free.toml"))["body.mass"]
    2.0
    """
    document = scene.model_dump(mode="json", by_alias=True, exclude={"source", "text", "sweep"})
    document["stop"] = document.pop("stops")
    document["sweep"] = {
        axis.key: {
            "values": asdict(axis.values) if isinstance(axis.values, SpacedValues) else list(axis.values),
            "path": axis.path,
            "place": place,
            # absent in campaigns of versions without such axes
            "together": axis.together or None,
            "adaptive": axis.adaptive and asdict(axis.adaptive),
        }
        for place, axis in enumerate(scene.sweep, start=1)
    }
    return dict(sorted(_flat("", document)))


def _flat(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(f"{key}.{name}" if key else name, inner)
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for number, inner in enumerate(value, start=1):
            yield from _flat(f"{key}[{number}]", inner)
    elif value is not None:
        yield key, value


def scene_hash(scene: Scene) -> str:
    """Return the SHA-256 of a scene, the same for two files that differ only in comments, layout and title."""
    return _hash_of({key: value for key, value in flat_scene(scene).items() if key not in NO_EFFECT})


def _hash_of(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def holds_scene(attrs: Mapping[str, Any], scene: Scene) -> bool:
    """Return whether a dataset with these global attributes was made from a scene, up to comments and layout."""
    text = str(attrs.get("scene", ""))
    try:
        return bool(text) and (
            text == scene.text or scene_hash(parse_scene(text, scene.source)) == scene_hash(scene)
        )
    except SceneError:
        return False


def new_manifest(
    scene: Scene,
    identity: RunnerIdentity,
    runs: int,
    continued_with: Sequence[Mapping[str, Any]] = (),
    *,
    shard_points: int = 0,
) -> Content:
    """Return the manifest of a new campaign; `shard_points` as in `Manifest`."""
    content: Content = {
        "format": STORE_FORMAT if shard_points else FORMAT,
        "scene_hash": scene_hash(scene),
        "runs": runs,
        **asdict(identity),
        "versions": versions(),
        "git_commit": git_commit(),
        "scene": flat_scene(scene),
        "scene_text": scene.text,
    }
    if continued_with:
        content["continued_with"] = list(continued_with)
    if shard_points:
        content["store"] = {"shard_points": shard_points}
    return content


def add_build(path: AnyPath, identity: RunnerIdentity, compared: int) -> None:
    """Add another build of the components to a manifest; `compared` points, computed again, were equal."""
    content = read_content(path)
    build = {
        "fmu_hashes": dict(identity.fmu_hashes),
        "versions": versions(),
        "git_commit": git_commit(),
        "points_compared": compared,
    }
    content["continued_with"] = [*content.get("continued_with", ()), build]
    write_content(path, content)


def write_manifest(
    path: AnyPath,
    scene: Scene,
    identity: RunnerIdentity,
    runs: int,
    shard_points: int = 0,
) -> None:
    """Write the manifest of a new campaign, whole or not at all."""
    write_content(path, new_manifest(scene, identity, runs, shard_points=shard_points))


def write_content(path: AnyPath, content: Content) -> None:
    """Write a manifest with its SHA-256, whole or not at all."""
    content = {key: value for key, value in content.items() if key != "sha256"}
    write_atomically(path, json.dumps(content | {"sha256": content_hash(content)}, indent=1).encode())


def content_hash(content: Content) -> str:
    """Return the SHA-256 of a manifest, computed without its key `sha256`."""
    return _hash_of({key: value for key, value in content.items() if key != "sha256"})


def read_manifest(path: AnyPath) -> Manifest | None:
    """Return the manifest of a folder; None where there is no manifest.

    Raises
    ------
    DamagedManifestError
        The manifest is no file, or its content has changed since it was written.
    UsageError
        The manifest has another format.
    """
    try:
        content = read_content(path)
        if content["format"] not in _FORMATS:
            raise UsageError(
                f"{path}: expected format {FORMAT}, got {_shown(content['format'])}. Use another folder."
            )
        return _checked(content)
    except FileNotFoundError:
        return None
    except (OSError, *DAMAGE) as error:
        raise_outage(path, error)
        reason = error.strerror if isinstance(error, OSError) else error
        raise DamagedManifestError(
            f"{path}: expected the manifest of a campaign, got a damaged file ({reason}). "
            "Put a copy of it back, or use another folder."
        ) from error


def keeps_scene(folder: Path) -> bool:
    """Return whether a folder is that of a campaign, which keeps its scene."""
    return (folder / NAME).is_file()


def kept_scene(folder: Path, changes: Sequence[str] = ()) -> Scene:
    """Return the scene that the folder of a campaign keeps.

    Bodies by matrices or by files have their modes as numbers. Other files are relative to the folder.

    Raises
    ------
    UsageError
        The folder is none of a campaign, or its manifest is damaged.
    SceneError
        A change is wrong.
    """
    path = folder / NAME
    manifest = read_manifest(path)
    if manifest is None:
        raise UsageError(f"{folder}: expected a scene file or the folder of a campaign, got another folder.")
    return parse_scene(manifest.scene_text, str(path), changes)


def read_content(path: AnyPath) -> Content:
    """Return the JSON of a file; raise ValueError unless its size and structure suit a manifest."""
    raw = bounded_bytes(path, _LARGEST)
    for character, most in _MOST_OF.items():
        if raw.count(character) > most:
            raise ValueError(f"it has more than {most} of the character {character.decode()!r}")
    text = raw.decode("ascii")  # as json.dumps writes it
    del raw
    content: Content = json.loads(text)
    return content


def _checked(content: Content) -> Manifest:
    """Return the manifest of some content, if the content has not changed since it was written.

    Other content raises ValueError, KeyError, TypeError or AttributeError.
    """
    recorded, found = content.get("sha256"), content_hash(content)
    if recorded is None and content["format"] == 1:
        recorded, found = content["scene_hash"], _hash_of(content["scene"])
    if recorded != found:
        raise ValueError("its content is not the one whose SHA-256 it has")
    identity = RunnerIdentity(
        content["execution"],
        content["instruction_set"],
        dict(content["fmu_hashes"]),
        int(content.get("engine", OTHER_ENGINE)),
    )
    return Manifest(
        dict(content["scene"]),
        content["scene_hash"],
        content["scene_text"],
        int(content["runs"]),
        identity,
        tuple(
            {**build, "fmu_hashes": dict(build["fmu_hashes"])} for build in content.get("continued_with", ())
        ),
        int(content["store"]["shard_points"]) if content["format"] == STORE_FORMAT else 0,
    )


def carried_manifest(content: Content, source: str) -> str:
    """Return the manifest of a campaign, the content of `campaign.json`, as JSON for its parts.

    `null` stands for values that the scene has; paths in the scene are relative to `source`.
    """
    text, values = content["scene_text"], content["scene"]
    content = {**content, "sha256": content_hash(content)}
    shown = {key: json.dumps(value) for key, value in values.items()}
    in_text: dict[str, str] = {}
    if len(text) > MOST_CARRIED_TEXT or any(len(one) > MOST_CARRIED_VALUE for one in shown.values()):
        in_text = {key: json.dumps(value) for key, value in values_of(text, source).items()}
    if len(text) > MOST_CARRIED_TEXT and in_text == shown:
        return json.dumps(content | {"scene": None, "scene_text": None})
    short = {
        key: None if len(shown[key]) > MOST_CARRIED_VALUE and in_text.get(key) == shown[key] else value
        for key, value in values.items()
    }
    return json.dumps(content | {"scene": short})


def values_of(text: str, source: str) -> dict[str, Any]:
    """Return the values of a scene's text in the form of a manifest; empty where the text cannot be read."""
    try:
        scene = parse_scene(text, source)
    except VibroimpactError:
        return {}
    return flat_scene(scene)


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the differences of two flat scenes, in keys that affect results, in words."""
    keys = sorted((old.keys() | new.keys()) - set(NO_EFFECT))
    return [
        f"{key} was {_shown(old.get(key))}, is {_shown(new.get(key))}"
        for key in keys
        # -0.0 and 0.0 differ as text
        if json.dumps(old.get(key)) != json.dumps(new.get(key))
    ]


def refuse_other_scene(path: AnyPath, different: Sequence[str]) -> NoReturn:
    """Raise UsageError with the first few differences from the scene with which the campaign was started."""
    shown = "; ".join(different[:_MOST_DIFFERENCES])
    hidden = len(different) - _MOST_DIFFERENCES
    more = f"; and {hidden} more" if hidden > 0 else ""
    raise UsageError(
        message(
            f"{path.parent}: expected the scene that this campaign was started with, got a changed one: "
            f"{shown}{more}. Choose another folder",
            WITH_OUTPUT,
            ", or restore the scene to resume.",
        )
    )


def _shown(value: Any) -> str:
    if value is None:
        return "absent"
    if isinstance(value, list) and len(value) > 3:
        return f"{len(value)} values from {value[0]} to {value[-1]}"
    text = json.dumps(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def runner_differences(manifest: Manifest, identity: RunnerIdentity) -> list[str]:
    """Return the differences of a runner from the runner of a campaign, in words; empty when they are equal."""
    if any(build["fmu_hashes"] == identity.fmu_hashes for build in manifest.continued_with):
        identity = replace(identity, fmu_hashes=manifest.identity.fmu_hashes)
    was, now = (dict(_flat("", asdict(one))) for one in (manifest.identity, identity))
    return differences(was, now)


def refuse_other_runner(path: AnyPath, different: Sequence[str], reason: str = "") -> NoReturn:
    """Raise UsageError, as results of different components, executions or instruction sets are never mixed.

    The message has the differences, and the reason why stored points do not prove equal results.
    """
    raise UsageError(
        message(
            f"{path.parent}: expected the components and machine that this campaign was started with: "
            f"{'; '.join(different)}. {reason}Results of two kinds are never mixed: choose another folder",
            WITH_OUTPUT,
            ", or go on with what it was started with.",
        )
    )
