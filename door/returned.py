"""Datasets of studies, as callers get them; a file is written first where a path is given."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.study import Study, whole

ONE_AT_A_TIME = threading.Lock()
"""Lock for writing datasets and reading them back: the NetCDF library is not safe for several threads."""


def of_study(study: Study[Any], written: Path | None = None) -> xr.Dataset:
    """Return the results of a study after all of its rows, and write them where a path is given."""
    found = whole(study).dataset
    if written is not None:
        write_results(found, written)
    return found


def runs_of_study(study: Study[Any], written: Path | None) -> xr.Dataset:
    """Return the runs of a study as `open_dataset` returns them; write them first where a path is given."""
    whole(study)
    if written is None:
        found: xr.Dataset = study.drawn
        return found
    with ONE_AT_A_TIME:
        write_dataset(study.dataset, written)
        return open_dataset(written)
