"""Universal files (UFF), read with pyuff: functions over time (dataset 58), of text or binary."""

from __future__ import annotations

import os
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, joined, message, reworded
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.labels import seconds_in
from vibroimpact.hardware.formats.probe import missing_extra, one_refusal
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, Floats, RawFile, Table

SIGNATURE = re.compile(rb"(?:[ ]*\r?\n)*[ ]{4}-1[ ]*\r?\n[ ]{1,5}\d{1,5}(?:[bB][^\r\n]*)?[ ]*\r?\n")
# edges of datasets as pyuff looks for them; binary samples stand right before
_EDGE = re.compile(rb"[ ]{4}-1(?:[\r\n]|[ ]{74}|\Z)")
_FUNCTION = 58
_UNITS = 164
_TIME = 17
KINDS = {
    0: "a general function",
    1: "a time response",
    2: "an auto spectrum",
    3: "a cross spectrum",
    4: "a frequency response",
    5: "a transmissibility",
    6: "a coherence",
    7: "an auto correlation",
    8: "a cross correlation",
    9: "a power spectral density",
    12: "a spectrum",
}
_OVER_TIME = frozenset({0, 1})
# units of the ordinate in SI (dataset 164, units code 1); others have a label of their own
_SI_UNITS = {8: "m", 9: "N", 11: "m/s", 12: "m/s^2", 13: "N", 15: "Pa", 16: "kg"}
DIRECTIONS = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
_CUT_OFF = "the file is cut off: its last dataset has no end, and is left out"


def is_uff(start: bytes) -> bool:
    """Whether a file begins as a universal file: the mark of a dataset alone in a line, then its number.

    >>> is_uff(b"    -1\\n    58\\nNONE\\n"), is_uff(b"-1\\n58\\n"), is_uff(b"    -1\\r\\n    58b     1     2\\r\\n")
    (True, False, True)
    """
    return SIGNATURE.match(start) is not None


def read_uff(path: os.PathLike[str] | str) -> RawFile:
    """Return the functions over time of a universal file; functions with the same instants share a table.

    DatasetError: pyuff is not installed, or the file is damaged or has no function over time.
    """
    types, datasets, cut = read_datasets(path, frozenset({_FUNCTION, _UNITS}))
    functions = [found for found in datasets if found["type"] == _FUNCTION]
    units: Mapping[str, Any] = next((found for found in datasets if found["type"] == _UNITS), {})
    with one_refusal("a whole universal file (UFF)"):  # pyuff leaves out what it does not find
        raw = _sorted_out(functions, units, Counter(types), cut)
    return replace(raw, damage=_CUT_OFF if cut else "")


def read_datasets(
    path: os.PathLike[str] | str, kinds: frozenset[int]
) -> tuple[list[int], list[Mapping[str, Any]], bool]:
    """Return the types of all datasets, the contents of the wanted types, and whether the file is cut off.

    DatasetError: pyuff is not installed, or the file is damaged.
    """
    try:
        import pyuff
    except ImportError as problem:
        raise missing_extra("a universal file (UFF)", "pyuff", "uff") from problem
    with open(path, "rb") as stream:
        cut = len(_EDGE.findall(stream.read())) % 2 == 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy's, on numbers in damaged files
            file = pyuff.UFF(os.fspath(path))
            types = [int(kind) for kind in file.get_set_types()]
            if len(types) > 2 * MOST_COLUMNS:
                raise DatasetError(f"expected at most {2 * MOST_COLUMNS} datasets, got {len(types)}.")
            return types, [file.read_sets(at) for at, kind in enumerate(types) if kind in kinds], cut
    except DatasetError:
        raise
    # on damaged bytes the reader may raise any error
    except Exception as problem:
        besides = f" Besides, {_CUT_OFF}." if cut else ""
        raise DatasetError(
            f"expected a whole universal file (UFF), got one that cannot be read ({problem}).{besides}"
        ) from problem


