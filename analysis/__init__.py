"""Datasets in, datasets or figures out; importing a name from here adds `ds.vibroimpact` to xarray datasets."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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


def __getattr__(name: str) -> Any:
    # The options of commands are imported from here, and xarray takes half a second to load.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.dataset"), name)
