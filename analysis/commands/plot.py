"""What `vibroimpact plot` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import xarray as xr

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import open_dataset, open_measured
from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.analysis.dataset.results import file_attributes
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash
from vibroimpact.analysis.files.opening import DAMAGE, unreadable
from vibroimpact.analysis.recording import Recording, open_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say


def draw_file(file: Path, output: Path, kind: str, run: int | None, options: Mapping[str, Any]) -> None:
    """Draw a file that this package wrote; the options are those of `figures.draw`."""
    # as `open_dataset` takes the folder of a campaign
    file = file / "dataset.nc" if file.is_dir() else file
    refuse_outputs([file], None, output)
    try:
        with _opened(file) as data:
            figure = _drawn(file, data, lambda: figures.draw(data, kind, run, **options))
    except DAMAGE as problem:
        # Values are read when first used, so that damage may show only here. What bears the hash of its writer holds
        # what was written: there the fault is not the file's.
        if isinstance(problem, OSError | RuntimeError) or not matches_recorded_hash(file):
            raise unreadable(file, problem) from problem
        raise
    with writing(output):
        figures.save(figure, output)
    say(f"Figure written to {output}.")


def _opened(file: Path) -> AbstractContextManager[xr.Dataset | Recording]:
    """Open a recording, a dataset of runs, or what an analysis found or a benchmark measured."""
    attributes = file_attributes(file)
    if "recording_schema" in attributes:
        return nullcontext(open_recording(file))
    if "results_kind" in attributes:
        results = open_measured(file)
        if attributes["results_kind"] == "spikes" and "interval" not in results:
            results.close()
            raise UsageError(
                f"{file}: expected at least three spikes, whose intervals can be drawn, got fewer. "
                "`vibroimpact spikes --figure` draws them beside the signal."
            )
        return results
    if "dataset_schema" not in attributes:
        measured = open_measured(file)
        if "error" in measured:
            return measured
        measured.close()
    return open_dataset(file)


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
