"""Messages of the command line on points: the number of failures, the first failed points, and warnings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, open_dataset
from vibroimpact.analysis.files.stores import Place
from vibroimpact.fmus.messages import counted

FAILED = (Outcome.error, Outcome.crash, Outcome.timeout)
"""Outcomes of points without a result; other outcomes are physics."""
MOST_LISTED = 10
MOST_WARNINGS = 3
"""Most different warnings that a command repeats."""
MOST_RUNS_READ = 100_000
"""Most runs of a campaign for which warnings are printed; larger ones keep them in the dataset."""
LONGEST_MESSAGE = 400


def outcome_lines(place: Place, runs: int) -> Iterator[str]:
    """Yield the messages on a dataset's points: failures, and warnings of points that went well."""
    with open_dataset(place) as dataset:
        yield from failure_lines(dataset)
        if runs <= MOST_RUNS_READ:
            yield from _warning_lines(dataset)


def failure_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield one line for each outcome of failed points, then one for each of the first failed points.

    Messages are read only when a point failed.
    """
    outcome = dataset.outcome.values
    failed = np.argwhere(np.isin(outcome, FAILED))
    if len(failed) == 0:
        return
    for kind in FAILED:
        if count := int((outcome == kind).sum()):
            yield f"{counted(count, 'point')} ended with the outcome {kind.name}:"
    run = np.atleast_1d(dataset.run_id.values[tuple(failed.T)])
    message = dataset.message.values
    for place in failed[np.argsort(run)][:MOST_LISTED]:
        text = " ".join(str(message[tuple(place)]).split())
        shown = text if len(text) <= LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 3]}..."
        yield f"  {_where(dataset, place)}{shown}"
    if len(failed) > MOST_LISTED:
        yield f"  {len(failed) - MOST_LISTED} more are in the dataset with their messages."


def _where(dataset: xr.Dataset, place: NDArray[np.intp]) -> str:
    """Return the swept values of a point; empty for the only point of a scene."""
    values = [
        f"{name} = {dataset[name].values[index]}"
        for name, index in zip(dataset.outcome.dims, place, strict=True)
    ]
    return f"{', '.join(values)}: " if values else ""


def _warning_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the messages of runs that went well: such a message is a warning of the body."""
    fine = np.isin(dataset.outcome.values, [Outcome.ok, Outcome.stuck])
    messages = sorted({str(text) for text in dataset.message.values[fine] if text})
    for message in messages[:MOST_WARNINGS]:
        yield f"warning: {message}"
    if len(messages) > MOST_WARNINGS:
        yield f"{len(messages) - MOST_WARNINGS} more warnings are in the dataset."
