"""`campaign.json`: what a campaign folder was started with, so that it is only ever resumed with the same.

A resumed campaign is bit-identical to an uninterrupted one. That holds only for the same scene, the same
components, the same way of running and the same instruction set; anything else is refused here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.analysis.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.chunks import RunnerIdentity
from vibroimpact.orchestrator.provenance import git_commit, versions
from vibroimpact.orchestrator.scene import Scene

FORMAT = 1
_LONGEST = 60  # characters of a value in a message
_MOST_DIFFERENCES = 5


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a campaign was started with.

    Attributes
    ----------
    scene : dict
        Every number and word of the scene by its key; comments and layout of the file do not count.
    scene_hash : str
        SHA-256 of `scene`.
    content : dict
        The whole file.
    """

    scene: Mapping[str, Any]
    scene_hash: str
    content: Mapping[str, Any]


def flat_scene(scene: Scene) -> dict[str, Any]:
    """Return a scene as one value for each key, in a fixed order.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene import parse_scene
    >>> text = "[body]\\nmass = 2  # heavy\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
    >>> flat_scene(parse_scene(text, "free.toml"))["body.mass"]
    2.0
    """
    document = scene.model_dump(mode="json", by_alias=True, exclude={"source", "text"})
    document["stop"] = document.pop("stops")
    document["sweep"] = {
        axis["key"]: {"values": axis["values"], "path": axis["path"]} for axis in document["sweep"]
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
    """Return the SHA-256 of a scene: the same for two files that differ in comments and layout only."""
    return hashlib.sha256(json.dumps(flat_scene(scene)).encode()).hexdigest()


def write_manifest(path: Path, scene: Scene, identity: RunnerIdentity, runs: int) -> None:
    """Write the manifest of a campaign that begins, whole or not at all."""
    content = {
        "format": FORMAT,
        "scene_hash": scene_hash(scene),
        "runs": runs,
        "execution": identity.execution,
        "instruction_set": identity.instruction_set,
        "fmu_hashes": dict(identity.fmu_hashes),
        "versions": versions(),
        "git_commit": git_commit(),
        "scene": flat_scene(scene),
        "scene_text": scene.text,
    }
    write_atomically(path, json.dumps(content, indent=1).encode())


def read_manifest(path: Path) -> Manifest | None:
    """Read the manifest of a folder; None when there is none.

    Raises
    ------
    UsageError
        When the file is damaged or of another format.
    """
    try:
        content = json.loads(path.read_bytes())
        if content["format"] != FORMAT:
            raise UsageError(
                f"{path}: expected format {FORMAT}, got {content['format']}. Use another folder."
            )
        return Manifest(content["scene"], content["scene_hash"], content)
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(
            f"{path}: expected the manifest of a campaign, got a damaged file ({error}). Use another folder."
        ) from error


def refuse_other_scene(path: Path, manifest: Manifest, scene: Scene) -> None:
    """Refuse to go on with another scene than the one the campaign was started with.

    Raises
    ------
    UsageError
        With the keys that differ.
    """
    if manifest.scene_hash == scene_hash(scene):
        return
    differences = list(_differences(manifest.scene, flat_scene(scene)))
    shown = "; ".join(differences[:_MOST_DIFFERENCES])
    hidden = len(differences) - _MOST_DIFFERENCES
    more = f"; and {hidden} more" if hidden > 0 else ""
    raise UsageError(
        f"{path.parent}: expected the scene that this campaign was started with, got a changed one: "
        f"{shown}{more}. Choose another folder with -o, or restore the scene to resume."
    )


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    for key in sorted(old.keys() | new.keys()):
        if old.get(key) != new.get(key):
            yield f"{key} was {_shown(old.get(key))}, is {_shown(new.get(key))}"


def _shown(value: Any) -> str:
    if value is None:
        return "absent"
    if isinstance(value, list) and len(value) > 3:
        return f"{len(value)} values from {value[0]} to {value[-1]}"
    text = json.dumps(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def refuse_other_runner(path: Path, manifest: Manifest, identity: RunnerIdentity) -> None:
    """Refuse to mix results of different components, ways of running or instruction sets.

    Raises
    ------
    UsageError
        With what differs.
    """
    now = {
        "execution": identity.execution,
        "instruction_set": identity.instruction_set,
        "fmu_hashes": dict(identity.fmu_hashes),
    }
    old = {key: manifest.content.get(key) for key in now}
    differences = "; ".join(_differences(dict(_flat("", old)), dict(_flat("", now))))
    if differences:
        raise UsageError(
            f"{path.parent}: expected the components and machine that this campaign was started with: "
            f"{differences}. Results of two kinds are never mixed: choose another folder with -o."
        )
