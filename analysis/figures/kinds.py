"""The kinds of figures: what each draws, of which data, and which options it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.measured.estimates import draw_estimates
from vibroimpact.analysis.figures.measured.intervals import draw_intervals
from vibroimpact.analysis.figures.measured.recordings import draw_recording
from vibroimpact.analysis.figures.measured.replay import draw_replay, recordings_of
from vibroimpact.analysis.figures.measured.spectra import (
    draw_recording_spectrum,
    draw_replay_spectrum,
    draw_run_spectrum,
)
from vibroimpact.analysis.figures.motion.modal import draw_energies, draw_shapes
from vibroimpact.analysis.figures.motion.portraits import draw_impact_map, draw_portrait, draw_return_map
from vibroimpact.analysis.figures.motion.runs import draw_run
from vibroimpact.analysis.figures.motion.series import sampled_variables
from vibroimpact.analysis.figures.motion.strobe import draw_strobe
from vibroimpact.analysis.figures.orbits.basins import draw_basins
from vibroimpact.analysis.figures.orbits.branches import BRANCH, draw_branches
from vibroimpact.analysis.figures.orbits.control import draw_control
from vibroimpact.analysis.figures.orbits.lyapunov import draw_lyapunov
from vibroimpact.analysis.figures.orbits.maps import draw_maps
from vibroimpact.analysis.figures.orbits.orbit_energies import draw_orbit_energies
from vibroimpact.analysis.figures.orbits.resonances import draw_resonances
from vibroimpact.analysis.figures.study.accuracy import draw_accuracy
from vibroimpact.analysis.figures.study.effects import draw_effects
from vibroimpact.analysis.figures.study.hard_cases import draw_hard_cases
from vibroimpact.analysis.figures.study.ladder import convergence, work_precision
from vibroimpact.analysis.figures.study.scores import draw_scores
from vibroimpact.analysis.figures.study.sensitivity import draw_sensitivity
from vibroimpact.analysis.figures.sweep.classes import KIND as CLASS_KIND
from vibroimpact.analysis.figures.sweep.classes import draw_classes
from vibroimpact.analysis.figures.sweep.diagrams import (
    draw_bifurcation,
    draw_impacts_per_period,
    draw_map,
    varied,
    wrong_sweep,
)
from vibroimpact.analysis.figures.sweep.impact_frequency import draw_impact_frequency
from vibroimpact.analysis.figures.sweep.measured_sweep import draw_measured_sweep
from vibroimpact.analysis.figures.window import View
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import Argument, message

Data = xr.Dataset | Recording
Family = Literal[
    "runs",
    "recording",
    "replay",
    "estimates",
    "spikes",
    "accuracy",
    "effects",
    "sensitivity",
    "hard_cases",
    "energies",
    "resonances",
    "lyapunov",
    "control",
    "basins",
    "maps",
    "ladder",
]
_WORDS: dict[Family, str] = {
    "runs": "a dataset of runs",
    "recording": "a recording",
    "replay": "a replay",
    "estimates": "estimates",
    "spikes": "spikes",
    "accuracy": "a study of accuracy",
    "effects": "a study of effects",
    "sensitivity": "a study of sensitivity",
    "hard_cases": "hard cases",
    "energies": "energies of orbits",
    "resonances": "resonances",
    "lyapunov": "Lyapunov exponents",
    "control": "an orbit that was kept",
    "basins": "basins of attraction",
    "maps": "a map",
    "ladder": "what a benchmark measured",
}
# More values than this are told by their ends.
_MOST_LISTED = 6


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A kind of figure.

    Attributes
    ----------
    families : dict
        For each family of data that it draws, the function that does, or raises a DatasetError where the data does not
        hold what the figure shows.
    fits : callable
        Whether a dataset of runs holds what the figure shows.
    takes : tuple of str
        Options: `run`, `recording`, `window`, `over`, `segment`, `variable`.
    """

    families: dict[Family, Callable[[Any, View], Figure]]
    fits: Callable[[Any], bool] = lambda dataset: True
    takes: tuple[str, ...] = ()


def _swept(dataset: xr.Dataset, count: int, *names: str) -> bool:
    return len(varied(dataset)) == count and any(name in dataset.variables for name in names)


def _has_pair(dataset: xr.Dataset) -> bool:
    names = sampled_variables(dataset)
    return any("displacement" in n and n.replace("displacement", "velocity") in names for n in names)


def _has_phases(dataset: xr.Dataset) -> bool:
    return "impact_phase" in dataset and bool(np.isfinite(dataset["impact_phase"].values).any())


def _draw_sweep(dataset: xr.Dataset, view: View) -> Figure:
    if view.over is None and "measurement_flags" not in dataset:
        return draw_bifurcation(dataset, view.variable)
    if view.variable is not None:
        raise UsageError(
            "figure: variable: expected none for a measured sweep, which has its displacement range, got one."
        )
    return draw_measured_sweep(dataset, view.over)


