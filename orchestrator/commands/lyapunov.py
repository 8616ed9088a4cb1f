"""What `vibroimpact lyapunov` does: exponents of the runs of a scene or a dataset, printed, written and drawn."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import xarray as xr

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset import dataset_file
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.energies import runs_of
from vibroimpact.orchestrator.operations.lyapunov import Lyapunov
from vibroimpact.orchestrator.orbits.lyapunov import lyapunov

_NUMBER = re.compile(r"\d+")
_MOST_SHOWN = 30
"""Runs that are told one by one."""


def show_exponents(options: Lyapunov) -> None:
    """Find the exponents of the runs of a scene or a dataset; print, write and draw them."""
    path = options.file
    refuse_places(options, [dataset_file(path)], results_kind="lyapunov", scene_file=str(path))
    with runs_of(path, options.changes or ()) as dataset:
        try:
            found = lyapunov(dataset)
        except DatasetError as problem:
            raise problem.named(path) from problem
    reasons = [str(text) for text in found.reason.values.ravel() if str(text) != "no run"]
    counted = _counted([text for text in reasons if text])
    if all(reasons):
        told = "; ".join(f"{count} of {len(reasons)}: {words}" for words, count in counted)
        raise DatasetError(f"{path}: lyapunov: expected runs with exponents, got none. {told}")
    _print(found)
    for words, count in counted:
        say(f"{count} without: {words}")
    write_found(found.assign_attrs(scene_file=str(path)), "lyapunov", options)


def _counted(reasons: Sequence[str]) -> list[tuple[str, int]]:
    """Return reasons with how many runs have them, the commonest first; of those that differ by numbers, the first."""
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
    if known.sizes["run"] > _MOST_SHOWN:
        first = known.isel(exponent=0)
        chaotic = int((first.lyapunov_exponent > 2.0 * first.standard_error).sum())
        say(f"{known.sizes['run']} runs have exponents, of {chaotic} the largest is positive.")


def _where(one: xr.Dataset, found: xr.Dataset) -> str:
    told = []
    for name in (str(dim) for dim in found.reason.dims if str(dim) in one.coords):
        value = one[name].item()
        told.append(f"{name} {value:.6g}" if isinstance(value, float) else str(value))
    return ", ".join(told)
