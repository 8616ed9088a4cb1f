"""What the command line says of points that failed: how many, and the first of them with their messages."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome

FAILED = (Outcome.error, Outcome.crash, Outcome.timeout)
"""Outcomes of points without a result; the others are physics."""
MOST_LISTED = 10
LONGEST_MESSAGE = 400


def failure_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield one line for each outcome that failed points have, then one for each of the first points.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `open_dataset` returns it. Messages are read only when a point failed.
    """
    outcome = dataset.outcome.values
    failed = np.argwhere(np.isin(outcome, FAILED))
    if len(failed) == 0:
        return
    for kind in FAILED:
        count = int((outcome == kind).sum())
        if count:
            yield f"{count} {'point' if count == 1 else 'points'} ended with the outcome {kind.name}:"
    run = np.atleast_1d(dataset.run_id.values[tuple(failed.T)])
    message = dataset.message.values
    for place in failed[np.argsort(run)][:MOST_LISTED]:
        text = " ".join(str(message[tuple(place)]).split())
        shown = text if len(text) <= LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 3]}..."
        yield f"  {_where(dataset, place)}{shown}"
    if len(failed) > MOST_LISTED:
        yield f"  {len(failed) - MOST_LISTED} more are in the dataset with their messages."


def _where(dataset: xr.Dataset, place: NDArray[np.intp]) -> str:
    """Return the swept values of a point; nothing for the only point of a scene."""
    values = [
        f"{name} = {dataset[name].values[index]}"
        for name, index in zip(dataset.outcome.dims, place, strict=True)
    ]
    return f"{', '.join(values)}: " if values else ""
