"""The origin of a dataset: the attributes with which someone else can make it again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibroimpact.analysis.dataset.clock import CLOCK_PERIODS
from vibroimpact.analysis.dataset.provenance import program_attributes, versions
from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.run.summary import in_one_line
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_models import RandomForcing


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
        **_clock(scene),
        **scene.found,
    }


def scene_attributes(scene: Scene, history: str) -> dict[str, Any]:
    """Return the global attributes of a study's dataset, for a study of a scene."""
    return {
        "title": scene.title or Path(scene.source).stem,
        "history": history,
        "source": f"vibroimpact {versions()['vibroimpact']}, scene {Path(scene.source).name}",
        "scene": scene.text,
    }


def runs_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the global attributes of a study's dataset, for a study of runs in a dataset with `attrs`."""
    return {name: attrs[name] for name in ("title", "scene", "units_system") if name in attrs}


def _clock(scene: Scene) -> dict[str, int]:
    """Return the periods of the first of several sines in a forcing period, 0 without a common period."""
    clock = scene.clock if scene.lists_forces else None
    return {} if clock is None else {CLOCK_PERIODS: clock.periods if clock.is_common else 0}


def _seed(scene: Scene) -> str:
    """Return the seeds of a dataset and their quantities, in words: of random forces, and of sampled channels."""
    if not scene.is_one_body:
        return "none of the scene's own; an FMU may have one among its parameters"
    forces = zip(scene.forcing_keys, scene.forces, strict=True)
    seeds = [f"{force.seed}: {key}" for key, force in forces if isinstance(force, RandomForcing)]
    if scene.noise is not None and scene.channels:
        seeds.append(f"{scene.noise.seed}: noise of {', '.join(scene.channels)}")
    return "; ".join(seeds) or "none: nothing in the scene is random"
