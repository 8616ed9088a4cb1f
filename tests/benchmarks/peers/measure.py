"""Error and processor time of each way at each setting, in turns."""

from __future__ import annotations

import gc
import math
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from typing import Any

from peers import cvode, fmpy_import, fused, jax_flights, solve_ivp, time_stepping
from peers.problems import Case, Problem
from peers.references import off_second_road, reference
from peers.ways import Clock, Found, LateError, Run, Way
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS, Errors, errors_of
from vibroimpact.orchestrator.study.references import Reference

CAP = 2.0
"""Longest processor time of one run of a problem, s; a longer run is a failure."""
ROUNDS = 3
LONG = 0.25
"""Processor time of a run, s, above which it is timed only in the first round."""
LEAST = 0.02
"""Processor time of a measurement, s: a quicker run is repeated until it is used up."""
MODULES = {
    "scikit-sundae": "sksundae",
    "diffrax": "diffrax",
    "mujoco": "mujoco",
    "scipy": "scipy",
    "FMPy": "fmpy",
}


@dataclass
class Row:
    """A way at one setting on one case.

    Attributes
    ----------
    error : float
        Relative error; NaN where there is a failure.
    failure : str
        Reason of a failure; empty without one.
    seconds : list of float
        Processor time of a run over its number of forcing periods, s, in each round.
    rest_error : float
        Error of the end of the first chatter, over the period; NaN where there is none.
    impacts_seen : int
        In a ladder: number of rungs above the stop whose impact was found.
    growth : list of float
        Relative velocity error of each of the first impacts of chaotic motion; empty elsewhere.
    """

    case: str
    way: str
    knob: str
    setting: float
    ours: bool
    error: float = math.nan
    failure: str = ""
    seconds: list[float] = field(default_factory=list)
    rest_error: float = math.nan
    impacts_seen: int = 0
    growth: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Median processor time per forcing period, s; NaN without a timing."""
        return statistics.median(self.seconds) if self.seconds else math.nan

    def record(self) -> dict[str, Any]:
        """Return the row for JSON, where NaN is None."""
        own = {key: None if value != value else value for key, value in asdict(self).items()}
        own["seconds"] = [float(f"{value:.4g}") for value in self.seconds]
        own["growth"] = [float(f"{value:.2g}") for value in self.growth]
        own["error"] = None if self.error != self.error else float(f"{self.error:.3g}")
        return own


def all_ways() -> list[Way]:
    """Return all ways, ours first."""
    modules = (fused, fmpy_import, solve_ivp, cvode, jax_flights, time_stepping)
    return [way for module in modules for way in module.ways()]


def is_installed(way: Way) -> bool:
    """Return whether the package of a way is installed."""
    return not way.package or find_spec(MODULES[way.package]) is not None


def measured(case: Case) -> tuple[list[Row], dict[str, float]]:
    """Measure all ways on a case; also return the reference's estimated error, and its distance from the second."""
    known = {name: reference(problem) for name, problem in case.rungs.items()}
    roads = [off_second_road(problem, known[name], case.quantity) for name, problem in case.rungs.items()]
    rows: list[Row] = []
    timed: list[tuple[Row, list[Run], int]] = []
    for way in all_ways():
        settings = way.settings(next(iter(case.rungs.values()))) if is_installed(way) else (math.nan,)
        for setting in settings:
            row = Row(case.key, way.name, way.knob, setting, way.ours)
            rows.append(row)
            if not is_installed(way):
                row.failure = f"{way.package} is not installed"
                continue
            runs = _tried(case, known, way, setting, row)
            if runs is not None:
                timed.append((row, *runs))
            print(f"  {way.name:32} {setting:8g} {row.error:9.1e} {row.failure}", file=sys.stderr, flush=True)
    for turn in range(ROUNDS):
        for row, runs_of, share in timed:
            if turn and row.seconds[0] * case.periods * share > LONG:
                continue
            row.seconds.append(_seconds(runs_of) / (case.periods * share))
    errors = [estimate(one, case.quantity) for one in known.values()]
    return rows, {
        "estimate": max(errors),
        "second_road": max((off for off in roads if off == off), default=math.nan),
    }


def estimate(known: Reference, quantity: str) -> float:
    """Return the estimated error of a reference in a quantity, or the largest of all quantities."""
    return max(known.error.values()) if quantity == "all" else known.error[quantity]


def _tried(
    case: Case, known: Mapping[str, Reference], way: Way, setting: float, row: Row
) -> tuple[list[Run], int] | None:
    """Run a way once, and note its error; None where the run failed or was too slow."""
    runs: list[Run] = []
    found: list[Found] = []
    try:
        for problem in case.rungs.values():
            run = way.open(problem, setting, Clock(CAP * way.batch))
            runs.append(run)
            found.append(run())
    except LateError:
        row.failure = f"did not finish in {CAP:g} s"
        return None
    except ArithmeticError as error:
        row.failure = str(error).splitlines()[0]
        return None
    errors = [
        errors_of(one.observation, known[name].observation, known[name].scales)
        for name, one in zip(case.rungs, found, strict=True)
    ]
    row.failure, row.impacts_seen = _failure(case, known, errors)
    if not row.failure:
        row.error = max((e for e in (one.worst(case.quantity) for one in errors) if e == e), default=math.nan)
    if case.key == "chaos":
        row.growth = errors[0].growth[:FIRST_IMPACTS].tolist()
    if case.key == "chatter" and len(found[0].rests):
        row.rest_error = (
            abs(float(found[0].rests[0]) - END_OF_CHATTER) / next(iter(case.rungs.values())).period
        )
    return runs, found[0].share


END_OF_CHATTER = 2.50982609171410943
"""End of the first chatter of examples/chatter.toml, s: from equations.md 9, computed there in 40 digits."""


def _failure(case: Case, known: Mapping[str, Reference], errors: Sequence[Errors]) -> tuple[str, int]:
    if len(errors) == 1:
        return errors[0].failure, 0
    hit = {name: len(one.observation.impacts) > 0 for name, one in known.items()}
    rungs = dict(zip(case.rungs, errors, strict=True))
    above = [one for name, one in rungs.items() if hit[name]]
    missed = sum(bool(one.failure) for one in above)
    extra = sum(bool(one.failure) for name, one in rungs.items() if not hit[name])
    words = [f"missed {missed} of {len(above)} grazes"] if missed else []
    words += [f"hit {extra} of {len(rungs) - len(above)} stops out of reach"] if extra else []
    return ", ".join(words), len(above) - missed


def _seconds(runs: Sequence[Run]) -> float:
    """Return the processor time of one run of all given runs, s."""
    gc.collect()
    count, began = 0, time.process_time()
    while True:
        for run in runs:
            run()
        count += 1
        spent = time.process_time() - began
        if spent > LEAST:
            return spent / count


def cost_of_a_run(problem: Problem) -> float:
    """Return the median processor time of a fused run, s; a short problem gives the fixed cost of a run."""
    run = fused.opened(problem, math.nan, Clock(CAP))
    run()
    return statistics.median(_seconds([run]) for _ in range(ROUNDS))
