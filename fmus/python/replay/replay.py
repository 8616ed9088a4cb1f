"""The FMU that plays recorded channels; pythonfmu runs it.

It must run wherever the FMU runs: standard library and pythonfmu only, nothing of vibroimpact.
"""

import json
import math
import sys
from array import array
from bisect import bisect_right
from collections.abc import Callable
from functools import lru_cache
from operator import lt
from pathlib import Path
from typing import Any

# found in the FMU's resources, whether or not it is installed; its types are not published
from pythonfmu import (  # type: ignore[import-untyped, import-not-found, unused-ignore]
    Boolean,
    DefaultExperiment,
    Fmi2Causality,
    Fmi2Slave,
    Real,
)
from pythonfmu.enums import (  # type: ignore[import-untyped, import-not-found, unused-ignore]
    Fmi2Initial,
    Fmi2Variability,
)

FOLDER, HEADER = "signals", "signals.json"
FORMAT = "vibroimpact signals 1"
HEADER_LIMIT = 1 << 20
"""Most bytes of the header."""
SAMPLE_LIMIT = 100_000_000
"""Most samples of a channel."""
SAME_INSTANT = 1e-4
"""A time closer to a sample than this part of the sampling interval is at the sample: the slope is then that of the
segment that begins there, also where the summed steps of an importer fall a little short of it."""
ROUNDINGS = 4.0
"""The same in spacings of doubles at that time, for records that lie far from time 0."""
KEPT_FILES = 4


class Axis:
    """Instants of samples, s: evenly spaced from `start`, or listed in `times`."""

    def __init__(self, count: int, start: float, interval: float, times: "array[float] | None") -> None:
        self.count, self.start, self.interval, self.times = count, start, interval, times

    def instant(self, index: int) -> float:
        """Return the time of a sample, s."""
        return self.start + index * self.interval if self.times is None else self.times[index]

    def span(self, left: int, right: int) -> float:
        """Return the time between two samples, s."""
        return (right - left) * self.interval if self.times is None else self.times[right] - self.times[left]

    def index_before(self, time: float, near: int) -> int:
        """Return the last sample that is not after `time`, or the first; `near` is where to look first."""
        last = self.count - 1
        if self.times is None:
            place = (time - self.start) / self.interval
            return 0 if place < 0.0 else last if place >= last else int(place)
        for index in (near, min(near + 1, last - 1)):
            if self.times[index] <= time < self.times[min(index + 1, last)]:
                return index
        return max(0, bisect_right(self.times, time) - 1)


