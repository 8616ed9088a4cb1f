"""Datasets in, datasets or figures out; importing this package adds `ds.vibroimpact` to xarray datasets."""

from __future__ import annotations

from vibroimpact.analysis.dataset import (
    Direction,
    Outcome,
    RunRecord,
    build_dataset,
    check,
    merge_datasets,
    open_dataset,
    write_dataset,
)

__all__ = [
    "Direction",
    "Outcome",
    "RunRecord",
    "build_dataset",
    "check",
    "merge_datasets",
    "open_dataset",
    "write_dataset",
]
