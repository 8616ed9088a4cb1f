"""The kinds of figures: the choice for given data, and the checks of options."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import FAMILIES, Family, load_families
from vibroimpact.analysis.figures.measured.replay import recordings_of
from vibroimpact.analysis.figures.window import View
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import Argument, message


class Result(Protocol):
    """A result of `vi` whose dataset is drawn: estimates, spikes, orbits, classes."""

    @property
    def dataset(self) -> Any:
        """Dataset, or a method that returns it."""


Data = xr.Dataset | Recording | Result
# Number of values above which a message names only the first and the last one.
_MOST_LISTED = 6

load_families()
KINDS = tuple(dict.fromkeys(kind for family in FAMILIES.values() for kind in family.drawings))
"""Names of the kinds of figures."""


def draw_view(data: Data, kind: str, view: View) -> Figure:
    """Draw data as a kind of figure, or refuse it in one line that names the kinds that fit.

    DatasetError: the kind does not fit the data, or there is no such run or recording. UsageError: the kind is unknown,
    or takes no such option.
    """
    if kind != "auto" and kind not in KINDS:
        raise UsageError(f"figure: kind: expected one of auto, {', '.join(KINDS)}, got {kind!r}.")
    data = _dataset_of(data)
    family = _family(data)
    chosen = family.usual_kind(data, view) if kind == "auto" else kind
    drawing = family.drawings.get(chosen)
    if drawing is None:
        fits = ", ".join(family.fitting(data))
        raise DatasetError(f"figure: kind: expected one that fits {family.words} ({fits}), got {chosen!r}.")
    _refuse_options(data, family, chosen, view)
    if family.name == "runs":
        _refuse_run(data, family, chosen, view.run)
    try:
        return drawing.draw(data, view)
    except DatasetError as problem:
        if drawing.fits(data):
            raise
        fit = f" Kinds that fit: {', '.join(family.fitting(data)) or 'none'}."
        raise DatasetError(message(problem.message, fit)) from problem


def fitting(data: Data) -> list[str]:
    """Return the kinds that fit data."""
    data = _dataset_of(data)
    return _family(data).fitting(data)


def _dataset_of(data: Any) -> Any:
    """Return the dataset of a result; objects of a family are drawn themselves."""
    whole = (type, xr.Dataset, *filter(None, (family.type for family in FAMILIES.values())))
    if isinstance(data, whole) or not hasattr(data, "dataset"):
        return data
    found = data.dataset
    return found() if callable(found) else found


def _family(data: Any) -> Family:
    """Return the family of data, which decides the available kinds."""
    for family in FAMILIES.values():
        if family.type is not None and isinstance(data, family.type):
            return family
    if not isinstance(data, xr.Dataset):
        raise UsageError(
            f"figure: expected a dataset, a recording or a result, got {type(data).__name__}. "
            "open_dataset, open_measured and open_recording open files."
        )
    written = str(data.attrs.get("results_kind", ""))
    results = {name: family for name, family in FAMILIES.items() if family.is_of_results}
    if written in results:
        return results[written]
    if written:
        raise DatasetError(
            f"results: expected a kind that can be drawn ({', '.join(results)}), got {written!r}."
        )
    if "run_index" in data.variables:
        return FAMILIES["runs"]
    if not {"macro_step", "wall_time"} & set(data.variables):
        raise DatasetError(
            "figure: expected runs (run_index) or a result (attribute results_kind), got a dataset with neither."
        )
    return FAMILIES["ladder"]


def _refuse_options(data: Any, family: Family, kind: str, view: View) -> None:
    """Raise UsageError for options that a kind does not take: no option is silently ignored."""
    for name, is_given in (
        ("run", view.run is not None),
        ("recording", view.recording is not None),
        ("window", view.window.given),
        ("over", view.over is not None),
        ("segment", view.segment is not None),
        ("variable", view.variable is not None),
    ):
        if not is_given or name in family.drawings[kind].takes:
            continue
        takers = [taker for taker, one in family.drawings.items() if name in one.takes]
        advice = f"It goes with {', '.join(takers)}." if takers else "Leave it out."
        if name == "run" and family.name == "replay":
            advice = message("Name a recording (", Argument("recording"), f"): {recordings_of(data)}.")
        raise UsageError(
            message(f"figure: {name}: expected none for {family.words} drawn as {kind}, got one. ", advice)
        )


def _refuse_run(dataset: Any, family: Family, kind: str, run: int | None) -> None:
    """Refuse a run that does not exist, and a missing choice where one of several runs must be named."""
    drawing = family.drawings[kind]
    if run is None and "window" not in drawing.takes:
        return  # all runs, which a large map does not read
    there = np.unique(dataset["run_index"].values)
    there = there[there >= 0]
    if there.size <= _MOST_LISTED:
        listed = ", ".join(str(number) for number in there) or "none"
    else:
        listed = f"{there[0]} to {there[-1]}" + (
            "" if np.ptp(there) + 1 == there.size else ", not all of them"
        )
    if run is not None and run not in there:
        raise DatasetError(
            f"figure: run: expected one run of those there are ({listed}), got none of run_index {run}."
        )
    # a window of time needs a single run
    if "window" in drawing.takes and run is None and there.size > 1:
        if not drawing.fits(dataset):
            fits = ", ".join(family.fitting(dataset))
            raise DatasetError(f"figure: kind: expected one that fits this dataset ({fits}), got {kind!r}.")
        raise DatasetError(
            message(
                f"figure: run: expected one run, got {there.size}. Name one by its run_index (",
                *(Argument("run"), f"): {listed}."),
            )
        )