def _sorted_out(
    functions: Sequence[Mapping[str, Any]], units: Mapping[str, Any], types: Counter[int], cut: bool
) -> RawFile:
    """Return the functions over time, with remarks on the others."""
    remarks = [
        f"{count} datasets of type {kind} are left out; functions (58) over time are read"
        for kind, count in sorted(types.items())
        if kind not in (_FUNCTION, _UNITS)
    ]
    in_si = not units or units.get("units_code") == 1
    if not in_si:
        remarks.append(
            message(
                f"the units of the file are {units.get('units_description', '')!r}, not SI (",
                *(Argument("unit"), ")"),
            )
        )
    repeated = Counter(text_of(found.get("id1")) for found in functions)
    by_instants: dict[bytes, Table] = {}
    even: list[Column] = []
    for number, found in enumerate(functions, 1):
        name = _label(found, repeated[text_of(found.get("id1"))] > 1) or f"function {number}"
        why = _why_not(found)
        if why:
            remarks.append(f"{name}: {why}, is left out; functions over time are read")
            continue
        declared, there = int(found.get("num_pts", 0)), len(found["data"])
        if declared > there:
            remarks.append(f"{name}: the header says {declared} samples, the file has {there}")
        column, instants = _column(name, found, bool(units) and in_si)
        if instants is None:
            even.append(column)
        else:
            _add(by_instants, column, instants)
    tables = list(by_instants.values())
    if sum(len(column.values) for table in (*tables, Table(even)) for column in table.columns) > MOST_SAMPLES:
        raise DatasetError(f"expected at most {MOST_SAMPLES} samples, got more. Cut it into pieces.")
    if even:
        tables.insert(0, Table(even, vectors=True))
    if not tables:
        kinds = ", ".join(str(kind) for kind in sorted(types)) or "none"
        cut_remark = f" Besides, {_CUT_OFF}." if cut else ""
        what = joined("; ", (reworded(line, lambda text: text.split(";")[0]) for line in remarks))
        raise DatasetError(
            message(
                "expected a universal file (UFF) with functions over time (dataset 58), got datasets of type ",
                *(kinds, *((" (", reworded(what, lambda text: text[:300]), ")") if what else ())),
                ". In Python, hardware.formats.universal.read_universal reads frequency responses, spectra, shapes "
                f"and geometry.{cut_remark}",
            )
        )
    return RawFile("universal file (UFF 58)", tables, remarks)


def _add(tables: dict[bytes, Table], column: Column, instants: Floats) -> None:
    """Add a function to the table with its instants, or to a new table."""
    key = (instants + 0.0).tobytes()  # 0 and -0 are one instant
    table = tables.get(key)
    if table is None:
        tables[key] = Table([column], Column("instants", instants, "s"), column.label)
    else:
        tables[key] = replace(table, columns=[*table.columns, column], title="")


def _why_not(found: Mapping[str, Any]) -> str:
    """Return the kind of a function that is not over time; empty for one that is."""
    if found.get("data") is None:  # the reader knows no samples of this type, or the file ends before them
        return "a function without samples"
    kind = int(found.get("func_type", 0))
    if kind not in _OVER_TIME or found.get("abscissa_spec_data_type") not in (0, 1, _TIME):
        return KINDS.get(kind, f"a function of type {kind}") + (
            " over another abscissa" * (kind in _OVER_TIME)
        )
    if np.iscomplexobj(found["data"]):
        return "a complex function"
    if len(found["data"]) < 1:
        return "a function without samples"
    return ""


def _column(name: str, found: Mapping[str, Any], in_si: bool) -> tuple[Column, Floats | None]:
    """Return a function, and its instants (s) unless an increment counts them."""
    declared = int(found.get("num_pts", 0))
    values = np.asarray(found["data"], dtype=np.float64)[: declared or None]
    unit = text_of(found.get("ordinate_axis_units_lab"))
    if not unit and in_si:
        unit = _SI_UNITS.get(int(found.get("ordinate_spec_data_type", 0)), "")
    texts = {key: text_of(found.get(source)) for key, source in (("function", "id2"), ("date", "id3"))}
    attrs = {f"source_{key}": text for key, text in texts.items() if text}
    second = seconds_in(text_of(found.get("abscissa_axis_units_lab"))) or 1.0
    column = column_of(name, values, unit, attrs=attrs)
    if int(found.get("abscissa_spacing", 1)) == 0:
        return column, np.asarray(found["x"], dtype=np.float64)[: len(values)] * second
    interval = float(found.get("abscissa_inc", 0.0)) * second
    start = float(found.get("abscissa_min", 0.0)) * second
    return replace(column, interval=interval if interval > 0.0 else None, start=start), None


def _label(found: Mapping[str, Any], with_place: bool) -> str:
    """Return a function's name: its first line, with its node and direction if that is not unique."""
    name = text_of(found.get("id1"))
    if name and not with_place:
        return name
    direction = int(found.get("rsp_dir", 0))
    sign = DIRECTIONS.get(abs(direction), "")
    place = f"{found.get('rsp_node', '')}{sign.replace('+', '-') if direction < 0 else sign}"
    return f"{name} {text_of(found.get('rsp_ent_name'))} {place}".replace("  ", " ").strip()


def text_of(value: Any) -> str:
    """Return a text of the file; NONE counts as empty."""
    text = str(value or "").strip()
    return "" if text.upper() == "NONE" else text
