"""The study `lyapunov`: Lyapunov exponents of the runs of a dataset."""

from __future__ import annotations

import re
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import Outcome
from vibroimpact.analysis.orbits.exponents import ExponentError, Exponents, exponents_of
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.orbits.runs import (
    Bodies,
    ImpactsOf,
    OnSweep,
    RunsStudy,
    results_of,
    scene_of,
    units_of,
)
from vibroimpact.orchestrator.run.provenance import runs_attributes

TABLE = ResultTable(
    "lyapunov",
    ("lyapunov_exponent", "... exponent", "1", "Lyapunov exponent per impact"),
    ("standard_error", "... exponent", "1", "standard error of the exponent"),
    ("impact_interval", "...", "s", "mean time from impact to impact"),
    ("dimension", "...", "1", "Kaplan-Yorke dimension of the attractor of the impact map"),
    ("impacts", "...", "1", "impacts that counted"),
    ("sum_error", "...", "1", "sum of the exponents less its exact value, over their size"),
    ("reason", "...", "1", "why a run has no exponents, else empty", "text"),
    ("exponent", "exponent", "1", "exponent, the largest first"),
)

_NUMBER = re.compile(r"\d+")
_MOST_SHOWN = 30
"""Most runs in the printed table."""


@dataclass(eq=False)
class ExponentsOfRuns(RunsStudy[Exponents | str]):
    """Lyapunov exponents of the runs of a dataset; a row has the exponents of a run, or the reason for none."""

    name = "lyapunov"
    nothing = "a run with exponents"
    named = (DatasetError,)
    all_kinds = True

    def rows(self) -> Generator[Exponents | str, None, None]:
        """Find the exponents of run after run."""
        runs = self.runs.vibroimpact.runs
        self._bodies, impacts = (
            Bodies(scene_of(self.runs, "lyapunov"), runs, all_kinds=True),
            ImpactsOf(self.runs),
        )
        for place in range(runs.sizes["run"]):
            yield _of_run(self._bodies, impacts, runs, place)

    @property
    def is_empty(self) -> bool:
        """Whether no run has exponents."""
        return all(isinstance(each, str) for each in self.found)

    @property
    def why_none(self) -> str:
        """A sentence on a study in which no run has exponents: the reasons with their numbers of runs."""
        counts = _counted([each for each in self.found if isinstance(each, str)])
        reasons = "; ".join(f"{count} of {len(self.found)}: {words}" for words, count in counts)
        return f"lyapunov: expected runs with exponents, got none. {reasons}"

    def made(self) -> xr.Dataset:
        """Return the exponents on the dimensions of the sweep."""
        many = self.runs.vibroimpact.runs.sizes["run"] - len(self.found)
        return _on_sweep(self.runs, [*self.found, *[self.left_out] * many], 2 * self._bodies.most_modes)

    def print_results(self) -> None:
        """Print the exponents of runs, and the number of runs without; DatasetError if no run has exponents."""
        if self.is_empty:
            raise DatasetError(self.why_none)
        _print(self.dataset)
        self.print_summary()

    def print_summary(self) -> None:
        """Print the number of runs with exponents, if they are many, and of those without, with the reasons."""
        known = [each for each in self.found if isinstance(each, Exponents)]
        if len(known) > _MOST_SHOWN:
            chaotic = sum(bool(each.per_impact[0] > 2.0 * each.standard_error[0]) for each in known)
            say(f"{len(known)} runs have exponents, of {chaotic} the largest is positive.")
        reasons = [
            str(text) for text in self.dataset.reason.values.ravel() if str(text) not in ("", "no run")
        ]
        for words, count in _counted(reasons):
            say(f"{count} without: {words}")


def lyapunov(dataset: xr.Dataset | str | PathLike[str]) -> xr.Dataset:
    """Return the Lyapunov exponents of each run of a dataset: equations.md 4.11.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder. The body is an oscillator, a chain, a beam or
        several bodies. 200 impacts must count, or two rounds of a periodic orbit. Without a force the exponent 0 of the
        motion along itself is left out.

    Returns
    -------
    xarray.Dataset
        On the dimensions of the sweep: `lyapunov_exponent` per impact and `standard_error` along `exponent`, the
        largest first. `impact_interval` (s) is the mean time between impacts; the exponent over it is the exponent per
        second. Also `dimension` (Kaplan-Yorke), `impacts` that counted, `sum_error`, and `reason`: why a run has no
        exponents, else empty.

    Raises
    ------
    DatasetError
        The dataset has no impacts, or no scene.
    UsageError
        The scene's orbits cannot be followed.

    Examples
    --------
    >>> lyapunov("run.nc").lyapunov_exponent      # doctest: +SKIP
    """
    return results_of(ExponentsOfRuns, dataset)


