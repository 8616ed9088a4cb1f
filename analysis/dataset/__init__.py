"""The door to the dataset: its schema, its writers and its readers.

`schema` holds the table of names, dimensions, units and meanings; `checking` checks datasets against it.
`results` has the datasets of analyses, `composed` several datasets in one.
`naming` has the sampled variables and the names of quantities in files, `derived` the quantities of maps.
`writing` builds and writes, `merging` joins parts in memory and `joining` on the disk, `reading` opens.

`stores` holds the same for Zarr stores, and the conversion of either form into the other.
`accessor` is `ds.vibroimpact`, which `registering` adds to xarray; `backend` is its engine. Everything public is
importable from here.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.analysis.dataset.accessor import VibroimpactAccessor
    from vibroimpact.analysis.dataset.checking import check, marked
    from vibroimpact.analysis.dataset.joining import join_files
    from vibroimpact.analysis.dataset.merging import merge_datasets, refuse_unlike, take_runs
    from vibroimpact.analysis.dataset.naming import file_name_of, file_names
    from vibroimpact.analysis.dataset.places import dataset_place
    from vibroimpact.analysis.dataset.reading import (
        Part,
        open_dataset,
        open_measured,
        read_flat,
        read_part,
    )
    from vibroimpact.analysis.dataset.schema import (
        IMPACT_COLUMNS,
        PERIOD_COLUMNS,
        RESERVED_NAMES,
        RULES,
        STICK_COLUMNS,
        Direction,
        MeasurementFlag,
        Outcome,
        RunRecord,
        constant_names,
    )
    from vibroimpact.analysis.dataset.stores.runs import read_runs
    from vibroimpact.analysis.dataset.writing import build_dataset, with_constants, write_dataset

__all__ = [
    "IMPACT_COLUMNS",
    "PERIOD_COLUMNS",
    "RESERVED_NAMES",
    "RULES",
    "STICK_COLUMNS",
    "Direction",
    "MeasurementFlag",
    "Outcome",
    "Part",
    "RunRecord",
    "VibroimpactAccessor",
    "build_dataset",
    "check",
    "constant_names",
    "dataset_place",
    "file_name_of",
    "file_names",
    "join_files",
    "marked",
    "merge_datasets",
    "open_dataset",
    "open_measured",
    "read_flat",
    "read_part",
    "read_runs",
    "refuse_unlike",
    "take_runs",
    "with_constants",
    "write_dataset",
]
_HOMES = {
    "VibroimpactAccessor": "accessor",
    **dict.fromkeys(("check", "marked"), "checking"),
    "join_files": "joining",
    **dict.fromkeys(("merge_datasets", "refuse_unlike", "take_runs"), "merging"),
    "dataset_place": "places",
    **dict.fromkeys(("file_name_of", "file_names"), "naming"),
    "read_runs": "stores.runs",
    **dict.fromkeys(("Part", "open_dataset", "open_measured", "read_flat", "read_part"), "reading"),
    **dict.fromkeys(("build_dataset", "with_constants", "write_dataset"), "writing"),
}


def __getattr__(name: str) -> Any:
    # The process of a guarded point needs only the records of runs, and xarray takes half a second to load.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES.get(name, 'schema')}"), name)
