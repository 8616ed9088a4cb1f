"""Makes the Replay FMU: recorded channels as the outputs of a component."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging.python_fmus import SOURCES, PythonFmu, make_fmu, require_pythonfmu
from vibroimpact.fmus.units import Unit, si_unit

REPLAY = SOURCES / "replay"
#: As in `python/replay/replay.py`, which must not import this package.
FOLDER, HEADER, FORMAT = "signals", "signals.json", "vibroimpact signals 1"
#: Endings of a channel's further variables, and the variable that all channels share.
ENDINGS = ("_rate", "_valid", "_gain", "_offset")
TIME_SHIFT = "time_shift"
MOST_CHANNELS = 256
#: Most samples of all channels and time axes together: 512 MiB, half of what an FMU may unpack to.
MOST_SAMPLES = 1 << 26
#: Largest deviation of evenly spaced times from their grid, in intervals.
EVEN = 1e-6
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ReplaySignal:
    """A signal to be played.

    Attributes
    ----------
    time : array_like, shape (sample,), or None
        Instants of the samples, s, ascending strictly; None with `start` and `interval`.
    values : array_like, shape (sample,)
        In `unit`; NaN where there is none (a gap).
    unit : str
        `m/s2`, `9.80665 m s-2`, as `units.si_unit` reads it; `1` for a pure number, which fits any connection.
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
        """Return a signal with evenly spaced samples; parameters are the attributes."""
        return cls(None, values, unit, start, interval)


def build_replay(signals: Mapping[str, ReplaySignal], output: Path | str) -> Path:
    """Make an FMU (FMI 2.0) that plays signals: value, slope and validity of each as outputs.

    Parameters
    ----------
    signals : mapping of str to ReplaySignal
        By the name of the output: letters, digits and underscores, a letter first.
    output : path
        The FMU file to write. Equal signals give equal bytes.

    Returns
    -------
    Path
        The FMU; `python/replay/README.md` describes its variables and its signal files.

    Raises
    ------
    UsageError
        The signals contradict themselves (all problems, one on each line), the file cannot be written, or pythonfmu
        is not installed.

    Examples
    --------
    >>> signal = ReplaySignal.evenly([0.0, 1.0, 0.5], "m/s2", 1e-3)
    >>> build_replay({"base": signal}, "shock.fmu")  # doctest: +SKIP
    """
    output = Path(output)
    arrays, problems = _checked(signals)
    if problems:
        raise UsageError("\n".join(f"replay: {problem}" for problem in problems))
    try:
        require_pythonfmu()
    except ComponentError as error:
        raise UsageError(str(error)) from error
    with tempfile.TemporaryDirectory() as folder:
        _write_signals(Path(folder, FOLDER), arrays)
        script = Path(folder, f"{_module_name()}.py")
        shutil.copyfile(REPLAY / "replay.py", script)
        units = {name: unit for name, array in arrays.items() for name, unit in _units(name, array.unit)}
        units[TIME_SHIFT] = Unit({"s": 1})
        parts = PythonFmu(script, (Path(folder, FOLDER),), REPLAY / "README.md", units, "replay")
        return make_fmu(parts, output)


def _module_name() -> str:
    # Python keeps one module of a name in a process: FMUs made by different versions must not get each other's
    digest = hashlib.sha256((REPLAY / "replay.py").read_bytes()).hexdigest()
    return f"vibroimpact_replay_{digest[:8]}"


@dataclass(frozen=True, slots=True)
class _Arrays:
    """A signal as it is stored: `times` is None where the samples are evenly spaced."""

    values: Floats
    unit: Unit
    start: float
    interval: float
    times: Floats | None


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
    taken: dict[str, str] = {TIME_SHIFT: "all channels"}
    for name in names:
        if not _NAME.fullmatch(name):
            yield f"{name!r}: expected a name of letters, digits and underscores, a letter first."
        for variable in (name, *(name + ending for ending in ENDINGS)):
            # some file systems do not tell capitals apart
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


def _units(name: str, unit: Unit) -> Iterator[tuple[str, Unit]]:
    yield name, unit
    yield f"{name}_rate", unit.per_second
    yield f"{name}_offset", unit.difference


def _write_signals(folder: Path, arrays: Mapping[str, _Arrays]) -> None:
    """Write the signal files; channels with the same instants share an axis."""
    folder.mkdir()
    axes: dict[str, dict[str, Any]] = {}
    numbers: dict[Any, str] = {}
    channels = {}
    for name, signal in sorted(arrays.items()):
        stored = None if signal.times is None else signal.times.tobytes()
        key = (len(signal.values), signal.start, signal.interval, stored)
        axis = numbers.setdefault(key, str(len(numbers) + 1))
        if axis not in axes:
            axes[axis] = {"count": len(signal.values)}
            if stored is None:
                axes[axis] |= {"start": signal.start, "interval": signal.interval}
            else:
                (folder / f"times_{axis}.f64").write_bytes(stored)
        channels[name] = {"axis": axis, "unit": signal.unit.name}
        (folder / f"channel_{name}.f64").write_bytes(signal.values.tobytes())
    header = {"format": FORMAT, "axes": axes, "channels": channels}
    (folder / HEADER).write_text(json.dumps(header, indent=2) + "\n", encoding="utf-8")
