"""TDMS files of National Instruments, read with npTDMS.

The instants come from `wf_increment` and `wf_start_offset`. `wf_samples` is the size of a block, not the length. A
start in 1904 (the epoch of LabVIEW) means relative time.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.labels import is_time_name
from vibroimpact.hardware.formats.probe import one_refusal
from vibroimpact.hardware.formats.table import MOST_COLUMNS, Column, Floats, RawFile, Table

_MOST_HEARD = 20
_LONGEST_HEARD = 120
_CUT_OFF_WARNING = re.compile(
    r"Last segment (of file has less data than expected|metadata is incomplete)"
    r"|Data size \d+ is not a multiple|Cropping data from"
)
_CUT_OFF = "the file is cut off: its last segment holds less data than it declares, and what is there is read"
_SCALE_TYPE = re.compile(r"NI_Scale\[\d+\]_Scale_Type")
_SCALE_NUMBER = re.compile(r"NI_Scale\[(\d+)\]")
_COEFFICIENTS = re.compile(r"NI_Scale\[\d+\]_Polynomial_Coefficients_Size")
_SCALES = "NI_Number_Of_Scales"
_MOST_SCALES = 100
"""Most scales of a channel, and coefficients of a polynomial: npTDMS loops over the declared number, NI writes few."""
_EPOCH_ENDS = np.datetime64("1904-01-02")


def read_tdms(path: os.PathLike[str] | str) -> RawFile:
    """Return the content of a TDMS file, in a table for each group.

    DatasetError: the file is damaged, or has no channels of numbers.
    """
    from nptdms import TdmsFile

    # opened here, so that it is closed even if the reader gives up
    with (
        one_refusal("a whole TDMS file"),
        _heard() as heard,
        open(path, "rb") as stream,
        TdmsFile.open(stream) as file,
    ):
        raw = _read(file, os.stat(path).st_size)
    damage = _CUT_OFF if any(_CUT_OFF_WARNING.match(line) for line in heard) else ""
    others = dict.fromkeys(f"npTDMS says: {line}" for line in heard if not _CUT_OFF_WARNING.match(line))
    return replace(raw, remarks=[*raw.remarks, *others][:_MOST_HEARD], damage=damage)


@contextmanager
def _heard() -> Iterator[list[str]]:
    """Collect npTDMS' messages, such as on a cut file or a text that is not UTF-8."""
    from nptdms.log import log_manager

    heard: list[str] = []

    def keep(record: logging.LogRecord) -> bool:
        heard.append(record.getMessage()[:_LONGEST_HEARD])
        return False

    log_manager.console_handler.addFilter(keep)
    try:
        yield heard
    finally:
        log_manager.console_handler.removeFilter(keep)


def _read(file: Any, size: int) -> RawFile:
    groups, remarks = _without_copies(file.groups())
    channels = [channel for group in groups for channel in group.channels()]
    if len(channels) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_COLUMNS} channels, got {len(channels)}.")
    for holder in (file, *groups, *channels):
        _refuse_many_scales(holder.properties)
    declared = sum(len(channel) for channel in channels)
    if declared > size:  # nothing in this format is compressed: a sample has at least one byte
        raise DatasetError(
            f"expected at most {size} samples in as many bytes, got {declared}. It is damaged."
        )
    starts = [stamp for channel in channels if (stamp := _start(channel)) is not None]
    origin = min(starts, default=None)
    # channels with equal starts share one trigger, in any group
    tables = [
        _table(group, origin, remarks, len(groups) > 1 and None in [_start(one) for one in group.channels()])
        for group in groups
    ]
    if any(_start(channel) is None and "wf_start_time" in channel.properties for channel in channels):
        remarks.append(
            "the start is given as 1904, the epoch of LabVIEW: time is relative, its date is not known"
        )
    attrs = {"source_title": str(file.properties["name"])} if file.properties.get("name") else {}
    if origin is not None:
        attrs["source_date"] = str(np.datetime_as_string(origin, unit="us"))
    return RawFile("TDMS", [table for table in tables if table.columns or table.time], remarks, attrs)


