"""Operation `effects`."""

from __future__ import annotations

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.study.cost_of_effects:CostOfEffects", Door("effects"))
class Effects(Operation):
    """Say what a scene asks for, what each of it costs and changes, and what is not simulated.

    The scene is run with and without each effect (forcing, damping, stops, modes, what is recorded, how it runs), in
    five pairs in turn. A sweep is left out. Exit code 2: the scene has problems.

    Example: vibroimpact effects examples/thesis/figure_7_11.toml --figure effects.png
    """

    scene: SceneFile
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
