"""The Replay FMU: recorded channels as the outputs of a component."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.cross import Note
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    Experiment,
    UnitDefinition,
    Variable,
)
from vibroimpact.fmus.packaging.export import REPLAY
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.members import Contents, component_of, edition_of, members_of
from vibroimpact.fmus.units import Unit, si_unit

#: Folder of the signal files, name of their list, and its first line; native/replay/recording.c has the same.
FOLDER, LIST, FORMAT = "resources/signals", "signals.txt", "vibroimpact signals 2"
#: Suffixes of a channel's further variables.
ENDINGS = ("_rate", "_valid", "_gain", "_offset")
SHARED = ("time", "time_shift")
MOST_CHANNELS = 256
#: Largest number of samples of all channels and time axes together: 512 MiB, half of the limit of an unpacked FMU.
MOST_SAMPLES = 1 << 26
#: Largest deviation of evenly spaced times from their grid, in intervals; with a larger one the times are stored.
EVEN = 1e-6
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ReplaySignal:
    """A signal to play.

    Attributes
    ----------
    time : array_like, shape (sample,), or None
        Instants of the samples, s, strictly ascending; None with `start` and `interval`.
    values : array_like, shape (sample,)
        Samples in `unit`; NaN in a gap.
    unit : str
        Unit as `units.si_unit` reads it, `m/s2`, `9.80665 m s-2`; `1` for a pure number, which fits any connection.
    start, interval : float
        The first instant and the spacing of evenly spaced samples, s.
    """

    time: ArrayLike | None
    values: ArrayLike
    unit: str = "1"
    start: float = 0.0
    interval: float | None = None

    @classmethod
    def evenly(cls, values: ArrayLike, unit: str, interval: float, start: float = 0.0) -> Self:
        """Return a signal with evenly spaced samples; the parameters are the attributes."""
        return cls(None, values, unit, start, interval)


def build_replay(
    signals: Mapping[str, ReplaySignal],
    output: Path | str,
    *,
    fmi: str = "3.0",
    platform: str | None = None,
    note: Note = lambda _: None,
) -> Path:
    """Make an FMU that plays signals: value, slope and validity of each as outputs.

    Parameters
    ----------
    signals : mapping of str to ReplaySignal
        Signals by the name of their output: letters, digits and underscores, beginning with a letter.
    output : path
        The FMU file to write. Equal signals give equal bytes.
    fmi : str
        `3.0` or `2.0`.
    platform, note
        See `export_fmu`.

    Returns
    -------
    Path
        The FMU; `native/replay/README.md` describes its variables and its signal files.

    Raises
    ------
    UsageError
        The signals are contradictory (all problems, one a line), or the file cannot be written.
    ComponentFileError
        The component was not built.
    ComponentError
        A platform has no library, and no compiler was found to build it.

    Examples
    --------
    >>> signal = ReplaySignal.evenly([0.0, 1.0, 0.5], "m/s2", 1e-3)
    >>> build_replay({"base": signal}, "shock.fmu")  # doctest: +SKIP
    """
    output = Path(output)
    arrays, problems = _checked(signals)
    if problems:
        raise UsageError("\n".join(f"replay: {problem}" for problem in problems))
    original = component_of(REPLAY)
    # no date: datasets identify the played signals by the hash of the file
    experiment = _experiment(arrays)
    contents = Contents(
        original,
        _described(original, arrays),
        fmi,
        edition_of(experiment, dated=False),
        experiment,
        {"channel": len(arrays)},
        _signal_files(arrays),
        platform,
        note,
    )
    write_fmu(output, members_of(contents))
    return output


@dataclass(frozen=True, slots=True)
class _Arrays:
    """A signal as it is stored: `times` is None for evenly spaced samples."""

    values: Floats
    unit: Unit
    start: float
    interval: float
    times: Floats | None

    @property
    def begin(self) -> float:
        """Time of the first sample, s."""
        return self.start if self.times is None else float(self.times[0])

    @property
    def end(self) -> float:
        """Time of the last sample, s."""
        last = len(self.values) - 1
        return self.start + last * self.interval if self.times is None else float(self.times[last])


def _checked(signals: Mapping[str, ReplaySignal]) -> tuple[dict[str, _Arrays], list[str]]:
    problems = list(_name_problems(list(signals)))
    arrays: dict[str, _Arrays] = {}
    for name, signal in sorted(signals.items()):
        try:
            arrays[name] = _arrays(signal)
        except (UsageError, ValueError, TypeError) as problem:
            problems.append(f"{name}: {problem}")
    total = sum(len(a.values) + (0 if a.times is None else len(a.times)) for a in arrays.values())
    if total > MOST_SAMPLES:
        problems.append(f"expected at most {MOST_SAMPLES} samples in all, got {total}. Take fewer channels.")
    return arrays, problems


def _name_problems(names: list[str]) -> Iterator[str]:
    if not 0 < len(names) <= MOST_CHANNELS:
        yield f"expected 1 to {MOST_CHANNELS} channels, got {len(names)}."
    taken = dict.fromkeys(SHARED, "all channels")
    for name in names:
        if not _NAME.fullmatch(name):
            yield f"{name!r}: expected a name of letters, digits and underscores, a letter first."
        for variable in (name, *(name + ending for ending in ENDINGS)):
            # some file systems ignore capitals
            owner = taken.setdefault(variable.lower(), name)
            if owner != name:
                yield f"{name}: its variable {variable} is taken by {owner}. Rename a channel."


def _arrays(signal: ReplaySignal) -> _Arrays:
    values = np.ascontiguousarray(signal.values, dtype="<f8")
    if values.ndim != 1 or len(values) < 2:
        raise ValueError(f"values: expected an array of 2 samples or more, got shape {values.shape}.")
    if np.isinf(values).any() or np.isnan(values).all():
        raise ValueError(
            "values: expected finite numbers, NaN in gaps only, got infinity or no number at all."
        )
    unit = si_unit(signal.unit)
    if (signal.time is None) == (signal.interval is None):
        raise ValueError("expected either time or interval, got both or none.")
    if signal.time is None:
        start, interval = float(signal.start), float(signal.interval or 0.0)
        end = start + interval * len(values)
        if not np.isfinite(end) or not start < start + interval or not end - interval < end:
            raise ValueError(
                f"interval: expected an interval > 0 s from a finite start, got {interval}, {start}."
            )
        return _Arrays(values, unit, start, interval, None)
    times = np.ascontiguousarray(signal.time, dtype="<f8")
    if times.shape != values.shape or not np.isfinite(times).all() or not (np.diff(times) > 0.0).all():
        raise ValueError("time: expected a finite instant for each value, strictly ascending, got others.")
    interval = float(times[-1] - times[0]) / (len(times) - 1)
    even = times[0] + interval * np.arange(len(times))
    if np.abs(times - even).max() <= EVEN * interval:
        return _Arrays(values, unit, float(times[0]), interval, None)
    return _Arrays(values, unit, 0.0, 0.0, times)


def _experiment(arrays: Mapping[str, _Arrays]) -> Experiment:
    """Return the span of the records, and the finest sampling interval."""
    step = min((a.end - a.begin) / (len(a.values) - 1) for a in arrays.values())
    return Experiment(
        start_time=min(a.begin for a in arrays.values()),
        stop_time=max(a.end for a in arrays.values()),
        step_size=step,
    )


def _described(original: ComponentDescription, arrays: Mapping[str, _Arrays]) -> ComponentDescription:
    """Return the component with the channels' own names and units."""
    names = list(arrays)
    units = {unit.name: unit for unit in original.units}

    def unit_of(variable: Variable, name: str) -> str:
        unit = arrays[name].unit
        own = {"": unit, "_rate": unit.per_second, "_offset": unit.difference}
        found = own.get(_ending(variable))
        if found is None or not found.name:
            return ""
        units[found.name] = UnitDefinition(found.name, found.exponents, found.factor, found.offset)
        return found.name

    def named(variable: Variable) -> Variable:
        if not variable.repeat:
            return variable
        name = names[variable.repeat_index - 1]
        description = variable.description.replace(f"channel {variable.repeat_index}", name)
        return replace(
            variable, name=name + _ending(variable), description=description, unit=unit_of(variable, name)
        )

    component = original.with_repeats({"channel": len(names)})
    variables = tuple(named(variable) for variable in component.variables)
    return replace(component, variables=variables, units=tuple(units.values()))


def _ending(variable: Variable) -> str:
    """Return the suffix of a variable after its channel's name; empty for the value."""
    member = variable.shown_name.rpartition(".")[2]
    return "" if member == "value" else f"_{member}"


def _signal_files(arrays: Mapping[str, _Arrays]) -> dict[str, bytes]:
    """Return the signal files; channels with the same instants share an axis."""
    axes: dict[bytes, int] = {}
    members: dict[str, bytes] = {}
    lines, channels = [FORMAT], []
    for name, signal in arrays.items():
        count = len(signal.values)
        even = signal.times is None
        stored = np.array([signal.start, signal.interval], "<f8") if signal.times is None else signal.times
        kind = f"axis {'even' if even else 'listed'} {count}"
        key = kind.encode() + stored.tobytes()
        if key not in axes:
            axes[key] = len(axes) + 1
            lines.append(kind)
            members[f"{FOLDER}/axis_{axes[key]}.f64"] = stored.tobytes()
        channels.append(f"channel {name} {axes[key]}")
        members[f"{FOLDER}/channel_{name}.f64"] = signal.values.tobytes()
    members[f"{FOLDER}/{LIST}"] = "\n".join([*lines, *channels, ""]).encode("ascii")
    return members
