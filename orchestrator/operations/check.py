"""Operation `check`."""

from __future__ import annotations

from vibroimpact.fmus.operations import Door, Operation, operation
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile, Strict


@operation("orchestrator.commands.check:check_scene", Door("cost_of"))
class Check(Operation):
    """Print the problems of a scene or, without any, its engine, its effects and its cost.

    One point of the scene is computed, the middle one of its sweep, for 20 s at most. Times, memory and sizes assume
    that all points are like it. No file is written. Exit code 2: the scene has problems; 1: the point failed.

    Example: vibroimpact check examples/bifurcation.toml
    """

    scene: SceneFile
    changes: Changes = None
    strict: Strict = False
