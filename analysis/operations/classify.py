"""Operation `classify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Positional, study


@study("analysis.orbits.classify:ClassesOfDataset", Door("classify", without=("output",)))
class Classify(Operation):
    """Classify each run of a dataset: P(p,q), chaos, rest, sticking, no impacts, or unknown with the reason.

    The classes come from the strobe and the extrema of each recorded period. A slow transient differs from a doubled
    period by its distances, which shrink by a constant factor. Chaos needs 40 recorded periods.

    Example: vibroimpact classify campaign -o classes.nc --figure classes.png
    """

    file: Annotated[
        Path,
        Positional(
            python="dataset: xr.Dataset",
            help="Dataset of runs (.nc, .zarr, address), or the folder of a campaign.",
        ),
    ]
    output: DatasetFile = None
    figure: FigureFile = None
    force: Force = False