class Place:
    """Where a time lies on an axis: `since` seconds after sample `index`, or at it, or outside the record."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.time = math.nan
        self.index = 0
        self.since = 0.0
        self.on_sample = self.outside = False

    def seek(self, time: float) -> None:
        """Go to `time`, s; a finite one."""
        if time == self.time:
            return
        axis, last = self.axis, self.axis.count - 1
        index = axis.index_before(time, self.index)
        segment = min(index, last - 1)
        room = SAME_INSTANT * axis.span(segment, segment + 1) + ROUNDINGS * math.ulp(time)
        if index < last and axis.instant(index + 1) - time <= room:
            index += 1
        self.time, self.index = time, index
        self.since = time - axis.instant(index)
        self.on_sample = abs(self.since) <= room
        self.outside = not self.on_sample and (self.since < 0.0 or index == last)


class Player:
    """One channel at one instant: value, slope of what comes, whether the value was measured."""

    def __init__(self, values: "array[float]", place: Place) -> None:
        self.values, self.place = values, place
        self._around = (0, 0)
        self._time = math.nan
        self._now = (math.nan, math.nan, False)

    def at(self, time: float) -> tuple[float, float, bool]:
        """Return value, slope (1/s) and validity at `time`, s, of the record."""
        if time != self._time:
            self._time = time
            # a parameter that is no number shows in the outputs
            self._now = (math.nan, math.nan, False) if not math.isfinite(time) else self._found(time)
        return self._now

    def _found(self, time: float) -> tuple[float, float, bool]:
        place, values = self.place, self.values
        place.seek(time)
        index = place.index
        left, right = self._good_around(index)
        if left == index and place.on_sample:
            slope = 0.0 if right == len(values) else self._slope(left, right)
            # the rest of a step that falls short of the sample is the end of the segment before
            before = self._slope(*self._good_around(index - 1)) if place.since < 0.0 else slope
            return values[index] + before * place.since, slope, True
        if place.outside or left < 0 or right == len(values):
            return values[left if left >= 0 else right], 0.0, False
        slope = self._slope(left, right)
        value = values[left] + slope * (place.axis.span(left, index) + place.since)
        return value, slope, (left, right) == (index, index + 1)

    def _slope(self, left: int, right: int) -> float:
        """Return the slope between two good samples; 0 before the first."""
        if left < 0:
            return 0.0
        return (self.values[right] - self.values[left]) / self.place.axis.span(left, right)

    def _good_around(self, index: int) -> tuple[int, int]:
        """Return the last good sample up to `index` (-1: none) and the first after it (the count: none)."""
        left, right = self._around
        if not left <= index < right:
            values, left, right = self.values, index, index + 1
            while left >= 0 and math.isnan(values[left]):
                left -= 1
            while right < len(values) and math.isnan(values[right]):
                right += 1
            self._around = left, right
        return left, right


class Replay(Fmi2Slave):  # type: ignore[misc, unused-ignore]
    """Plays recorded channels: a function of time alone, linear between samples."""

    description = "Recorded channels: value, slope and validity of each at the communication points"

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._time = 0.0
        self._parameters: dict[str, float] = {}
        axes, channels = load_signals(Path(self.resources, FOLDER))
        self._register_parameter("time_shift", 0.0, "Time by which the record is played later")
        places = {name: Place(axis) for name, axis in axes.items()}
        for name, (axis, values) in channels.items():
            self._register_channel(name, Player(values, places[axis]))
        self.default_experiment = _experiment(list(axes.values()))

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Go to the start time."""
        self._time = start_time

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Go to the end of the step."""
        self._time = current_time + step_size
        return True

    def _register_channel(self, name: str, player: Player) -> None:
        known = self._parameters
        gain, offset = f"{name}_gain", f"{name}_offset"

        def now(part: int) -> float:
            return player.at(self._time - known["time_shift"])[part]

        self._register_output(
            name, lambda: known[gain] * now(0) + known[offset], "Value, gain and offset applied"
        )
        self._register_output(
            f"{name}_rate",
            lambda: known[gain] * now(1),
            "Slope of the segment between samples that begins here; 0 outside the record",
        )
        valid = Boolean(
            f"{name}_valid",
            causality=Fmi2Causality.output,
            variability=Fmi2Variability.discrete,
            initial=Fmi2Initial.calculated,
            description="Was the value measured? false in gaps and outside the record",
            getter=lambda: now(2),
        )
        self.register_variable(valid)
        self._register_parameter(gain, 1.0, f"Factor of {name} and its slope; -1 turns its polarity")
        self._register_parameter(offset, 0.0, f"Added to {name}")

    def _register_output(self, name: str, getter: Callable[[], float], description: str) -> None:
        variable = Real(
            name,
            causality=Fmi2Causality.output,
            variability=Fmi2Variability.continuous,
            initial=Fmi2Initial.calculated,
            description=description,
            getter=getter,
        )
        self.register_variable(variable)

    def _register_parameter(self, name: str, start: float, description: str) -> None:
        self._parameters[name] = start
        variable = Real(
            name,
            causality=Fmi2Causality.parameter,
            variability=Fmi2Variability.fixed,
            initial=Fmi2Initial.exact,
            description=description,
            getter=lambda: self._parameters[name],
            setter=lambda value: self._parameters.__setitem__(name, value),
        )
        self.register_variable(variable)


def _experiment(axes: list[Axis]) -> Any:
    spans = [(axis.instant(0), axis.instant(axis.count - 1), axis.count) for axis in axes]
    step = min((end - start) / (count - 1) for start, end, count in spans)
    start, end = min(span[0] for span in spans), max(span[1] for span in spans)
    return DefaultExperiment(start_time=start, stop_time=end, step_size=step)


Signals = tuple[dict[str, Axis], dict[str, tuple[str, "array[float]"]]]


def load_signals(folder: Path) -> Signals:
    """Return the axes by name, and of each channel, in the order of their names, its axis and its values.

    Raises
    ------
    ValueError
        The files are not as README.md describes them.
    """
    files = sorted(folder.glob("*"))
    # pythonfmu keeps the object of every instance and every reset for good: they share one copy of the data
    return _loaded(folder, tuple((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in files))


@lru_cache(maxsize=KEPT_FILES)
def _loaded(folder: Path, stamps: tuple[tuple[str, int, int], ...]) -> Signals:
    header = _header(folder / HEADER)
    axes = {name: _axis(folder, name, facts) for name, facts in header["axes"].items()}
    channels = {}
    for name, facts in sorted(header["channels"].items()):
        if facts.get("axis") not in axes:
            _refuse(f"{HEADER}: {name}: axis: expected one of {', '.join(axes)}, got {facts.get('axis')!r}.")
        channels[name] = (
            facts["axis"],
            _channel_values(folder / f"channel_{name}.f64", axes[facts["axis"]].count),
        )
    return axes, channels


def _header(path: Path) -> dict[str, dict[str, dict[str, Any]]]:
    if not path.is_file() or path.stat().st_size > HEADER_LIMIT:
        _refuse(f"{HEADER}: expected a file of at most {HEADER_LIMIT} bytes, got none or a longer one.")
    try:
        header = json.loads(path.read_bytes())
    except ValueError as error:
        _refuse(f"{HEADER}: expected JSON, got: {error}.")
    tables = [header.get(key) for key in ("axes", "channels")] if isinstance(header, dict) else []
    if not tables or header.get("format") != FORMAT:
        _refuse(f'{HEADER}: format: expected "{FORMAT}", got another.')
    if not all(isinstance(t, dict) and t and all(isinstance(f, dict) for f in t.values()) for t in tables):
        _refuse(f"{HEADER}: expected tables of axes and of channels, got others.")
    return dict(header)


def _axis(folder: Path, name: str, facts: dict[str, Any]) -> Axis:
    count: Any = facts.get("count")
    if type(count) is not int or not 2 <= count <= SAMPLE_LIMIT:
        _refuse(f"{HEADER}: axis {name}: count: expected 2 to {SAMPLE_LIMIT}, got {count!r}.")
    if "interval" not in facts:
        times = _numbers(folder / f"times_{name}.f64", count)
        if not math.isfinite(times[0]) or times[-1] == math.inf or not all(map(lt, times, times[1:])):
            _refuse(f"times_{name}.f64: expected finite times that ascend strictly, got others.")
        return Axis(count, times[0], 0.0, times)
    numbers: list[Any] = [facts.get("start"), facts["interval"]]
    if not all(type(x) in (int, float) and math.isfinite(x) for x in numbers) or numbers[1] <= 0.0:
        _refuse(f"{HEADER}: axis {name}: expected a finite start and an interval > 0, got {numbers}.")
    return Axis(count, float(numbers[0]), float(numbers[1]), None)


def _channel_values(path: Path, count: int) -> "array[float]":
    values = _numbers(path, count)
    if any(map(math.isinf, values)) or all(map(math.isnan, values)):
        _refuse(f"{path.name}: expected finite numbers, NaN in gaps only, got infinity or no number at all.")
    return values


def _numbers(path: Path, count: int) -> "array[float]":
    size = path.stat().st_size if path.is_file() else -1
    if size != 8 * count:
        got = "no file" if size < 0 else f"{size}"
        _refuse(f"{path.name}: expected {8 * count} bytes, {count} little-endian float64, got {got}.")
    numbers = array("d", path.read_bytes())
    if sys.byteorder == "big":
        numbers.byteswap()
    return numbers


def _refuse(message: str) -> Any:
    # pythonfmu hands the message of an exception to FMI's logger as a format
    raise ValueError(message.replace("%", "%%"))
