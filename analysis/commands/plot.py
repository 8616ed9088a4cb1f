"""What `vibroimpact plot` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from vibroimpact.analysis import figures
from vibroimpact.analysis.commands.opened_file import opened_file
from vibroimpact.analysis.dataset import dataset_file
from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say


def draw_file(file: Path, output: Path, kind: str, run: int | None, options: Mapping[str, Any]) -> None:
    """Draw a file that this package wrote; the options are those of `figures.draw`."""
    file = dataset_file(file)
    refuse_outputs([file], None, output)
    with opened_file(file) as data:
        _refuse_few_spikes(file, data)
        figure = _drawn(file, data, lambda: figures.draw(data, kind, run, **options))
    with writing(output):
        figures.save(figure, output)
    say(f"Figure written to {output}.")


def _refuse_few_spikes(file: Path, data: xr.Dataset | Recording) -> None:
    if isinstance(data, Recording) or data.attrs.get("results_kind") != "spikes":
        return
    if "interval" not in data:
        raise UsageError(
            f"{file}: expected at least three spikes, whose intervals can be drawn, got fewer. "
            "`vibroimpact spikes --figure` draws them beside the signal."
        )


def _drawn(file: Path, data: xr.Dataset | Recording, draw: Callable[[], figures.Figure]) -> figures.Figure:
    """Return the figure of a file; results may lack what their figure shows, or be another's."""
    kind = data.attrs.get("results_kind")
    if kind is None:
        return draw()
    try:
        return draw()
    except (LookupError, ValueError, TypeError, AttributeError) as problem:
        raise DatasetError(
            f"{file}: expected what `vibroimpact {kind}` writes, got other contents: {str(problem)[:200]}"
        ) from problem
