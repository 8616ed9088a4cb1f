"""Operation `sensitivity`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import (
    DatasetFile,
    Door,
    FigureFile,
    Force,
    Operation,
    Option,
    Positional,
    study,
)

#: Confidence of the intervals of Sobol indices, and number of bootstrap resamples.
LEVEL, RESAMPLES = 0.95, 1000


@study("analysis.sensitivity.report:SensitivityOfCampaign", Door("sensitivity"))
class Sensitivity(Operation):
    """Compute the share of each drawn key of a campaign in the variance of each result (Sobol indices).

    First order: by the key alone; total: with all its interactions; each with a bootstrap interval. The sweep of the
    scene needs two keys or more with a distribution, and sample = { design = "saltelli", points = 256 }.

    Example: vibroimpact sensitivity campaign -o sensitivity.nc --figure sensitivity.png
    """

    file: Annotated[
        Path,
        Positional(
            python="dataset: xr.Dataset | PathLike",
            help="Dataset of a campaign with drawn keys (.nc, .zarr, address), or its folder.",
        ),
    ]
    output: DatasetFile = None
    figure: FigureFile = None
    of: Annotated[
        list[str] | None,
        Option(
            python="of: str | Sequence[str] = ()",
            help="Quantity to look at, displacement_range or another; again for more; default: all.",
        ),
    ] = None
    level: Annotated[float, Option(help="Of the bootstrap intervals, 0 to 1.")] = LEVEL
    resamples: Annotated[int, Option(help="Of the bootstrap.")] = RESAMPLES
    seed: Annotated[int, Option(help="Of the bootstrap.")] = 0
    force: Force = False
