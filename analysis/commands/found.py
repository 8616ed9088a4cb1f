"""Where results of a command go: their places are looked at before anything runs, then they are written and drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

import xarray as xr

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.fmus.terminal import say


class Places(Protocol):
    """What operations with results declare: dataset, figure, and whether other files may be replaced."""

    @property
    def output(self) -> Path | None:
        """Dataset to write."""

    @property
    def figure(self) -> Path | None:
        """Figure to write."""

    @property
    def force(self) -> bool:
        """Whether a file that holds something else is replaced."""


def refuse_places(options: Places, read: Iterable[Path], **same: object) -> None:
    """Refuse places where results cannot be written, or where something else is.

    Parameters
    ----------
    read : iterable of Path
        Files that are read, and not written over.
    **same : object
        Attributes by which a dataset that is there counts as made by the same command before.

    Raises
    ------
    UsageError
    """
    refuse_outputs(list(read), options.output, options.figure)

    def is_the_same(there: Mapping[str, Any]) -> bool:
        return all(there.get(name) == value for name, value in same.items())

    refuse_overwriting(options.output, options.force, is_the_same)


def write_found(found: xr.Dataset, kind: str, options: Places) -> None:
    """Write and draw what was found, where that is asked for."""
    if options.output is not None:
        with writing(options.output):
            write_results(found, options.output, kind=kind)
        say(f"Dataset written to {options.output}.")
    if options.figure is not None:
        from vibroimpact.analysis import figures  # half a second, which a table needs not

        drawn = figures.draw(found.assign_attrs(results_kind=kind))
        with writing(options.figure):
            figures.save(drawn, options.figure)
        say(f"Figure written to {options.figure}.")
