"""A run with sampled channels of a measuring chain, or with a force held from sample to sample: by blocks, in C.

Sample k of the clock is taken at begin + k / rate; the channel at place c of the scene is sampled c skews later. The
same clock holds a force that falls with the distance, from the start of the run on. Before the recording, the load
cell is followed until its start state has decayed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.measuring.chain import MeasuringChain, held_exciter
from vibroimpact.orchestrator.run.record import ROW_IMPACT, Rows, RunEnded, in_time_order
from vibroimpact.orchestrator.run.time_series import TimeSeriesPlan
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS, DRIVE

Floats = NDArray[np.float64]
INSTANTS_OF_A_BLOCK = 2048
MOST_INSTANTS_BEFORE = 10**6
"""Largest number of instants before the recording that a load cell is followed: without damping it never settles."""
_ROUNDING = 1e-12
"""Relative distance by which a last sample may lie beyond the end of the recording, by rounding."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """The values at the instants of a block; the first instant is the end of the block before."""

    times: Floats
    """Instants, s, shape (instant,)."""
    rows: Floats
    """Variables of the FMU, SI, shape (instant, variable)."""
    volts: Mapping[str, Floats]
    """Voltages by channel, V, shape (instant,)."""

    def last(self) -> _Seen:
        """Return the values at the last instant."""
        volts = {name: values[-1:] for name, values in self.volts.items()}
        return _Seen(self.times[-1:], self.rows[-1:], volts)


class MeasuredRun:
    """One run through its samples.

    The scene is at its point, and the driver has begun at time 0. `parameters` belong to the body; `window` is start
    and end of the recording, s.
    """

    def __init__(
        self,
        scene: Scene,
        driver: BodyDriver,
        plan: TimeSeriesPlan,
        parameters: Mapping[str, float],
        window: tuple[float, float],
    ) -> None:
        self._scene, self._driver, self._plan, self._parameters = scene, driver, plan, parameters
        self._begin, self._end = window
        self._chain = MeasuringChain(scene, scene.channels)
        self._exciter = held_exciter(scene) if scene.falling_force else None
        self._rate = scene.sampling_rate if scene.daq is None else scene.daq.true_rate
        finest = self._chain.finest
        self._pieces = max(1, math.ceil((1.0 - _ROUNDING) / self._rate / finest)) if finest else 1
        self._skew = 0.0 if scene.daq is None else scene.daq.skew
        self._last = self._whole(self._end - self._begin)
        self._variables = tuple(dict.fromkeys((*plan.variables, *self._chain.variables)))
        self._sampled: list[Floats] = []

    def _whole(self, span: float) -> int:
        """Return the number of whole samples in a span of time, s."""
        return math.floor(span * self._rate * (1.0 + _ROUNDING))

    @property
    def needs_impacts(self) -> bool:
        """Whether the load cell needs the impacts of the body, recorded or not."""
        return self._chain.needs_impacts

    def samples(self) -> Floats:
        """Return the samples, shape (sample, 1 + variable): nominal time, then the variables of the scene."""
        width = 1 + len(self._plan.all_names)
        return np.concatenate(self._sampled) if self._sampled else np.empty((0, width))

    # ---- the clock ----

    def _edge(self, number: int) -> float:
        """Return the time of sample `number`, s; the end of the recording for samples after it."""
        time = self._begin + number / self._rate
        return min(time, self._end) if number <= self._last else self._end

    def _edges(self, numbers: NDArray[np.int64]) -> Floats:
        times = self._begin + numbers / self._rate
        return np.where(numbers <= self._last, np.minimum(times, self._end), self._end)

    def _instants(self, first: int, stop: int) -> Floats:
        """Return all instants of the samples `first` to `stop - 1`, up to the time of sample `stop`, s."""
        numbers = np.arange(first, stop)
        edges, end = self._edges(numbers)[:, np.newaxis], self._edge(stop)
        ring = edges + np.arange(self._pieces) / (self._pieces * self._rate)
        skewed = edges + self._skew * np.arange(max(1, len(self._chain.channels)))
        found = np.unique(np.concatenate([ring.ravel(), skewed.ravel(), self._own(first, stop), [end]]))
        return found[found <= end]

    def _own(self, first: int, stop: int) -> Floats:
        """Return the instants of a time series without channels, which has a rate of its own, s."""
        rate = self._scene.sampling_rate
        if self._chain.channels or not rate or stop <= 0:
            return np.empty(0)
        begin, end = self._edge(max(first, 0)), self._edge(stop)
        number = np.arange(
            math.floor((begin - self._begin) * rate), math.ceil((end - self._begin) * rate) + 1
        )
        times = np.minimum(self._begin + number / rate, self._end)
        inside = (times >= begin) & ((times < end) | (stop > self._last)) & (number >= 0)
        return np.unique(times[inside & (times <= end)])

    def _volts_at(self, times: Floats) -> Floats:
        """Return the drive voltage of the scene at instants, V; 0 without a forcing."""
        forcing = self._scene.forcing
        if forcing is None:
            return np.zeros(len(times))
        angle = forcing.angular_frequency * times + self._parameters["forcing.phase"]
        return np.asarray(forcing.scalar_amplitude * np.cos(angle), dtype=np.float64)

    # ---- blocks ----

    def go(self, begin_recording: Callable[[], None]) -> None:
        """Run to the end of the recording; call `begin_recording` at its start.

        ImpactLimitReached, DeadlineReached: the run ends early; `samples` has the samples until then.
        """
        seen = self._start()
        if self._first == 0:
            begin_recording()
        for first, stop in self._blocks():
            seen = self._block(first, stop, seen).last()
            if stop == 0:
                self._driver.rows.blocks = []
                begin_recording()

    @property
    def _first(self) -> int:
        """Number of the first sample of the blocks: 0, or below 0 before the recording."""
        before = self._whole(self._begin)
        if self._exciter is None:
            lead = min(self._chain.lead * self._rate, float(before), MOST_INSTANTS_BEFORE / self._pieces)
            before = math.ceil(lead)
        return next(number for number in itertools.count(-before) if self._edge(number) >= 0.0)

    def _blocks(self) -> Iterator[tuple[int, int]]:
        """Yield the samples of each block, [first, stop); a block begins at the start of the recording."""
        size = max(1, INSTANTS_OF_A_BLOCK // (self._pieces + len(self._chain.channels)))
        for begin, end in ((self._first, 0), (0, self._last + 1)):
            for first in range(begin, end, size):
                yield first, min(first + size, end)

    def _start(self) -> _Seen:
        """Run to the start of the blocks; return the values there."""
        driver, time = self._driver, self._edge(self._first)
        volts = self._volts_at(np.zeros(1))
        if self._exciter is not None and time > 0.0:
            driver.hold(np.array([time]), volts, (), exciter=self._exciter, recording=True)
        driver.advance(time)
        driver.record(impacts=self._chain.needs_impacts, extrema=False, periods=False)
        row = driver.values_of(self._variables)
        now = np.array([time])
        values = dict(zip(self._variables, row[:, np.newaxis], strict=True))
        found = self._chain.begin(time, self._absolute(values, now))
        if DRIVE in self._chain.channels:
            found[DRIVE] = volts if self._exciter is not None else self._volts_at(now)
        return _Seen(now, row[np.newaxis], found)

    def _block(self, first: int, stop: int, before: _Seen) -> _Seen:
        """Run through a block, take its samples, and return its values."""
        times = self._instants(first, stop)
        ends, steps = times[1:], len(times) - 1
        edges = self._edges(np.arange(first, stop))
        if self._exciter is not None:
            held = self._volts_at(edges)[np.searchsorted(edges, times[:-1], side="right") - 1]
            renewed = np.isin(times[:-1], edges).astype(np.uint8)
        else:
            held = np.full(steps, self._parameters.get("force", 0.0))
            renewed = np.zeros(steps, dtype=np.uint8)  # the force is a parameter of the run
        known = len(self._driver.rows.blocks)
        limit: RunEnded | None = None
        try:
            rows = self._driver.hold(
                ends, held, self._variables, renewed=renewed, exciter=self._exciter, recording=True
            )
        except RunEnded as reached:
            rows, limit = reached.samples, reached
        ends, held = ends[: len(rows)], held[: len(rows)]
        impacts = in_time_order(Rows(self._driver.rows.blocks[known:]).of_kind(ROW_IMPACT))
        seen = self._joined(before, ends, rows, held, impacts)
        self._take_samples(first, stop, seen)
        if limit is not None:
            raise limit
        return seen

    def _joined(self, before: _Seen, ends: Floats, rows: Floats, held: Floats, impacts: Floats) -> _Seen:
        values = {name: np.ascontiguousarray(rows[:, place]) for place, name in enumerate(self._variables)}
        within = impacts[impacts[:, 0] <= ends[-1]] if len(ends) else impacts[:0]
        found = self._chain.volts(ends, self._absolute(values, ends), within)
        if DRIVE in self._chain.channels:
            found[DRIVE] = held if self._exciter is not None else self._volts_at(ends)
        volts = {name: np.append(before.volts[name], found[name]) for name in found}
        return _Seen(np.append(before.times, ends), np.concatenate([before.rows, rows]), volts)

    def _absolute(self, values: Mapping[str, Floats], times: Floats) -> dict[str, Floats]:
        """Return values of variables with absolute accelerations: the base is added to relative ones."""
        found = dict(values)
        if "acceleration" in found:
            found["acceleration"] = found["acceleration"] + self._plan.base(
                self._scene.forces, self._parameters, times
            )
        return found

    # ---- samples ----

    def _take_samples(self, first: int, stop: int, seen: _Seen) -> None:
        if stop <= 0:
            return
        if not self._chain.channels:
            times = self._own(first, stop)
            times = times[times <= seen.times[-1]]
            self._sampled.append(self._row_table(times, times, seen))
            return
        numbers = np.arange(first, min(stop, self._channel_samples()))
        edges = self._edges(numbers)
        last = edges + self._skew * (len(self._chain.channels) - 1)
        numbers, edges = numbers[last <= seen.times[-1]], edges[last <= seen.times[-1]]
        nominal = self._begin + numbers / self._scene.sampling_rate
        self._sampled.append(self._row_table(nominal, edges, seen))

    def _channel_samples(self) -> int:
        """Return the number of samples with all channels before the end of the recording."""
        behind = self._skew * (len(self._chain.channels) - 1)
        return max(0, self._whole(self._end - self._begin - behind) + 1)

    def _row_table(self, nominal: Floats, edges: Floats, seen: _Seen) -> Floats:
        """Return the samples at edges of the clock, each channel with its skew, shape (sample, 1 + variable)."""
        at = np.searchsorted(seen.times, edges)
        plain = self._plan.rows(seen.rows[at], self._variables, self._scene.forces, self._parameters, edges)
        columns, place = [nominal], 0
        for name in self._plan.all_names:
            if name in CHANNELS:
                skewed = edges + self._skew * self._chain.channels.index(name)
                columns.append(seen.volts[name][np.searchsorted(seen.times, skewed)])
            else:
                columns.append(plain[:, place])
                place += 1
        return np.column_stack(columns)