_SINGLE = ("run", "window")
KINDS: dict[str, FigureKind] = {
    "bifurcation": FigureKind(
        {"runs": _draw_sweep},
        lambda data: _swept(data, 1, "displacement_range", "impact_velocity"),
        ("over", "variable"),
    ),
    "branches": FigureKind(
        {"runs": lambda data, view: draw_branches(data, view.over, view.variable)},
        lambda data: BRANCH in data,
        ("over", "variable"),
    ),
    "classes": FigureKind({"runs": lambda data, view: draw_classes(data)}, lambda data: CLASS_KIND in data),
    "map": FigureKind(
        {"runs": lambda data, view: draw_map(data)},
        lambda data: _swept(data, 2, "displacement_range", "impact_velocity"),
    ),
    "impacts-per-period": FigureKind(
        {"runs": lambda data, view: draw_impacts_per_period(data)},
        lambda data: _swept(data, 2, "impacts_per_period"),
    ),
    "impact-frequency": FigureKind(
        {"runs": lambda data, view: draw_impact_frequency(data)},
        lambda data: _swept(data, 1, "impact_time") and data.sizes.get("impact", 0) > 1,
    ),
    "strobe": FigureKind({"runs": draw_strobe}, lambda data: "strobe_displacement" in data, ("run",)),
    "run": FigureKind(
        {"runs": draw_run},
        lambda data: bool(sampled_variables(data)) or "displacement_max" in data or "impact_velocity" in data,
        _SINGLE,
    ),
    "portrait": FigureKind({"runs": draw_portrait}, _has_pair, _SINGLE),
    "impact-map": FigureKind({"runs": draw_impact_map}, _has_phases, _SINGLE),
    "return-map": FigureKind(
        {"runs": draw_return_map}, lambda data: data.sizes.get("impact", 0) > 1, _SINGLE
    ),
    "spectrum": FigureKind(
        {
            "runs": draw_run_spectrum,
            "recording": draw_recording_spectrum,
            "replay": draw_replay_spectrum,
        },
        lambda data: bool(sampled_variables(data)),
        (*_SINGLE, "recording"),
    ),
    "density": FigureKind(
        {
            "runs": partial(draw_run_spectrum, density=True),
            "recording": partial(draw_recording_spectrum, density=True),
            "replay": partial(draw_replay_spectrum, density=True),
        },
        lambda data: bool(sampled_variables(data)),
        (*_SINGLE, "recording", "segment"),
    ),
    "energies": FigureKind(
        {"runs": draw_energies, "energies": lambda data, view: draw_orbit_energies(data)},
        lambda data: "modal_energy_1" in data and {"energy_kinetic", "energy_potential"} <= set(data),
        _SINGLE,
    ),
    "shapes": FigureKind(
        {"runs": lambda data, view: draw_shapes(data)},
        lambda data: "location" in varied(data) and "displacement_start_1" in varied(data),
    ),
    "scores": FigureKind(
        {"runs": lambda data, view: draw_scores(data)},
        lambda data: "variance_accounted_for" in data and bool(varied(data)),
    ),
    "recording": FigureKind(
        {"recording": lambda data, view: draw_recording(data, view.window)}, takes=("window",)
    ),
    "replay": FigureKind(
        {"replay": lambda data, view: draw_replay(data, view.recording, view.window)},
        takes=("recording", "window"),
    ),
    "estimates": FigureKind({"estimates": lambda data, view: draw_estimates(data)}),
    "intervals": FigureKind({"spikes": lambda data, view: draw_intervals(data)}),
    "accuracy": FigureKind({"accuracy": lambda data, view: draw_accuracy(data)}),
    "effects": FigureKind({"effects": lambda data, view: draw_effects(data)}),
    "sensitivity": FigureKind({"sensitivity": lambda data, view: draw_sensitivity(data)}),
    "hard-cases": FigureKind({"hard_cases": lambda data, view: draw_hard_cases(data)}),
    "resonances": FigureKind({"resonances": lambda data, view: draw_resonances(data)}),
    "lyapunov": FigureKind({"lyapunov": lambda data, view: draw_lyapunov(data)}),
    "control": FigureKind({"control": lambda data, view: draw_control(data, view.over)}, takes=("over",)),
    "basins": FigureKind({"basins": lambda data, view: draw_basins(data)}),
    "maps": FigureKind({"maps": lambda data, view: draw_maps(data)}),
    "convergence": FigureKind({"ladder": lambda data, view: convergence(data)}),
    "work-precision": FigureKind({"ladder": lambda data, view: work_precision(data)}),
}


