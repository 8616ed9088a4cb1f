"""Operation `lyapunov`."""

from __future__ import annotations

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneOrDataset


@study("orchestrator.orbits.lyapunov:ExponentsOfRuns", Door("lyapunov", without=("output",)))
class Lyapunov(Operation):
    """Find the Lyapunov exponents of runs with impacts, from the saltation of the impacts; their sum is checked.

    The body is an oscillator, a chain, a beam or several bodies; at least 200 impacts must
    count. A scene is run first. A run without exponents (no impacts, sticking) is listed with the reason.

    Example: vibroimpact lyapunov examples/thesis/figure_2_11.toml --set record.recorded_periods=2000
    """

    file: SceneOrDataset
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
