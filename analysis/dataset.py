"""The door to the dataset: its schema, its writers and its readers.

`schema` holds the table of names, dimensions, units and meanings and the check against it; `writing`
builds, merges and writes; `reading` opens; `accessor` adds `ds.vibroimpact`. Everything public is importable
from here.
"""

from __future__ import annotations

from vibroimpact.analysis.accessor import VibroimpactAccessor
from vibroimpact.analysis.reading import Part, open_dataset, read_flat, read_part, unreadable
from vibroimpact.analysis.schema import (
    CONVENTIONS,
    IMPACT_COLUMNS,
    PERIOD_COLUMNS,
    RULES,
    STICK_COLUMNS,
    Direction,
    Outcome,
    RunRecord,
    UnitSystem,
    VariableRule,
    check,
    file_name_of,
    swept_names,
)
from vibroimpact.analysis.writing import build_dataset, merge_datasets, write_dataset

__all__ = [
    "CONVENTIONS",
    "IMPACT_COLUMNS",
    "PERIOD_COLUMNS",
    "RULES",
    "STICK_COLUMNS",
    "Direction",
    "Outcome",
    "Part",
    "RunRecord",
    "UnitSystem",
    "VariableRule",
    "VibroimpactAccessor",
    "build_dataset",
    "check",
    "file_name_of",
    "merge_datasets",
    "open_dataset",
    "read_flat",
    "read_part",
    "swept_names",
    "unreadable",
    "write_dataset",
]
