"""The list of hard cases, and the measurement of selected cases."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from operator import attrgetter

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase
from vibroimpact.orchestrator.hard_cases.finding import CASES as FINDING
from vibroimpact.orchestrator.hard_cases.growing import CASES as GROWING
from vibroimpact.orchestrator.hard_cases.impacts import CASES as IMPACTS
from vibroimpact.orchestrator.hard_cases.limits import CASES as LIMITS
from vibroimpact.orchestrator.hard_cases.loose import CASES as LOOSE
from vibroimpact.orchestrator.hard_cases.places import CASES as PLACES
from vibroimpact.orchestrator.hard_cases.rests import CASES as RESTS
from vibroimpact.orchestrator.hard_cases.scales import CASES as SCALES
from vibroimpact.orchestrator.hard_cases.several import CASES as SEVERAL
from vibroimpact.orchestrator.hard_cases.yielding import CASES as YIELDING

CASES: tuple[HardCase, ...] = (
    *(*FINDING, *IMPACTS, *PLACES, *RESTS),
    *(*YIELDING, *SEVERAL, *GROWING, *LOOSE, *SCALES, *LIMITS),
)
"""In the order of docs/hard_cases.md."""
_ONLY = Argument("only")
TABLE = ResultTable(
    "hard_cases",
    ("figure", "case", "1", "what was measured"),
    ("bound", "case", "1", "what it may be at most"),
    ("is_met", "case", "1", "the figure is within its bound"),
    ("seconds", "case", "s", "processor time"),
    ("x", "case point", "1", "abscissa of what is drawn, in the unit of x_label"),
    ("y", "case point", "1", "ordinate of what is drawn, in the unit of y_label"),
    ("x_log", "case", "1", "its abscissa is logarithmic"),
    ("y_log", "case", "1", "its ordinate is logarithmic"),
    ("is_bounded", "case", "1", "the bound is one of the ordinate"),
    ("name", "case", "1", "name of the case", "text"),
    ("theme", "case", "1", "what it is about", "text"),
    ("hard", "case", "1", "what is hard", "text"),
    ("claim", "case", "1", "what is to hold", "text"),
    ("reference", "case", "1", "what the figure is measured against", "text"),
    ("of", "case", "1", "what the figure is", "text"),
    ("verdict", "case", "1", "met, wrong or slow", "text"),
    ("failure", "case", "1", "why it did not run", "text"),
    ("x_label", "case", "1", "name of the abscissa", "text"),
    ("y_label", "case", "1", "name of the ordinate", "text"),
)
_PATHS = {
    "figure": "found.figure",
    "bound": "case.bound",
    "is_met": "is_met",
    "seconds": "seconds",
    "x_log": "found.curve.x_log",
    "y_log": "found.curve.y_log",
    "is_bounded": "found.curve.is_bounded",
    "name": "case.name",
    "theme": "case.theme",
    "hard": "case.title",
    "claim": "case.claim",
    "reference": "case.reference",
    "of": "case.of",
    "verdict": "verdict",
    "failure": "failure",
    "x_label": "found.curve.x_label",
    "y_label": "found.curve.y_label",
}
"""Path of each variable's value in `Measured`."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A hard case with its measurement.

    Attributes
    ----------
    case : HardCase
    found : Found
        Its figure is NaN if the case did not run.
    seconds : float
        Processor time, s.
    failure : str
        Reason why it did not run; empty if it ran.
    """

    case: HardCase
    found: Found
    seconds: float
    failure: str = ""

    @property
    def is_met(self) -> bool:
        """Whether the figure is within its bound."""
        return not self.failure and self.found.figure <= self.case.bound

    @property
    def verdict(self) -> str:
        """Verdict on the figure: `met`, `wrong`, or `slow` for a time on a busy or old machine."""
        if self.is_met:
            return "met"
        return "slow" if self.case.is_time and self.found.figure < math.inf else "wrong"


def cases_named(names: Sequence[str]) -> list[HardCase]:
    """Return the cases of these names, in the order of the list; all cases without names.

    Raises
    ------
    UsageError
        A name is unknown, or occurs twice.
    """
    known = {case.name: case for case in CASES}
    chosen = _as_texts(names)
    for name, times in Counter(chosen).items():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"Did you mean {near[0]}?" if near else f"There are {', '.join(known)}."
            raise UsageError(message(_ONLY, f": expected the name of a hard case, got {name!r}. {hint}"))
        if times > 1:
            raise UsageError(message(_ONLY, f": expected each name once, got {name!r} {times} times."))
    return [case for case in CASES if not chosen or case.name in chosen]


def _as_texts(names: object) -> list[str]:
    """Return names as a list; UsageError if one is no text."""
    listed: list[str] = []
    for name in names if isinstance(names, Iterable) else [names]:
        if not isinstance(name, str):
            raise UsageError(message(_ONLY, f": expected the name of a hard case, got {name!r}."))
        listed.append(name)
    return listed


def measured_cases(
    names: Sequence[str] = (), *, clock: Callable[[], float] = time.process_time
) -> Generator[Measured, None, None]:
    """Run hard cases, and yield each as soon as it has run.

    Parameters
    ----------
    names : sequence of str
        Cases to run; without names all.
    clock : callable
        Returns the processor time since some instant, s.

    Raises
    ------
    UsageError
        There is no such case.
    """
    for case in cases_named(names):
        yield _measured(case, clock)


def _measured(case: HardCase, clock: Callable[[], float]) -> Measured:
    began = clock()
    try:
        found, failure = case.measure(), ""
    except ComponentError as error:
        nothing = Curve(np.empty(0), np.empty(0), "", "")
        found, failure = Found(math.nan, nothing), str(error).splitlines()[0]
    return Measured(case, found, clock() - began, failure)


def dataset_of(measured: Sequence[Measured]) -> xr.Dataset:
    """Return the measurements as a dataset of kind `hard_cases`."""
    points = max((len(one.found.curve.x) for one in measured), default=0)
    x, y = (np.full((len(measured), points), np.nan) for _ in range(2))
    for place, one in enumerate(measured):
        x[place, : len(one.found.curve.x)] = one.found.curve.x
        y[place, : len(one.found.curve.y)] = one.found.curve.y
    columns = {name: [attrgetter(path)(one) for one in measured] for name, path in _PATHS.items()}
    missed = [one.case.name for one in measured if not one.is_met]
    attributes = {"title": "Hard cases", "missed": ", ".join(missed)}
    return TABLE.dataset({**columns, "x": x, "y": y}, attributes)
