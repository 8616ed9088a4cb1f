"""Operation `resonances`."""

from __future__ import annotations

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneOrDataset


@study("orchestrator.orbits.resonances:PeaksOfSweep", Door("resonances", without=("output",)))
class Resonances(Operation):
    """Find the peaks of a sweep of the forcing frequency, of the whole body and of each mode, beside what shifts them.

    A stop shifts natural frequencies: by pi / arccos(-a / x), a its position, x the deepest excursion on the other
    side. That is right for one elastic, undamped, unforced mode, and else a guess. A scene is run first.

    Example: vibroimpact resonances examples/thesis/figure_6_4.toml --figure resonances.png
    """

    file: SceneOrDataset
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
