"""Hard cases of impacts, and how well each claim about them holds on this machine."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from vibroimpact.given import PathLike, given_result
from vibroimpact.orchestrator.hard_cases.study import MeasuredCases
from vibroimpact.returned import of_study


def hard_cases(only: str | Sequence[str] = (), path: PathLike | None = None) -> xr.Dataset:
    """Run what breaks solvers of impacts, and measure how well each claim about it holds on this machine.

    Parameters
    ----------
    only : str or sequence of str
        Names of the cases to run; none: all of docs/hard_cases.md that have one.
    path : path, optional
        The dataset to write as well (.nc).

    Returns
    -------
    xarray.Dataset
        `figure`, `bound` and `is_met` of each `case`, what is drawn of it (`x`, `y`), and its `name`, `claim` and
        `reference` in words; `attrs["missed"]` names those whose bound is missed.

    Raises
    ------
    UsageError
        There is no such case, or one is named twice, or the dataset cannot be written there.

    Examples
    --------
    >>> found = hard_cases("grazing-from-below")
    >>> float(found.figure[0]), bool(found.is_met[0])
    (0.0, True)
    """
    target = given_result(path, [])
    return of_study(MeasuredCases([only] if isinstance(only, str) else only), target)
