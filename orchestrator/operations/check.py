"""Operation `check`."""

from __future__ import annotations

from vibroimpact.fmus.operations import Door, Operation, operation
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile, Strict


@operation("orchestrator.commands.check:check_scene", Door("cost_of"))
class Check(Operation):
    """Say what is wrong with a scene or, where nothing is, what would run and what it would cost.

    One point of the scene is computed, the middle one of its sweep, for 20 s at most; times, memory and sizes are
    those of this point, for all points. Nothing is written. Exit code 2: the scene has problems; 1: the point failed.

    Example: vibroimpact check examples/bifurcation.toml
    """

    scene: SceneFile
    changes: Changes = None
    strict: Strict = False