def _refuse_many_scales(known: Mapping[str, Any]) -> None:
    """Raise DatasetError if properties declare more scales, or coefficients of one, than any program writes."""
    numbers = [int(found[1]) + 1 for key in known if (found := _SCALE_NUMBER.match(key))]
    promised = {_SCALES: known[_SCALES]} if _SCALES in known else {"scales": max(numbers, default=0)}
    promised |= {key: known[key] for key in known if _COEFFICIENTS.fullmatch(key)}
    for key, value in promised.items():
        try:
            count = int(value)
        except (TypeError, ValueError, OverflowError):
            continue  # npTDMS refuses it
        if count > _MOST_SCALES:
            raise DatasetError(
                f"{key[:60]}: expected at most {_MOST_SCALES}, got {str(value)[:40]}. It is damaged."
            )


def _without_copies(groups: list[Any]) -> tuple[list[Any], list[str]]:
    """Return the groups without the decimated copies that SignalExpress keeps for drawing, and a remark."""
    levels = [_number(group.properties.get("DecimationLevel")) or 0.0 for group in groups]
    if not any(levels) or all(levels):
        return groups, []
    copies = [group.name for group, level in zip(groups, levels, strict=True) if level]
    remark = f"decimated copies of the samples are left out: {', '.join(copies)}"
    return [group for group, level in zip(groups, levels, strict=True) if not level], [remark]


def _start(channel: Any) -> np.datetime64 | None:
    stamp = channel.properties.get("wf_start_time")
    return stamp if isinstance(stamp, np.datetime64) and stamp > _EPOCH_ENDS else None


def _table(group: Any, origin: np.datetime64 | None, remarks: list[str], titled: bool) -> Table:
    columns: list[Column] = []
    time = None
    for channel in group.channels():
        raw = channel[:]
        if raw is None or not len(raw):
            remarks.append(f"{channel.name}: holds no samples and is left out")
        elif raw.dtype.kind == "M":
            seconds = np.asarray((raw - raw[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
            time = Column(channel.name, seconds, "s")
        elif raw.dtype.kind not in "fiub":
            remarks.append(f"{channel.name}: its values are no numbers ({raw.dtype}), it is left out")
        else:
            columns.append(_column(channel, np.asarray(raw, dtype=np.float64), origin, remarks))
    if time is None and len(columns) > 1 and is_time_name(columns[0].label) and columns[0].interval is None:
        time, *columns = columns
    return Table(columns, time, group.name if titled else "")


def _column(channel: Any, values: Floats, origin: np.datetime64 | None, remarks: list[str]) -> Column:
    known = channel.properties
    start = _start(channel)
    late = (
        0.0 if start is None or origin is None else float((start - origin) / np.timedelta64(1, "us")) * 1e-6
    )
    increment = _number(known.get("wf_increment"))
    samples = _number(known.get("wf_samples"))
    remark = "wf_samples is the size of a block, not the length: the samples are counted"
    if samples is not None and samples != len(values) and remark not in remarks:
        remarks.append(remark)
    return column_of(
        channel.name,
        values,
        str(known.get("unit_string", "")),
        interval=increment if increment is not None and 0.0 < increment < np.inf else None,
        start=(_number(known.get("wf_start_offset")) or 0.0) + late,
        group=f"start {start}" if late else "",
        rails=_rails(channel),
    )


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float | np.integer | np.floating) else None


def _rails(channel: Any) -> tuple[float, float] | None:
    """Return the scaled ends of the raw integers' range; None unless the scale is linear."""
    known = channel.properties
    raw = channel.read_data(0, 1, scaled=False)
    if isinstance(raw, dict):  # DAQmx: raw data by scaler
        raw = next(iter(raw.values()), None)
    if raw is None or raw.dtype.kind not in "iu" or raw.dtype.itemsize > 2:
        return None
    scales = [key for key in known if _SCALE_TYPE.fullmatch(key)]
    if len(scales) != 1 or known[scales[0]] != "Linear":
        return None
    scale = scales[0].removesuffix("_Scale_Type")
    slope = _number(known.get(f"{scale}_Linear_Slope"))
    intercept = _number(known.get(f"{scale}_Linear_Y_Intercept"))
    if slope is None or intercept is None:
        return None
    limits = np.iinfo(raw.dtype)
    low, high = sorted((limits.min * slope + intercept, limits.max * slope + intercept))
    return low, high
