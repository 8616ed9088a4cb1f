"""The parts of a recording from the columns of files: channels, event trains and single values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.analysis.recording import Channel, EventTrain, SingleValue
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message, reworded
from vibroimpact.hardware.formats.labels import is_known_unit, meant_unit, seconds_in
from vibroimpact.hardware.formats.table import MOST_SAMPLES, Column, Table
from vibroimpact.hardware.recordings.channel_of import channel_of
from vibroimpact.hardware.recordings.events import event_train, is_raster, looks_like_events, raster_train
from vibroimpact.hardware.recordings.naming import channel_name
from vibroimpact.hardware.recordings.settings import ImportSettings
from vibroimpact.hardware.recordings.sources import Source, naming, shortened
from vibroimpact.hardware.recordings.time_axis import Placement, place

_NUMBERED = re.compile(r"column_\d+")
_NO_EVENTS = Argument("events", False)


@dataclass(slots=True)
class Parts:
    """The parts of a recording so far, each by its name."""

    channels: dict[str, Channel] = field(default_factory=dict)
    events: dict[str, EventTrain] = field(default_factory=dict)
    scalars: dict[str, SingleValue] = field(default_factory=dict)
    remarks: dict[str, None] = field(default_factory=dict)
    """In the order of their discovery, each once."""

    def add(self, source: Source, title: str) -> None:
        """Add the columns of one file; its remarks begin with `title`, which is empty for a single file.

        DatasetError, with the name of the file: a column cannot be placed in time.
        """
        tables = source.raw.tables
        self.remark(source.raw.remarks, title)
        self.remark([line for table in tables for line in _length_remarks(table)], title)
        placements: dict[Any, Placement] = {}
        rasters = [is_raster(table, source.settings.events) for table in tables]
        columns = [(at, column) for at, table in enumerate(tables) for column in table.columns]
        if sum(len(column.values) for _, column in columns) > MOST_SAMPLES:
            raise DatasetError(f"{source.path}: expected at most {MOST_SAMPLES} samples, got more.")
        for number, (at, column) in enumerate(columns):
            with naming(source.path, besides=source.raw.damage):
                self.remark(self._add_column(number, at, column, source, placements, rasters[at]), title)

    def remark(self, lines: Sequence[str], title: str = "") -> None:
        """Add remarks, each line once."""
        for line in lines:
            self.remarks.setdefault(
                reworded(line, lambda text: shortened(f"{title}: {text}" if title else text))
            )

    def _add_column(
        self,
        number: int,
        at: int,
        column: Column,
        source: Source,
        placements: dict[Any, Placement],
        in_raster: bool,
    ) -> list[str]:
        """Add one column as a channel, an event train or a value; return the remarks on it."""
        settings, table = source.settings, source.raw.tables[at]
        clocks = (settings.rate, table.rate, column.interval, table.clock_of(column))
        in_raster = in_raster and any(clock is not None for clock in clocks)
        as_events = not in_raster and _is_event_train(column, table, settings)
        name = self._name(column, number, settings, as_events)
        changed, remarks = _described(name, column, settings, number)
        if as_events:
            factor = seconds_in(changed.unit) or 1.0
            instants = replace(changed, values=changed.values * factor)
            self.events[name], more = event_train(name, instants, settings.window, settings.masked)
            if settings.events is None:
                remarks.append(
                    message(
                        f"{name}: ascends unevenly, so it is taken as instants of events (",
                        *(_NO_EVENTS, " if not)"),
                    )
                )
            return remarks + more
        if len(column.values) == 1:
            value = float(changed.values[0])
            beyond = column.overrange is not None and bool(column.overrange[0])
            self.scalars[name] = SingleValue(value, measured_unit(changed.unit).cf, column.label, beyond)
            meaning = "which the file marks as overrange" if beyond else f"{value:g}"
            return [*remarks, f"{name}: one value only, {meaning}: kept beside the channels"]
        key = (at, len(column.values), column.interval, column.start, column.group)
        if key not in placements:
            trigger = ", ".join(part for part in (source.path.name, table.title, column.group) if part)
            placements[key] = place(table, column, settings.rate, settings.start, trigger)
            remarks += placements[key].remarks
        if in_raster:
            train = raster_train(name, column, placements[key], settings.window, settings.masked)
            if train is None:
                return [*remarks, f"{name}: has no event, and is left out"]
            self.events[name] = train
            return [
                *remarks,
                message(
                    "the columns hold 0 and 1 only: an event train each, with an event where it becomes 1 (",
                    *(_NO_EVENTS, " if not)"),
                ),
            ]
        self.channels[name], more = channel_of(name, changed, placements[key], settings.masked)
        return remarks + more

    def _name(self, column: Column, number: int, settings: ImportSettings, as_events: bool) -> str:
        label = settings.name[number] if number < len(settings.name) else column.label
        if as_events and _NUMBERED.fullmatch(label):
            label = "events"
        return channel_name(label, {*self.channels, *self.events, *self.scalars})


def _length_remarks(table: Table) -> list[str]:
    """Return remarks on columns of one table with different lengths, as in a file that was cut off."""
    lengths = sorted({len(column.values) for column in table.columns})
    if table.vectors or len(lengths) < 2:
        return []
    shortest = next(column for column in table.columns if len(column.values) == lengths[0])
    return [
        f"channels of unequal lengths, {lengths[0]} to {lengths[-1]} samples: {shortest.label} ends first"
    ]


def _described(name: str, column: Column, settings: ImportSettings, number: int) -> tuple[Column, list[str]]:
    """Return a column with unit, scale and offset from the settings of column `number` (from 0), and remarks."""
    remarks: list[str] = []
    unit, remark = _picked(settings.unit, number), ""
    if unit is None:
        unit, remark = meant_unit(column.label, column.unit)
    if remark:
        remarks.append(message(f"{name}: {remark} (", Argument("unit"), " if not)"))
    if not is_known_unit(unit):
        remarks.append(
            message(
                f"{name}: the unit {unit[:40]!r} is not known: taken as a pure number (",
                *(Argument("unit"), ")"),
            )
        )
        unit = "1"
    attrs = dict(column.attrs)
    if column.unit and column.unit != unit:
        attrs["source_unit"] = column.unit
    scale, offset = _picked(settings.scale, number), _picked(settings.offset, number)
    if scale is None and offset is None:
        return replace(column, unit=unit, attrs=attrs), remarks
    factor, shift = 1.0 if scale is None else scale, offset or 0.0
    remarks.append(f"{name}: {factor:g} times the values of the file, plus {shift:g}")
    with np.errstate(over="ignore"):
        values = column.values * factor + shift
    attrs |= {"scale": factor, "offset": shift}
    rails = None
    if column.rails is not None:
        low, high = sorted(limit * factor + shift for limit in column.rails)
        rails = low, high
    return replace(column, values=values, unit=unit, attrs=attrs, rails=rails), remarks


def _picked(values: Sequence[Any], number: int) -> Any:
    """Return the value for a column; a single value is for all of them."""
    if len(values) == 1:
        return values[0]
    return values[number] if number < len(values) else None


def _is_event_train(column: Column, table: Table, settings: ImportSettings) -> bool:
    """Whether a column has instants of events: by the user's choice, or if it has no time and looks so."""
    if settings.events is not None:
        return settings.events
    if settings.rate is not None or table.clock_of(column) is not None:
        return False
    return (table.vectors or len(table.columns) == 1) and looks_like_events(column)
