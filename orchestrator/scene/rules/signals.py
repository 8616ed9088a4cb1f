"""Rules of chirps, pulses, tables and random forces: their numbers agree with each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.forcing_clock import signals_of
from vibroimpact.orchestrator.scene.forcing_models import (
    MOST_ROWS,
    MOST_SIGNALS,
    NARROWEST_BAND,
    ChirpForcing,
    PulseForcing,
    RandomForcing,
    TableForcing,
)
from vibroimpact.orchestrator.scene.problems import Problem, quoted

_PLACES = {"table": "instants", "random": "angular frequencies"}


def signal_problems(draft: Draft) -> Iterator[Problem]:
    """Yield the problems of the signals of a scene that are no sines."""
    signals = signals_of(draft.forces)
    if len(signals) > MOST_SIGNALS:
        expected = f"at most {MOST_SIGNALS} chirps, pulses, tables and random forces"
        yield Problem("forcing", expected, f"{len(signals)}")
    for key, force, written in draft.written_forces():
        if isinstance(force, ChirpForcing):
            yield from _of_chirp(draft, key, force)
        elif isinstance(force, PulseForcing):
            yield from _of_pulse(draft, key, force, written)
        elif isinstance(force, TableForcing):
            yield from _of_table(key, force, written)
        elif isinstance(force, RandomForcing):
            yield from _of_random(key, force)
    rows = sum(len(signal.rows[0]) for signal in signals)
    if rows > MOST_ROWS:
        yield Problem("forcing", f"at most {MOST_ROWS} rows of all tables and densities", f"{rows}")


def _of_chirp(draft: Draft, key: str, chirp: ChirpForcing) -> Iterator[Problem]:
    for name in ("angular_frequency", "end_angular_frequency"):
        span = draft.span(f"{key}.{name}")
        if chirp.spacing == "logarithmic" and span is not None and span[0] == 0.0:
            hint = 'Use spacing = "linear" for a chirp from or to 0.'
            yield Problem(f"{key}.{name}", "a number > 0 for a logarithmic chirp", "0", hint)


def _of_pulse(draft: Draft, key: str, pulse: PulseForcing, written: Mapping[str, Any]) -> Iterator[Problem]:
    if pulse.shape != "trapezoid":
        if "rise" in written:
            got = f"it beside {quoted(pulse.shape)}"
            yield Problem(f"{key}.rise", 'rise with shape = "trapezoid"', got, "Remove rise.")
        return
    rise, duration = draft.span(f"{key}.rise"), draft.span(f"{key}.duration")
    if rise is not None and duration is not None and rise[1] > 0.5 * duration[0]:
        expected = f"at most half of the duration, {quoted(0.5 * duration[0])}"
        yield Problem(f"{key}.rise", expected, f"{quoted(rise[1])}{draft.worst('forcing')}")


def _of_table(key: str, table: TableForcing, written: Mapping[str, Any]) -> Iterator[Problem]:
    given = [name for name in ("times", "values", "file") if name in written]
    if given not in (["times", "values"], ["file"]):
        yield Problem(key, "times and values, or file", " and ".join(given) or "neither")
        return
    times, values = table.rows
    if len(times) != len(values):
        got = f"{len(values)} values for {len(times)} times"
        yield Problem(f"{key}.values", "one value for each instant", got)
    else:
        yield from _ascending(f"{key}.{'file' if 'file' in written else 'times'}", table)


def _of_random(key: str, force: RandomForcing) -> Iterator[Problem]:
    places, values = force.rows
    if force.band is None and not places:
        yield Problem(key, "band or density", "neither", "For example band = [1.0, 10.0], in rad/s.")
        return
    unordered = list(_ascending(f"{key}.density", force))
    yield from unordered
    if unordered:
        return
    low, high = force.band or (places[0], places[-1])
    if high == 0.0 or high - low < NARROWEST_BAND * high:
        expected = "a band whose lower end is below its upper end by 1/256 of it or more"
        got = f"{quoted(low)} to {quoted(high)}"
        yield Problem(f"{key}.{'band' if force.band else 'density'}", expected, got)
    elif places and not (places[0] <= low and high <= places[-1]):
        expected = f"a density over all of the band, {quoted(low)} to {quoted(high)}"
        got = f"one from {quoted(places[0])} to {quoted(places[-1])}"
        yield Problem(f"{key}.density", expected, got)
    elif places and not any(values):
        yield Problem(f"{key}.density", "a density > 0 somewhere", "0 everywhere")


def _ascending(where: str, signal: TableForcing | RandomForcing) -> Iterator[Problem]:
    """Yield the problem of the first place of a table that is not after the place before."""
    for number, (before, after) in enumerate(pairwise(signal.rows[0]), start=2):
        if not after > before:
            got = f"{quoted(after)} as number {number}, after {quoted(before)}"
            yield Problem(where, f"{_PLACES[signal.signal]} that ascend", got)
            return
