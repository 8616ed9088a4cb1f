"""The study `resonances`: peaks of a response over the forcing frequency, and the shifted natural frequencies."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import NamedTuple

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.derived import largest_impact_velocity
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.orbits.energies import OrbitEnergies
from vibroimpact.analysis.orbits.recorded import NO_IMPACTS
from vibroimpact.analysis.orbits.resonances import Peak, frequency_shift, peaks_of
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.energies import EnergiesOfRuns
from vibroimpact.orchestrator.orbits.runs import RunsStudy, results_of, scene_of, units_of
from vibroimpact.orchestrator.run.provenance import runs_attributes
from vibroimpact.orchestrator.scene import Scene

TABLE = ResultTable(
    "resonances",
    ("quantity", "peak", "1", "what has the peak", "text"),
    ("peak_branch", "peak", "1", "index of its branch"),
    ("peak_frequency", "peak", "rad s-1", "angular frequency of the peak"),
    ("peak_height", "peak", "1", "height of the peak, in the unit of its quantity"),
    ("grid_step", "peak", "rad s-1", "distance of the neighbours of the peak"),
    ("motion", "peak", "1", "P(p,q) at the peak, or why there is no period", "text"),
    ("stop_ratio", "peak", "1", "stop over deepest excursion on the other side, from the equilibrium"),
    ("shifted_frequency", "peak mode", "rad s-1", "natural angular frequency, shifted by the stop"),
    ("natural_frequency", "mode", "rad s-1", "natural angular frequency"),
    ("displacement_range", "branch forcing", "m", "displacement range of the run"),
    ("impact_velocity", "branch forcing", "m s-1", "impact velocity of the run"),
    ("mean_kinetic_energy_#", "branch forcing", "J", "mean kinetic energy # of the run"),
    ("branch", "branch", "1", "direction of the sweep", "text"),
    ("forcing", "forcing", "rad s-1", "angular frequency of the force"),
    ("mode", "mode", "1", "number of the mode, the slowest first"),
)
_KEYS = {"forcing.angular_frequency": 1.0, "forcing.frequency": 2.0 * np.pi}
_AGREEMENT = 1e-9


class _Found(NamedTuple):
    """A peak with its quantity and branch."""

    quantity: str
    branch: int
    peak: Peak


@dataclass(eq=False)
class PeaksOfSweep(RunsStudy[tuple[OrbitEnergies | str, float]]):
    """Peaks of the response of a body over the forcing frequency; a row is the energies of a run."""

    name = "resonances"
    nothing = "a run with energies"
    named = (DatasetError, UsageError)

    def rows(self) -> Generator[tuple[OrbitEnergies | str, float], None, None]:
        """Find the energies of run after run."""
        self._scene = scene_of(self.runs, "resonances")
        self._name, self._factor = _swept(self.runs, self._scene)
        self._energies = EnergiesOfRuns(self.runs)
        for row in self._energies.rows():
            self._energies.take(row)
            yield row

    def made(self) -> xr.Dataset:
        """Return the peaks; DatasetError without any."""
        self._energies.incomplete = self.incomplete
        exchanged, body, name = self._energies.dataset, impacting_body(self._scene), self._name
        order = [name] if "direction" not in self.runs["outcome"].dims else ["direction", name]
        directions = np.atleast_1d(self.runs["direction"].values) if "direction" in order else [""]
        branches = [str(each) for each in directions]
        frequency = self._factor * self.runs[name].values.astype(np.float64)
        curves = dict(_curves(self.runs, exchanged, order, frequency, body))
        found = _peaks(curves, frequency)
        deepest = _deepest(self.runs, body, order, frequency.size)
        shape = (len(branches), frequency.size)
        motion = _motions(exchanged, order).reshape(shape)
        ratio = np.array([deepest[each.branch, each.peak.place] for each in found])
        peaks = [each.peak for each in found]
        values = {
            "quantity": [each.quantity for each in found],
            "peak_branch": [each.branch for each in found],
            "peak_frequency": [each.frequency for each in peaks],
            "peak_height": [each.height for each in peaks],
            "grid_step": [each.step for each in peaks],
            "motion": [str(motion[each.branch, each.peak.place]) for each in found],
            "stop_ratio": ratio,
            "shifted_frequency": _shifted(ratio, body),
            "natural_frequency": body.frequencies,
            **curves,
            "branch": branches,
            "forcing": frequency,
            "mode": np.arange(1, body.frequencies.size + 1),
        }
        return TABLE.dataset(values, runs_attributes(self.runs.attrs), units=units_of(self.runs))

    def print_results(self) -> None:
        """Print a row for each peak, and the natural frequencies."""
        found = self.dataset
        unit = "" if found.attrs.get("units_system") == "nondimensional" else ", rad/s"
        headings = "<of", "<branch", f">at{unit}", ">height", "<motion", ">stop ratio"
        near = ">nearest natural", ">nearest shifted"
        title = f"Peaks: {found.attrs.get('title', '')}"
        wide_terminal().print(table(title, *headings, *near, rows=_cells(found)))
        natural = ", ".join(f"{each:.6g}" for each in found["natural_frequency"].values)
        say(
            f"Natural frequencies{unit}: {natural}. A shift is that of one elastic, undamped, unforced mode: a guess."
        )


def resonances(dataset: xr.Dataset | str | PathLike[str]) -> xr.Dataset:
    """Return the peaks of the response of a body over the forcing frequency, for the whole body and each mode.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder. Only `forcing.angular_frequency` or
        `forcing.frequency` is swept. The body is an oscillator, a chain, a beam or several bodies on restitution
        stops, and impacts and extrema are recorded.

    Returns
    -------
    xarray.Dataset
        Along `peak`: `quantity` (displacement_range, impact_velocity, mean_kinetic_energy of a mode), `branch`,
        `peak_frequency`, `peak_height`, `grid_step`, `motion` (P(p,q), or why it has no period). Also `stop_ratio`:
        position of the first stop over the deepest excursion on the other side. `shifted_frequency` of each `mode` at
        that ratio is thesis (2.35): right for one mode, elastic, undamped and unforced, else a guess. The curves with
        the peaks are given along `branch` and the frequency. Frequencies are angular ones, rad/s.

    Raises
    ------
    DatasetError
        The sweep is another one, or no quantity with peaks was recorded.
    UsageError
        The scene's orbits cannot be followed.

    Examples
    --------
    >>> resonances("campaign").peak_frequency     # doctest: +SKIP
    """
    return results_of(PeaksOfSweep, dataset)


def _peaks(curves: Mapping[str, Floats], frequency: Floats) -> list[_Found]:
    """Return the peaks of curves, each of shape (branch, frequency); DatasetError without any."""
    found = [
        _Found(quantity, branch, peak)
        for quantity, branches in curves.items()
        for branch, values in enumerate(branches)
        for peak in peaks_of(frequency, values)
    ]
    if not found:
        raise DatasetError("resonances: expected a response with a peak inside of the sweep, got none.")
    return found


def _shifted(ratio: Floats, body: ImpactingBody) -> Floats:
    """Return the natural frequencies shifted by a stop, shape (peak, mode)."""
    shifted = np.full((ratio.size, body.frequencies.size), np.nan)
    known = (ratio > -1.0) & (ratio <= 1.0 + _AGREEMENT)
    shifted[known] = frequency_shift(ratio[known])[:, None] * body.frequencies
    return shifted


def _swept(dataset: xr.Dataset, scene: Scene) -> tuple[str, float]:
    """Return the dimension of the frequency, and the factor to an angular frequency."""
    keys = [axis.key for axis in scene.sweep]
    dims = [str(dim) for dim in dataset["outcome"].dims if dim != "direction"]
    if len(keys) != 1 or keys[0] not in _KEYS or len(dims) != 1 or dims[0] == "run":
        raise DatasetError(
            "resonances: expected a sweep of forcing.angular_frequency or forcing.frequency alone, "
            f"got {', '.join(keys) or 'none'}."
        )
    return dims[0], _KEYS[keys[0]]


def _curves(
    dataset: xr.Dataset, exchanged: xr.Dataset, order: list[str], frequency: Floats, body: ImpactingBody
) -> Iterator[tuple[str, Floats]]:
    count = frequency.size
    if "displacement_range" in dataset:
        yield "displacement_range", dataset["displacement_range"].transpose(*order).values.reshape(-1, count)
    yield "impact_velocity", largest_impact_velocity(dataset).transpose(*order).values.reshape(-1, count)
    kinetic = exchanged["mean_kinetic_energy"].transpose("mode", *order).values
    steady = np.abs(body.steady(frequency))
    is_free = (exchanged["reason"].transpose(*order).values == NO_IMPACTS).reshape(-1, count)
    for mode, values in enumerate(kinetic):
        # NaN where an undamped mode resonates
        speed = np.where(np.isfinite(steady[:, mode]), frequency * steady[:, mode], np.nan)
        yield f"mean_kinetic_energy_{mode + 1}", np.where(is_free, 0.25 * speed**2, values.reshape(-1, count))


def _deepest(dataset: xr.Dataset, body: ImpactingBody, order: list[str], count: int) -> Floats:
    """Return position of the first stop over the deepest excursion on the other side; NaN if extrema are missing."""
    contact = body.contacts[0]
    side = "displacement_min" if contact.direction > 0.0 else "displacement_max"
    nothing = np.full((dataset["outcome"].size // count, count), np.nan)
    size = float(np.abs(contact.shape).max())
    if side not in dataset or np.abs(contact.shape - body.observed).max() > _AGREEMENT * size:
        return nothing
    rest = contact.direction * float(contact.shape @ body.levels)
    extreme = dataset[side] if "period" not in dataset[side].dims else dataset[side].min("period")
    if contact.direction < 0.0 and "period" in dataset[side].dims:
        extreme = dataset[side].max("period")
    depth = rest - contact.direction * extreme.transpose(*order).values.reshape(-1, count)
    place = contact.direction * contact.position - rest
    return np.where(depth > 0.0, place / np.where(depth > 0.0, depth, 1.0), nothing)


def _motions(exchanged: xr.Dataset, order: list[str]) -> np.ndarray[tuple[int, ...], np.dtype[np.object_]]:
    impacts, periods = (exchanged[name].transpose(*order).values for name in ("impacts", "periods"))
    reasons = exchanged["reason"].transpose(*order).values
    texts = [
        f"P({p:.0f},{q:.0f})" if np.isfinite(p) else str(reason).split(":")[0]
        for p, q, reason in zip(impacts.ravel(), periods.ravel(), reasons.ravel(), strict=True)
    ]
    return np.array(texts, dtype=object)


def _cells(found: xr.Dataset) -> Iterator[tuple[str, ...]]:
    for place in range(found.sizes["peak"]):
        own = found.isel(peak=place)
        at = float(own.peak_frequency)
        ratio = f"{float(own.stop_ratio):.4f}" if np.isfinite(own.stop_ratio) else "-"
        quantity = str(own.quantity.item()).replace("_", " ")
        branch = str(found["branch"].values[int(own.peak_branch)])
        numbers = f"{at:.5g}", f"{float(own.peak_height):.5g}"
        near = [_nearest(at, own[name].values) for name in ("natural_frequency", "shifted_frequency")]
        yield quantity, branch, *numbers, str(own.motion.item()), ratio, *near


def _nearest(at: float, frequencies: Floats) -> str:
    """Return the mode whose frequency is nearest to a peak, and the relative distance of the peak."""
    if not np.isfinite(frequencies).all():
        return "-"
    mode = int(np.argmin(np.abs(np.log(frequencies / at))))
    return f"{mode + 1}: {frequencies[mode]:.5g} ({100.0 * (at / frequencies[mode] - 1.0):+.1f} %)"
