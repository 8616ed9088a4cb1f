"""Where a dataset comes from: the attributes that let someone else make it again."""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.run.summary import in_one_line
from vibroimpact.orchestrator.scene import Scene

_PACKAGES = ("vibroimpact", "numpy", "fmpy", "xarray", "netCDF4", "dask", "distributed")
_GIT_SECONDS = 5.0


def provenance(scene: Scene, identity: RunnerIdentity) -> dict[str, Any]:
    """Return the global attributes of a dataset made from a scene."""
    return {
        "title": scene.title or Path(scene.source).stem,
        "source": f"vibroimpact {versions()['vibroimpact']}, scene {Path(scene.source).name}",
        "scene": scene.text,
        **program_attributes(),
        "fmu_hashes": json.dumps(dict(identity.fmu_hashes), sort_keys=True),
        "seed": _seed(scene),
        "execution": identity.execution,
        "engine": in_one_line(scene, identity.execution),
        "engine_version": identity.engine,
        "instruction_set": identity.instruction_set,
        **scene.found,
    }


def scene_attributes(scene: Scene, history: str) -> dict[str, Any]:
    """Return the global attributes of what a study found of a scene."""
    return {
        "title": scene.title or Path(scene.source).stem,
        "history": history,
        "source": f"vibroimpact {versions()['vibroimpact']}, scene {Path(scene.source).name}",
        "scene": scene.text,
        **program_attributes(),
    }


def runs_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the global attributes of what a study found of the runs of a dataset with these attributes."""
    kept = {name: attrs[name] for name in ("title", "scene", "units_system") if name in attrs}
    return kept | program_attributes()


def program_attributes() -> dict[str, Any]:
    """Return the global attributes that say which program made a dataset."""
    return {"versions": json.dumps(versions()), "git_commit": git_commit()}


def _seed(scene: Scene) -> str:
    """Return what is random in a dataset: noise where channels are sampled that have some."""
    if scene.general is not None:
        return "none of the scene's own; an FMU may have one among its parameters"
    if scene.noise is None or not scene.channels:
        return "none: nothing in the scene is random"
    return f"{scene.noise.seed}: noise of {', '.join(scene.channels)}"


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results may depend on."""
    return dict(_versions())


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    """Read them once in a process: each is a search of all packages that are installed."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "unknown"
    return found


@lru_cache(maxsize=1)
def git_commit() -> str:
    """Return the commit of the checkout this package runs from, `-dirty` when changed; else `unknown`."""
    here = Path(__file__).resolve()
    # A virtual environment may lie inside a checkout of something else: only our own tracked file counts.
    # Git need not be asked where the checkout begins at our own root.
    if not (here.parents[2] / ".git").exists() and _git("ls-files", "--error-unmatch", here.name) is None:
        return "unknown"
    return _git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*") or "unknown"


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(Path(__file__).resolve().parent), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_GIT_SECONDS, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
