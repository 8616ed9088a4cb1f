"""Landmarks of the impact oscillator from a bifurcation campaign, next to their exact values.

Only counts, alternation and amplitudes of the recorded runs are used, as with measured data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from vibroimpact.analysis.dataset.backend import VibroimpactBackend  # noqa: F401  # for `ds.vibroimpact`
from vibroimpact.analysis.dataset.schema import Outcome
from vibroimpact.analysis.landmarks.exact import (
    ImpactOscillator,
    folds,
    grazing_frequencies,
    period_doublings,
)
from vibroimpact.fmus.errors import DatasetError

Floats = npt.NDArray[np.float64]

_FREQUENCY = "angular_frequency"
# Largest number of non-impacting points from which the amplitude is extrapolated.
_EXTRAPOLATED_POINTS = 12
# Relative difference of impact velocities below which they are equal to rounding, and do not alternate.
_SAME_VELOCITY = 1e-9


@dataclass(frozen=True, slots=True)
class Reading:
    """One landmark found in a dataset.

    Attributes
    ----------
    name : str
        Name of the landmark.
    value, exact : float
        Angular frequency from the dataset and in closed form (rad/s; 1 in nondimensional scenes).
    grid_step : float
        Distance of neighbouring points of the sweep at the reading, in the same unit.
    how : str
        Method of the reading.
    """

    name: str
    value: float
    exact: float
    grid_step: float
    how: str

    @property
    def steps(self) -> float:
        """Distance from the exact value in grid steps."""
        return abs(self.value - self.exact) / self.grid_step


def bifurcation_readings(dataset: xr.Dataset) -> list[Reading]:
    """Read the landmarks of an up-down frequency sweep of the impact oscillator.

    The lower graze is extrapolated from the amplitude of the non-impacting motion. The other landmarks lie in the
    middle between two neighbouring runs of different kind.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `open_dataset` gives it: dimensions direction and angular_frequency; the scene in `attrs["scene"]`.

    Returns
    -------
    list of Reading
        Lower graze, loss of P(1,1) by period doubling, upper graze, fold of P(1,1).

    Raises
    ------
    DatasetError
        If the sweep is of another kind or does not reach a landmark.
    """
    oscillator = ImpactOscillator.from_scene(_scene(dataset))
    # A failed run is no evidence: its frequency is left out, and the grid is coarser there.
    is_whole = (dataset["outcome"] == Outcome.ok).all("direction").values
    dataset = dataset.isel({_FREQUENCY: np.flatnonzero(is_whole)})
    w = np.asarray(dataset[_FREQUENCY].values, dtype=np.float64)
    grazes = grazing_frequencies(oscillator)
    if len(grazes) != 2:
        raise DatasetError(
            f"readings: expected an oscillator with two grazing frequencies, got {len(grazes)}."
        )
    lower, upper = grazes
    up, down = dataset.sel(direction="up"), dataset.sel(direction="down")
    doubling = [limit.angular_frequency for limit in period_doublings(oscillator, lower, upper)]
    fold = [limit.angular_frequency for limit in folds(oscillator, upper, 2 * upper)]
    if not doubling or not fold:
        raise DatasetError(
            "readings: expected a period doubling and a fold of P(1,1), got an oscillator without."
        )
    at_doubling = _doubling_bracket(down, w)
    begin = "upper graze: expected impacts to begin within the down sweep, got none or all"
    end = "fold: expected impacts to end within the up sweep, got none or no end"
    at_graze, at_fold = _last_impact(down, w, begin), _last_impact(up, w, end)
    return [
        _lower_graze(up, w, lower, oscillator.stop_position),
        _bracketed(
            "loss of P(1,1) by period doubling", at_doubling, doubling[-1], "down sweep, impacts per period"
        ),
        _bracketed("upper graze", at_graze, upper, "down sweep, first impacts"),
        _bracketed("fold of P(1,1)", at_fold, fold[0], "up sweep, last impacts"),
    ]


def _scene(dataset: xr.Dataset) -> str:
    """Return the scene text of an up-down frequency sweep; another dataset raises DatasetError."""
    needed = ("impact_count", "impact_velocity", "displacement_max", "impacts_per_period")
    missing = [name for name in needed if name not in dataset.variables]
    if missing:
        raise DatasetError(
            f"readings: expected impacts and extrema in the dataset, got no {', '.join(missing)}. "
            "Set impacts = true and extrema = true in [record]."
        )
    dims = dataset["impact_count"].dims
    directions = np.atleast_1d(dataset["direction"].values).tolist() if "direction" in dataset.coords else []
    if dims != ("direction", _FREQUENCY) or not {"up", "down"} <= set(directions):
        raise DatasetError(
            f"readings: expected an up-down sweep of {_FREQUENCY} alone, "
            f"got dimensions {', '.join(map(str, dims))} "
            f'with directions {", ".join(directions)}. Set path = "up-down" in [sweep].'
        )
    if "scene" not in dataset.attrs:
        raise DatasetError("readings: expected the scene text in the attribute scene, got none.")
    return str(dataset.attrs["scene"])


def _bracketed(name: str, bracket: tuple[float, float], exact: float, how: str) -> Reading:
    """Return a reading in the middle of two neighbouring runs of different kind."""
    below, above = bracket
    return Reading(
        name, (below + above) / 2, exact, above - below, f"{how}, between {below:.6g} and {above:.6g}"
    )


def _impacting(sweep: xr.Dataset) -> npt.NDArray[np.bool_]:
    """Return a mask of the runs of a sweep that hit the stop."""
    return np.asarray(sweep["impact_count"].values > 0)


def _last_impact(sweep: xr.Dataset, w: Floats, expected: str) -> tuple[float, float]:
    """Return the highest frequency with impacts and its upper neighbour; there must be such a neighbour."""
    hits = np.flatnonzero(_impacting(sweep))
    if hits.size == 0 or hits[-1] == w.size - 1:
        raise DatasetError(f"readings: {expected}.")
    return float(w[hits[-1]]), float(w[hits[-1] + 1])


def _doubling_bracket(down: xr.Dataset, w: Floats) -> tuple[float, float]:
    """Return the neighbours between which the longest row of P(1,1) runs ends on the way down."""
    is_single = np.array([_is_period_one(down.isel({_FREQUENCY: k})) for k in range(w.size)])
    edges = np.flatnonzero(np.diff(np.concatenate(([0], is_single.astype(np.int8), [0]))))
    firsts, ends = edges[::2], edges[1::2]
    if firsts.size == 0:
        raise DatasetError("readings: period doubling: expected P(1,1) motion in the down sweep, got none.")
    first = int(firsts[np.argmax(ends - firsts)])
    if first == 0:
        raise DatasetError(
            "readings: period doubling: expected P(1,1) to end within the down sweep, got no end."
        )
    return float(w[first - 1]), float(w[first])


def _is_period_one(run: xr.Dataset) -> bool:
    """Tell whether a run is P(1,1): one impact in each period, and no lasting alternation.

    Near the doubling the multiplier is close to -1, and a transient alternates for thousands of periods. So no
    tolerance applies to the difference of successive impact velocities: the difference must shrink.
    """
    if not (run["impacts_per_period"].values == 1).all():
        return False
    velocity = run.vibroimpact.impacts()["impact_velocity"].values
    jump = np.abs(np.diff(velocity))
    if jump.size < 2 or jump.max() <= _SAME_VELOCITY * velocity.max():
        return True
    half = jump.size // 2
    return bool(jump[-half:].mean() < jump[:half].mean())


def _lower_graze(up: xr.Dataset, w: Floats, exact: float, stop: float) -> Reading:
    """Extrapolate the amplitude of the non-impacting motion to the stop.

    For a linear oscillator the inverse square of the amplitude is a quadratic in the square of the frequency
    (thesis eqs. 2.27-2.31). So a parabola through the points before the first impact is exact beyond them.
    """
    hits = np.flatnonzero(_impacting(up))
    first = int(hits[0]) if hits.size else 0
    if first < 3:
        raise DatasetError(
            "readings: lower graze: expected at least 3 non-impacting runs at the start of the up sweep, "
            f"got {first}. Start the sweep at a lower frequency."
        )
    used = slice(max(0, first - _EXTRAPOLATED_POINTS), first)
    amplitude = up["displacement_max"].max("period").values[used]
    # Offsets from the last point, in steps: well-conditioned powers.
    step = w[first] - w[first - 1]
    offset = (w[used] ** 2 - w[first - 1] ** 2) / step
    clearance = np.polynomial.Polynomial.fit(offset, (stop / amplitude) ** 2 - 1, 2)
    roots = clearance.roots()
    squares = roots[np.isreal(roots)].real * step + w[first - 1] ** 2
    ahead = squares[squares > w[first - 1] ** 2]
    if ahead.size == 0:
        raise DatasetError(
            "readings: lower graze: expected an amplitude that grows toward the stop, got another."
        )
    how = f"up sweep, amplitude of the last {used.stop - used.start} runs without impact, extrapolated"
    return Reading("lower graze", float(np.sqrt(ahead.min())), exact, float(step), how)
