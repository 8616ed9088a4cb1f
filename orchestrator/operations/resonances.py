"""Operation `resonances`."""

from __future__ import annotations

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneOrDataset


@study("orchestrator.orbits.resonances:PeaksOfSweep", Door("resonances", without=("output",)))
class Resonances(Operation):
    """Find the peaks of a frequency sweep, for the whole body and each mode, with the shifted natural frequencies.

    A stop shifts natural frequencies by the factor pi / arccos(-a / x): a is its position, x the deepest excursion on
    the other side. The factor is right for one elastic, undamped, unforced mode, else it is a guess. A scene is run
    first.

    Example: vibroimpact resonances examples/thesis/figure_6_4.toml --figure resonances.png
    """

    file: SceneOrDataset
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
