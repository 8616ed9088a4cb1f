"""Operation `convert`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Positional, operation


@operation("analysis.commands.convert:convert_file", Door("convert"))
class Convert(Operation):
    """Convert a dataset of runs from NetCDF to Zarr, or back: the same values and attributes.

    The ending of OUTPUT says which: .nc, or .zarr for a store in a folder or at an address (s3://bucket/map.zarr).

    Example: vibroimpact convert campaign campaign.zarr
    """

    file: Annotated[
        Path,
        Positional(
            python="file: Place", help="Dataset of runs (.nc, .zarr, address), or the folder of a campaign."
        ),
    ]
    output: Annotated[
        Path, Positional(python="output: Place", help="Dataset to write (.zarr, address; or .nc).")
    ]
    force: Force = False