def _of_run(bodies: Bodies, impacts: ImpactsOf, runs: xr.Dataset, place: int) -> Exponents | str:
    outcome = Outcome(int(runs["outcome"].values[place]))
    body = bodies[place]
    if outcome is not Outcome.ok:
        return f"outcome {outcome.name}"
    if "stick_count" in runs and runs["stick_count"].values[place] > 0:
        return "sticking: what is held on a stop forgets all, and the sum rule ends"
    if "impacts_per_period" in runs and np.isinf(runs["impacts_per_period"].values[place]).any():
        return "chatter: impacts without number"
    try:
        return exponents_of(body, impacts[int(runs["run_id"].values[place])])
    except ExponentError as problem:
        return str(problem).removeprefix("lyapunov: ")


def _on_sweep(dataset: xr.Dataset, found: list[Exponents | str], most: int) -> xr.Dataset:
    runs = OnSweep(dataset)
    exponents, errors = np.full((len(found), most), np.nan), np.full((len(found), most), np.nan)
    single = np.full((len(found), 4), np.nan)
    for row, each in enumerate(found):
        if not isinstance(each, str):
            count = each.per_impact.size
            exponents[row, :count], errors[row, :count] = each.per_impact, each.standard_error
            single[row] = each.interval, each.dimension, each.impacts, each.sum_error
    interval, dimension, impacts, sum_error = np.moveaxis(runs.placed(single), -1, 0)
    values = {
        "lyapunov_exponent": runs.placed(exponents),
        "standard_error": runs.placed(errors),
        "impact_interval": interval,
        "dimension": dimension,
        "impacts": impacts,
        "sum_error": sum_error,
        "reason": runs.texts([each if isinstance(each, str) else "" for each in found]),
        "exponent": np.arange(1, most + 1),
    }
    attrs = runs_attributes(dataset.attrs)
    return TABLE.dataset(values, attrs, over=runs.dims, coords=runs.coords, units=units_of(dataset))


def _counted(reasons: Sequence[str]) -> list[tuple[str, int]]:
    """Return reasons with their numbers of runs, the commonest first; reasons that differ by numbers share a line."""
    kinds: dict[str, list[str]] = {}
    for text in reasons:
        kinds.setdefault(_NUMBER.sub("#", text), []).append(text)
    ordered = sorted(kinds.values(), key=len, reverse=True)
    return [(each[0] + (" (the first of them)" if len(set(each)) > 1 else ""), len(each)) for each in ordered]


def _print(found: xr.Dataset) -> None:
    flat = found.stack(run=found.reason.dims) if found.reason.dims else found.expand_dims("run")
    known = flat.isel(run=np.flatnonzero(np.isfinite(flat.impacts.values)))
    rows = table(
        f"Lyapunov exponents per impact: {found.attrs.get('title', '')}",
        *("<", ">largest", ">+-", ">others", ">per time", ">dimension", ">impacts"),
    )
    for place in range(min(known.sizes["run"], _MOST_SHOWN)):
        one = known.isel(run=place)
        values = one.lyapunov_exponent.values
        rows.add_row(
            _where(one, found),
            f"{values[0]:.6g}",
            f"{float(one.standard_error.values[0]):.1g}",
            ", ".join(f"{each:.6g}" for each in values[1:4] if np.isfinite(each)),
            f"{values[0] / float(one.impact_interval):.6g}",
            "" if np.isnan(one.dimension) else f"{float(one.dimension):.4g}",
            f"{int(one.impacts)}",
        )
    wide_terminal().print(rows)


def _where(one: xr.Dataset, found: xr.Dataset) -> str:
    texts = []
    for name in (str(dim) for dim in found.reason.dims if str(dim) in one.coords):
        value = one[name].item()
        texts.append(f"{name} {value:.6g}" if isinstance(value, float) else str(value))
    return ", ".join(texts)
