"""The command `vibroimpact plot`."""

from __future__ import annotations

from contextlib import nullcontext

import xarray as xr

from vibroimpact.analysis import figures
from vibroimpact.analysis.commands.opened_file import opened_file
from vibroimpact.analysis.dataset import dataset_place
from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.analysis.operations.plot import Plot
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say

_DRAWN = ("recording", "start", "stop", "periods", "segment", "variable", "title", "width", "height")
"""Arguments that `figures.draw` takes as well."""


def draw_file(options: Plot) -> None:
    """Draw a file that this package wrote, or draw one file over another."""
    file, output = dataset_place(options.file), options.output
    drawn = {name: getattr(options, name) for name in _DRAWN}
    below = None if options.over is None else dataset_place(options.over)
    refuse_outputs([file, *([] if below is None else [below])], None, output)
    with opened_file(file) as data, nullcontext() if below is None else opened_file(below) as other:
        if isinstance(other, Recording):
            raise UsageError(f"{below}: expected a dataset of runs, got a recording.")
        results = data.attrs.get("results_kind")
        if isinstance(data, xr.Dataset) and results == "spikes" and "interval" not in data:
            raise UsageError(
                f"{file}: expected at least three spikes, whose intervals can be drawn, got fewer. "
                "`vibroimpact spikes --figure` draws them beside the signal."
            )
        try:
            figure = figures.draw(data, options.kind, options.run, **drawn, over=other)
        except (LookupError, ValueError, TypeError, AttributeError) as problem:
            # the results may lack the variables of their figure, or be another program's
            if results is None:
                raise
            raise DatasetError(
                f"{file}: expected what `vibroimpact {results}` writes, got other contents: {str(problem)[:200]}"
            ) from problem
    with writing(output):
        figures.save(figure, output)
    say(f"Figure written to {output}.")
