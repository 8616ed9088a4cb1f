"""Hard cases of impacts: the error of each claim about them, measured on this machine."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from vibroimpact.given import PathLike, given_result
from vibroimpact.orchestrator.hard_cases.study import MeasuredCases
from vibroimpact.returned import of_study


def hard_cases(only: str | Sequence[str] = (), path: PathLike | None = None) -> xr.Dataset:
    """Run the cases that break solvers of impacts, and measure how well each claim holds on this machine.

    Parameters
    ----------
    only : str or sequence of str
        Names of the cases to run. By default all named cases of docs/hard_cases.md run.
    path : path, optional
        Dataset file to write as well (.nc).

    Returns
    -------
    xarray.Dataset
        Each `case` has a measured `figure`, its `bound` and `is_met`. `name`, `claim` and `reference` describe the case
        in words; `x` and `y` are its drawn curve. `attrs["missed"]` names the cases whose bound is missed.

    Raises
    ------
    UsageError
        A case is unknown or named twice, or the dataset cannot be written.

    Examples
    --------
    >>> found = hard_cases("grazing-from-below")
    >>> float(found.figure[0]), bool(found.is_met[0])
    (0.0, True)
    """
    target = given_result(path, [])
    return of_study(MeasuredCases([only] if isinstance(only, str) else only), target)
