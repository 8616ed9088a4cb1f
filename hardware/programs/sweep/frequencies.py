"""The frequencies of a sweep: a list, or a range with a number of points or a step."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted, read_table

_KEY = "sweep.frequency"
_WHOLE = 1e-6
"""Share of a step by which rounding may miss the last frequency."""
_DIGITS = 12


class RangeTable(BaseModel):
    """`frequency = { start, stop, step or points }`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    start: Annotated[FiniteFloat, Field(gt=0.0), Rule("a number > 0", "Hz")]
    stop: Annotated[FiniteFloat, Field(gt=0.0), Rule("a number > 0", "Hz")]
    step: Annotated[FiniteFloat | None, Field(gt=0.0), Rule("a number > 0", "Hz")] = None
    points: Annotated[int | None, Field(ge=2), Rule("a whole number >= 2")] = None


def frequencies_of(raw: Any, problems: list[Problem], most: int) -> tuple[float, ...] | None:
    """Return the ascending frequencies (Hz) of an array or table, at most `most`; None, with problems added, if wrong.

    >>> frequencies_of({"start": 18.0, "stop": 18.3, "step": 0.1}, [], 10)
    (18.0, 18.1, 18.2, 18.3)
    """
    before = len(problems)
    found = _listed(raw, problems) if isinstance(raw, list) else _spanned(raw, problems, most)
    if found is not None and len(found) > most:
        problems.append(Problem(_KEY, f"at most {most} steps", f"{len(found)}"))
    return found if len(problems) == before else None


def _listed(raw: list[Any], problems: list[Problem]) -> tuple[float, ...] | None:
    good = [isinstance(one, int | float) and not isinstance(one, bool) for one in raw]
    if not raw or not all(good) or not all(math.isfinite(one) and one > 0.0 for one in raw):
        bad = next((one for one, is_good in zip(raw, good, strict=True) if not (is_good and one > 0.0)), raw)
        problems.append(Problem(_KEY, "frequencies (Hz) > 0", quoted(bad)))
        return None
    for place, (low, high) in enumerate(pairwise(raw), start=1):
        if not low < high:
            problems.append(
                Problem(
                    key_path(("sweep", "frequency", place)),
                    "ascending frequencies",
                    f"{high:g} after {low:g}",
                    'Which way they are gone says path = "up", "down" or "up-down".',
                )
            )
            return None
    return tuple(map(float, raw))


def _spanned(raw: Any, problems: list[Problem], most: int) -> tuple[float, ...] | None:
    if not isinstance(raw, dict):
        hint = "Write frequency = { start = 18.0, stop = 27.0, step = 0.25 }."
        problems.append(Problem(_KEY, "a range or a list of frequencies (Hz)", quoted(raw), hint))
        return None
    table = read_table(RangeTable, raw, ("sweep", "frequency"), problems)
    if table is None:
        return None
    if not table.start < table.stop:
        problems.append(Problem(f"{_KEY}.stop", f"a number > start, {table.start:g}", f"{table.stop:g}"))
        return None
    if (table.step is None) == (table.points is None):
        got = "both" if table.step is not None else "neither"
        problems.append(Problem(_KEY, "either step or points", got))
        return None
    if table.points is not None:
        return tuple(np.linspace(table.start, table.stop, min(table.points, most + 1)).tolist())
    assert table.step is not None
    count = (table.stop - table.start) / table.step
    if count > most:
        problems.append(Problem(f"{_KEY}.step", f"at most {most} steps", f"{count:.3g}"))
        return None
    if abs(count - round(count)) > _WHOLE:
        hint = f"The last step below it ends at {table.start + math.floor(count) * table.step:g}."
        problems.append(
            Problem(f"{_KEY}.step", f"whole steps up to stop, {table.stop:g}", f"{table.step:g}", hint)
        )
        return None
    # 18 + 1 * 0.1 is 18.1, as a person writes it
    return tuple(np.round(table.start + np.arange(round(count) + 1) * table.step, _DIGITS).tolist())
