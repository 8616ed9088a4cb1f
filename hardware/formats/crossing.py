"""Carries a read file from one process to another: facts as JSON, arrays as raw bytes.

Shared objects stay shared: instants of several tables, an array of two columns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vibroimpact.fmus.messages import Message, typed
from vibroimpact.hardware.formats.table import Column, RawFile, Table

_PLAIN = ("label", "unit", "interval", "start", "group", "dated", "ambiguity")
_KINDS = "fiub"
_COMPLEX_KINDS = "fiubc"
_ARRAY = "array"


class _Numbered:
    """Objects by number, each once."""

    def __init__(self) -> None:
        self.items: list[Any] = []
        self._places: dict[int, int] = {}

    def place(self, item: Any) -> int | None:
        """Return the number of an object; None for None."""
        if item is None:
            return None
        place = self._places.setdefault(id(item), len(self.items))
        if place == len(self.items):
            self.items.append(item)
        return place


def packed(raw: RawFile) -> tuple[dict[str, Any], list[Any]]:
    """Return a file as facts for JSON, and its arrays.

    Cells that are no numbers (`Column.strange`) are left out: the remarks report them.
    """
    columns, arrays = _Numbered(), _Numbered()
    tables = [
        {
            "columns": [columns.place(column) for column in table.columns],
            "time": columns.place(table.time),
            "title": table.title,
            "vectors": table.vectors,
            "time_place": table.time_place,
            "rate": _plain(table.rate),
        }
        for table in raw.tables
    ]
    facts = {
        "source_format": raw.source_format,
        "remarks": [[line, typed(line)] for line in raw.remarks],
        "attrs": {key: _plain(value) for key, value in raw.attrs.items()},
        "damage": raw.damage,
        "tables": tables,
        "columns": [_facts_of(column, arrays) for column in columns.items],
        "kinds": [array.dtype.str for array in arrays.items],
    }
    return facts, [np.ascontiguousarray(array) for array in arrays.items]


def unpacked(facts: Mapping[str, Any], buffers: Sequence[bytearray]) -> RawFile:
    """Return the file that `packed` has taken apart.

    ValueError, TypeError, KeyError or IndexError: the facts have another form.
    """
    arrays = [
        np.frombuffer(buffer, dtype=_kind(text)) for buffer, text in zip(buffers, facts["kinds"], strict=True)
    ]
    columns = [_column_of(known, arrays) for known in facts["columns"]]
    tables = [
        Table(
            [columns[place] for place in known["columns"]],
            None if known["time"] is None else columns[known["time"]],
            str(known["title"]),
            bool(known["vectors"]),
            int(known["time_place"]),
            known["rate"],
        )
        for known in facts["tables"]
    ]
    remarks = [Message(str(called), str(typed)) for called, typed in facts["remarks"]]
    return RawFile(str(facts["source_format"]), tables, remarks, dict(facts["attrs"]), str(facts["damage"]))


def packed_datasets(
    types: Sequence[int], datasets: Sequence[Mapping[str, Any]], cut: bool
) -> tuple[dict[str, Any], list[Any]]:
    """Return the datasets from `uff.read_datasets` as facts for JSON, and their arrays."""
    arrays: list[Any] = []
    facts = [{key: _value_of(value, arrays) for key, value in one.items()} for one in datasets]
    return {"types": list(types), "datasets": facts, "cut": cut}, arrays


def unpacked_datasets(
    facts: Mapping[str, Any], buffers: Sequence[bytearray]
) -> tuple[list[int], list[dict[str, Any]], bool]:
    """Return the datasets that `packed_datasets` has taken apart. Errors are as in `unpacked`."""
    datasets = [
        {str(key): _value_in(value, buffers) for key, value in one.items()} for one in facts["datasets"]
    ]
    return [int(kind) for kind in facts["types"]], datasets, bool(facts["cut"])


def _value_of(value: Any, arrays: list[Any]) -> Any:
    """Return a value of a dataset for JSON; numbers of an array, and complex ones, become an array."""
    numbers = (
        np.asarray(value) if isinstance(value, np.ndarray | np.generic | complex | list | tuple) else None
    )
    if numbers is None:
        return value
    if numbers.dtype.kind not in _COMPLEX_KINDS:
        return numbers.tolist()
    arrays.append(np.ascontiguousarray(numbers))
    return {_ARRAY: len(arrays) - 1, "kind": numbers.dtype.str, "shape": list(numbers.shape)}


def _value_in(value: Any, buffers: Sequence[bytearray]) -> Any:
    if not isinstance(value, Mapping):
        return value
    kind = _kind(value["kind"], _COMPLEX_KINDS)
    numbers = np.frombuffer(buffers[value[_ARRAY]], dtype=kind).reshape(value["shape"])
    return numbers if numbers.ndim else numbers[()]


def _facts_of(column: Column, arrays: _Numbered) -> dict[str, Any]:
    return {
        **{name: _plain(getattr(column, name)) for name in _PLAIN},
        "values": arrays.place(column.values),
        "overrange": arrays.place(column.overrange),
        "rails": None if column.rails is None else [float(limit) for limit in column.rails],
        "attrs": {key: _plain(value) for key, value in column.attrs.items()},
    }


def _column_of(known: Mapping[str, Any], arrays: Sequence[Any]) -> Column:
    rails = known["rails"]
    return Column(
        values=arrays[known["values"]],
        overrange=None if known["overrange"] is None else arrays[known["overrange"]],
        rails=None if rails is None else (float(rails[0]), float(rails[1])),
        attrs=dict(known["attrs"]),
        **{name: known[name] for name in _PLAIN},
    )


def _plain(value: Any) -> Any:
    """Return a number of numpy as a number of Python."""
    return value.item() if isinstance(value, np.generic) else value


def _kind(text: str, kinds: str = _KINDS) -> np.dtype[Any]:
    kind = np.dtype(text)
    if kind.kind not in kinds:
        raise ValueError(f"expected numbers, got {kind}")
    return kind
