"""A measured frequency sweep: up and down in steps, extrema of each period (thesis section 3.3.1, appendix B.2.2).

`settings` reads the file of a sweep, and `plan` has the output sample by sample. `analysis` evaluates the samples of a
step, `dataset` keeps the results, `program` drives and measures. `command` is `vibroimpact rig sweep`.
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
    """Measure the frequency sweep of a file on a rig, or continue it.

    Parameters
    ----------
    file : path
        The file of a sweep (TOML).
    folder : path
        One sweep, one folder; it is made if absent. The dataset in it is `dataset.nc`.
    rig : str, optional
        `virtual:RIG.toml`, `grpc://host:port` or `local`; else as in the file, else the board of this machine.
    progress : bool
        Show the progress.

    Returns
    -------
    xarray.Dataset
        As from `open_dataset(folder)`. After Ctrl-C it has the finished steps, and the same call continues.

    Raises
    ------
    UsageError
        The file is wrong, the folder has other contents, or the rig lacks a terminal: nothing was driven.
    RigError
        The rig failed, or the motion is on another branch than before. Finished steps are in the folder.

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