def draw_view(data: Data, kind: str, view: View) -> Figure:
    """Draw data as a kind of figure, or refuse it in one line that says what fits.

    Raises
    ------
    DatasetError
        The kind does not fit the data, or there is no such run or recording.
    UsageError
        The kind is unknown, or takes no such option.
    """
    if kind != "auto" and kind not in KINDS:
        raise UsageError(f"figure: kind: expected one of auto, {', '.join(KINDS)}, got {kind!r}.")
    family = _family(data)
    chosen = _usual(data, family, view) if kind == "auto" else kind
    drawer = KINDS[chosen].families.get(family)
    if drawer is None:
        raise DatasetError(
            f"figure: kind: expected one that fits {_WORDS[family]} ({', '.join(fitting(data))}), got {chosen!r}."
        )
    _refuse_options(data, chosen, family, view)
    if family == "runs":
        _refuse_run(data, chosen, view.run)
    try:
        return drawer(data, view)
    except DatasetError as problem:
        if family != "runs" or KINDS[chosen].fits(data):
            raise
        fit = f" Kinds that fit: {', '.join(fitting(data)) or 'none'}."
        raise DatasetError(message(problem.message, fit)) from problem


def fitting(data: Data) -> list[str]:
    """Return the kinds that fit data."""
    family = _family(data)
    return [
        name
        for name, kind in KINDS.items()
        if family in kind.families and (family != "runs" or kind.fits(data))
    ]


def _family(data: Data) -> Family:
    """Return what data is: it decides which kinds there are."""
    if isinstance(data, Recording):
        return "recording"
    if not isinstance(data, xr.Dataset):
        raise UsageError(
            f"figure: expected a dataset or a recording, got {type(data).__name__}. "
            "open_dataset, open_measured and open_recording open files."
        )
    results: dict[str, Family] = {
        "replay": "replay",
        "estimates": "estimates",
        "spikes": "spikes",
        "accuracy": "accuracy",
        "effects": "effects",
        "sensitivity": "sensitivity",
        "hard_cases": "hard_cases",
        "energies": "energies",
        "resonances": "resonances",
        "lyapunov": "lyapunov",
        "control": "control",
        "basins": "basins",
        "maps": "maps",
    }
    written = str(data.attrs.get("results_kind", ""))
    if written in results:
        return results[written]
    if written:
        raise DatasetError(
            f"results: expected a kind that can be drawn ({', '.join(results)}), got {written!r}."
        )
    return "runs" if "run_index" in data.variables else "ladder"


def _usual(data: Any, family: Family, view: View) -> str:
    """Return the kind that says most of data."""
    if family != "runs":
        return {"spikes": "intervals", "ladder": "convergence", "hard_cases": "hard-cases"}.get(
            family, family
        )
    for column, kind in ((BRANCH, "branches"), (CLASS_KIND, "classes")):
        if column in data and view.run is None:
            return kind
    swept = varied(data)
    if view.run is not None or not swept:
        return "run"
    if "variance_accounted_for" in data:
        return "scores"
    if len(swept) > 2:
        raise DatasetError(wrong_sweep("one or two swept parameters", data))
    return "bifurcation" if len(swept) == 1 else "map"


def _refuse_options(data: Any, kind: str, family: Family, view: View) -> None:
    """Refuse options that a kind does not take: what is asked for is never left out."""
    for name, is_given, is_foreign in (
        ("run", view.run is not None, family != "runs"),
        ("recording", view.recording is not None, family != "replay"),
        ("window", view.window.given, False),
        ("over", view.over is not None, family not in ("runs", "control")),
        ("segment", view.segment is not None, False),
        ("variable", view.variable is not None, family != "runs"),
    ):
        if not is_given or (name in KINDS[kind].takes and not is_foreign):
            continue
        takers = [taker for taker, one in KINDS.items() if name in one.takes and family in one.families]
        advice = "Leave it out."
        if name == "run" and family == "replay":
            advice = message("Name a recording (", Argument("recording"), f"): {recordings_of(data)}.")
        elif takers and not is_foreign:
            advice = f"It goes with {', '.join(takers)}."
        raise UsageError(
            message(f"figure: {name}: expected none for {_WORDS[family]} drawn as {kind}, got one. ", advice)
        )


def _refuse_run(dataset: Any, kind: str, run: int | None) -> None:
    """Refuse a run that is not there, and no run where one of several must be named."""
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
    # a window of time is one of a single run
    if "window" in KINDS[kind].takes and run is None and there.size > 1:
        if not KINDS[kind].fits(dataset):
            raise DatasetError(
                f"figure: kind: expected one that fits this dataset ({', '.join(fitting(dataset))}), got {kind!r}."
            )
        raise DatasetError(
            message(
                f"figure: run: expected one run, got {there.size}. Name one by its run_index (",
                *(Argument("run"), f"): {listed}."),
            )
        )
