"""Figures from the lines of a journal: shares of intervals with the truth, of answers, of detected spoiled records."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table
from scipy.stats import binom, norm

from interval_coverage._asked import METHODS
from interval_coverage._records import REGIONS

HELD, HELD_IN_REGION = (0.92, 0.98), (0.93, 0.97)
ANSWERED, ANSWERED_GOOD, FLAGGED = 0.70, 0.90, 0.90
SOMETHING_SURE = 0.60
GOOD_NOISE, GOOD_FLIGHT = 0.02, 12
# Probability of a deviation this large from a target that is just met, below which a share misses its target.
CHANCE = 0.01
FEWEST = 60
"""Intervals below which a cell of the table tells little: chance moves its share by more than the target's width."""

Line = dict[str, Any]


@dataclass(frozen=True)
class Share:
    """A share with its target; it has a standard error if several intervals come from one record."""

    what: str
    hits: int
    total: int
    low: float
    high: float = 1.0
    error: float | None = None

    @property
    def missed(self) -> bool:
        """Whether the deviation from the target is too large for chance."""
        if not self.total:
            return False
        if self.error is not None:
            off = max(self.low - self.hits / self.total, self.hits / self.total - self.high)
            return bool(off > norm.isf(CHANCE) * self.error)
        few = binom.cdf(self.hits, self.total, self.low) < CHANCE
        many = self.high < 1.0 and binom.sf(self.hits - 1, self.total, self.high) < CHANCE
        return bool(few or many)


def shares(lines: Sequence[Line]) -> list[Share]:
    """Return all shares, in the order of the table."""
    clean = [line for line in lines if not line["spoil"]]
    spoiled = [line for line in lines if line["spoil"]]
    good = [line for line in clean if line["noise"] <= GOOD_NOISE and line["flight_samples"] >= GOOD_FLIGHT]
    found = [*_held(clean), *_by_region(clean)]
    for method in METHODS:
        is_answerable = _can_answer(method)
        for words, some, target in (("clean", clean, ANSWERED), ("good", good, ANSWERED_GOOD)):
            able = [line for line in some if is_answerable(line)]
            hits = sum(method in line["sure"] for line in able)
            found.append(Share(f"{method}: answers that are sure, {words} records", hits, len(able), target))
    flagged = sum(not line["sure"] for line in spoiled)
    found.append(Share("spoiled records of which nothing is sure", flagged, len(spoiled), FLAGGED))
    return found


def _held(clean: Iterable[Line]) -> Iterable[Share]:
    """Yield the shares of intervals that contain the truth, by method and quantity."""
    counts: dict[tuple[str, str], list[bool]] = {}
    for line in clean:
        for method, values in line["sure"].items():
            for name, (_, _, low, high, truth) in values.items():
                counts.setdefault((method, name), []).append(low <= truth <= high)
    for method, name in sorted(counts, key=lambda key: (METHODS.index(key[0]), key[1])):
        held = counts[method, name]
        yield Share(f"{method}: {name}", sum(held), len(held), *HELD)


def _by_region(clean: Sequence[Line]) -> Iterable[Share]:
    """Yield the shares of intervals that contain the truth, by region, and of records with at least one sure method.

    The intervals of one record miss together: the standard error uses sums over records.
    """
    for region in REGIONS:
        lines = [line for line in clean if line["region"] == region]
        held = [
            [
                low <= truth <= high
                for values in line["sure"].values()
                for _, _, low, high, truth in values.values()
            ]
            for line in lines
        ]
        hits, total = sum(map(sum, held)), sum(map(len, held))
        if total:
            square = sum((sum(one) - hits / total * len(one)) ** 2 for one in held)
            yield Share(f"{region}: intervals", hits, total, *HELD_IN_REGION, math.sqrt(square) / total)
        sure = sum(bool(line["sure"]) for line in lines)
        yield Share(f"{region}: records of which something is sure", sure, len(lines), SOMETHING_SURE)


def thin_cells(lines: Iterable[Line]) -> dict[tuple[str, str], list[int]]:
    """Return the cells with few intervals, by method and quantity, with the cases of these intervals."""
    cases: dict[tuple[str, str], list[int]] = {}
    for line in lines:
        if line["spoil"] or line["draw"]:
            continue
        for method, values in line["sure"].items():
            for name in values:
                cases.setdefault((method, name), []).append(line["case"])
    return {cell: found for cell, found in cases.items() if len(found) < FEWEST}


def again(lines: Sequence[Line], draws: int) -> list[Share]:
    """Return the shares of the thin cells with further noises for each of their records."""
    found = []
    for (method, name), cases in thin_cells(lines).items():
        intervals = [line["sure"].get(method, {}).get(name) for line in lines if line["case"] in cases]
        held = [low <= truth <= high for _, _, low, high, truth in filter(None, intervals)]
        found.append(Share(f"{method}: {name}, {draws + 1} noises of each", sum(held), len(held), *HELD))
    return found


def _can_answer(method: str) -> Callable[[Line], bool]:
    """Return a test for the records that a method can answer: the others lack a parameter that it takes as known.

    Energy with known damping takes the damping ratio. Energy with an unknown force amplitude has the two equations of
    P(1,1) motion, and no more unknowns only if the damping ratio is known.
    """
    if method in ("energy_known_damping", "energy_amplitude"):
        return lambda line: line["known"] == "damping"
    return lambda line: True


def table_of(found: Sequence[Share]) -> Table:
    """Return the shares as a table."""
    table = Table("what", "share", "of", "target", "")
    for one in found:
        share = f"{100.0 * one.hits / one.total:.1f} %" if one.total else "-"
        share += f" +- {100.0 * one.error:.1f}" if one.error is not None else ""
        target = f"{100.0 * one.low:g} to {100.0 * one.high:g} %"
        table.add_row(one.what, share, f"{one.hits}/{one.total}", target, "MISSED" if one.missed else "")
    return table
