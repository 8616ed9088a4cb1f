"""Operation `effects`."""

from __future__ import annotations

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.study.cost_of_effects:CostOfEffects", Door("effects"))
class Effects(Operation):
    """List the effects of a scene, the cost and influence of each, and the effects that are not simulated.

    The scene runs with and without each effect (forcing, damping, stops, modes, recording, execution), in five pairs
    in turn. A sweep is ignored. Exit code 2: the scene has problems.

    Example: vibroimpact effects examples/thesis/figure_7_11.toml --figure effects.png
    """

    scene: SceneFile
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
