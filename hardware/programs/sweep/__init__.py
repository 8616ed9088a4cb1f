"""A measured frequency sweep: up and down in steps, extrema of each period (thesis section 3.3.1, appendix B.2.2).

`settings` reads the file of a sweep, `plan` is the output sample by sample, `analysis` says what the samples of a step
show, `dataset` keeps it, `program` drives and measures, `command` is `vibroimpact rig sweep`.
"""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr


def measure_sweep(
    file: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    rig: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Measure the frequency sweep of a file on a rig, or go on with it.

    Parameters
    ----------
    file : path
        Of a sweep (TOML).
    folder : path
        One sweep, one folder; made when absent. The dataset is `dataset.nc` in it.
    rig : str, optional
        `virtual:RIG.toml`, `grpc://host:port` or `local`; else as the file says, else the board of this machine.
    progress : bool
        Show how far it is.

    Returns
    -------
    xarray.Dataset
        As `open_dataset(folder)` gives it. After Ctrl-C it has the steps that were measured, and the same call goes on.

    Raises
    ------
    UsageError
        The file is wrong, the folder is of something else, or the rig lacks what is asked for: nothing was driven.
    RigError
        The rig failed, or the motion is on another branch than before. What was measured is in the folder.

    Examples
    --------
    >>> found = measure_sweep("sweep.toml", "sweep", rig="virtual:beam.toml")          # doctest: +SKIP
    >>> found.displacement_range.sel(direction="up")                                   # doctest: +SKIP
    """
    from vibroimpact.analysis.dataset import open_dataset
    from vibroimpact.hardware.programs.sweep.program import measure
    from vibroimpact.hardware.programs.sweep.settings import read_sweep
    from vibroimpact.orchestrator.run.progress import shown_progress

    settings = read_sweep(Path(file))
    with shown_progress() if progress else nullcontext() as shown:
        report = measure(settings, Path(folder), rig, shown)
    return open_dataset(report.dataset)
