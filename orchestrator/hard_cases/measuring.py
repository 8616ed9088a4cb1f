"""The list of hard cases, and what was measured of those that were asked for."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import described
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase
from vibroimpact.orchestrator.hard_cases.finding import CASES as FINDING
from vibroimpact.orchestrator.hard_cases.impacts import CASES as IMPACTS
from vibroimpact.orchestrator.hard_cases.limits import CASES as LIMITS
from vibroimpact.orchestrator.hard_cases.places import CASES as PLACES
from vibroimpact.orchestrator.hard_cases.rests import CASES as RESTS
from vibroimpact.orchestrator.hard_cases.scales import CASES as SCALES
from vibroimpact.orchestrator.hard_cases.several import CASES as SEVERAL
from vibroimpact.orchestrator.hard_cases.yielding import CASES as YIELDING
from vibroimpact.orchestrator.run.provenance import git_commit, versions

CASES: tuple[HardCase, ...] = (
    *(*FINDING, *IMPACTS, *PLACES, *RESTS),
    *(*YIELDING, *SEVERAL, *SCALES, *LIMITS),
)
"""In the order of docs/hard_cases.md."""
_ONLY = Argument("only")


@dataclass(frozen=True, slots=True)
class Measured:
    """A hard case with what was measured.

    Attributes
    ----------
    case : HardCase
    found : Found
        Its figure is NaN where the case did not run.
    seconds : float
        Processor time, s.
    failure : str
        Why it did not run; empty where it did.
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
        """What the figure says: `met`, `wrong`, or `slow` of a time on a machine that is busy or old."""
        if self.is_met:
            return "met"
        return "slow" if self.case.is_time and self.found.figure < math.inf else "wrong"


def cases_named(names: Sequence[str]) -> list[HardCase]:
    """Return the cases of these names, in the order of the list; all of them for no name.

    Raises
    ------
    UsageError
        There is no such case, or one is named twice.
    """
    known = {case.name: case for case in CASES}
    asked = _as_texts(names)
    for name, times in Counter(asked).items():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"Did you mean {near[0]}?" if near else f"There are {', '.join(known)}."
            raise UsageError(message(_ONLY, f": expected the name of a hard case, got {name!r}. {hint}"))
        if times > 1:
            raise UsageError(message(_ONLY, f": expected each name once, got {name!r} {times} times."))
    return [case for case in CASES if not asked or case.name in asked]


def _as_texts(names: object) -> list[str]:
    """Return names as a list; raise UsageError where one is no text."""
    listed: list[str] = []
    for name in names if isinstance(names, Iterable) else [names]:
        if not isinstance(name, str):
            raise UsageError(message(_ONLY, f": expected the name of a hard case, got {name!r}."))
        listed.append(name)
    return listed


def measured_cases(
    names: Sequence[str] = (),
    told: Callable[[Measured], None] = lambda measured: None,
    *,
    clock: Callable[[], float] = time.process_time,
) -> list[Measured]:
    """Run hard cases.

    Parameters
    ----------
    names : sequence of str
        Those to run; none: all.
    told : callable
        Given each as soon as it has run.
    clock : callable
        Returns the processor time since some instant, s.

    Raises
    ------
    UsageError
        There is no such case.
    """
    found = []
    for case in cases_named(names):
        found.append(_measured(case, clock))
        told(found[-1])
    return found


def _measured(case: HardCase, clock: Callable[[], float]) -> Measured:
    began = clock()
    try:
        found, failure = case.measure(), ""
    except ComponentError as error:
        nothing = Curve(np.empty(0), np.empty(0), "", "")
        found, failure = Found(math.nan, nothing), str(error).splitlines()[0]
    return Measured(case, found, clock() - began, failure)


def dataset_of(measured: Sequence[Measured]) -> xr.Dataset:
    """Return what was measured as a dataset, for `write_results` of kind `hard_cases` and for figures."""
    points = max((len(one.found.curve.x) for one in measured), default=0)
    x, y = (np.full((len(measured), points), np.nan) for _ in range(2))
    for place, one in enumerate(measured):
        x[place, : len(one.found.curve.x)] = one.found.curve.x
        y[place, : len(one.found.curve.y)] = one.found.curve.y
    dataset = xr.Dataset(
        described(
            {
                "figure": ("case", [one.found.figure for one in measured], "1", "what was measured"),
                "bound": ("case", [one.case.bound for one in measured], "1", "what it may be at most"),
                "is_met": ("case", [one.is_met for one in measured], "1", "the figure is within its bound"),
                "seconds": ("case", [one.seconds for one in measured], "s", "processor time"),
                "x": (("case", "point"), x, "1", "abscissa of what is drawn, in the unit of x_label"),
                "y": (("case", "point"), y, "1", "ordinate of what is drawn, in the unit of y_label"),
                "x_log": (
                    "case",
                    [one.found.curve.x_log for one in measured],
                    "1",
                    "its abscissa is logarithmic",
                ),
                "y_log": (
                    "case",
                    [one.found.curve.y_log for one in measured],
                    "1",
                    "its ordinate is logarithmic",
                ),
                "is_bounded": (
                    "case",
                    [one.found.curve.is_bounded for one in measured],
                    "1",
                    "the bound is one of the ordinate",
                ),
            }
        )
    )
    words = {
        "name": ("name of the case", [one.case.name for one in measured]),
        "theme": ("what it is about", [one.case.theme for one in measured]),
        "hard": ("what is hard", [one.case.title for one in measured]),
        "claim": ("what is to hold", [one.case.claim for one in measured]),
        "reference": ("what the figure is measured against", [one.case.reference for one in measured]),
        "of": ("what the figure is", [one.case.of for one in measured]),
        "verdict": ("met, wrong or slow", [one.verdict for one in measured]),
        "failure": ("why it did not run", [one.failure for one in measured]),
        "x_label": ("name of the abscissa", [one.found.curve.x_label for one in measured]),
        "y_label": ("name of the ordinate", [one.found.curve.y_label for one in measured]),
    }
    for name, (meaning, texts) in words.items():
        dataset[name] = ("case", np.array(texts, dtype=object), {"units": "1", "long_name": meaning})
    missed = [one.case.name for one in measured if not one.is_met]
    return dataset.assign_attrs(
        title="Hard cases",
        missed=", ".join(missed),
        versions=json.dumps(versions()),
        git_commit=git_commit(),
    )
