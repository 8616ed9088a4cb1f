"""Energies of the modes of the runs of a dataset: the orbit next to the impacts of each run, what goes on there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.results import Row, described
from vibroimpact.analysis.orbits.body import Floats
from vibroimpact.analysis.orbits.energies import (
    OrbitEnergies,
    energy_transfer,
    orbit_energies,
    velocity_transfer,
)
from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.analysis.orbits.recorded import recorded_orbit
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.orbits.runs import Bodies, ImpactsOf, place_of, scene_of, why_without_orbit
from vibroimpact.orchestrator.run.progress import Progress

_OF_MODES: Mapping[str, tuple[str, str, Callable[[OrbitEnergies], Floats]]] = {
    "residual_energy": ("J", "work of the force less loss to damping", lambda e: e.residual),
    "forcing_work": ("J", "work of the force", lambda e: e.forcing.sum(axis=0)),
    "damping_loss": ("J", "loss to damping", lambda e: e.damping.sum(axis=0)),
    "impact_change": ("J", "change of energy at the impacts", lambda e: e.change.sum(axis=0)),
    "mean_kinetic_energy": ("J", "mean kinetic energy", lambda e: e.mean_kinetic),
    "natural_frequency": ("rad s-1", "natural angular frequency", lambda e: e.orbit.body.frequencies),
}
_OF_RUNS: Mapping[str, tuple[str, str, Callable[[OrbitEnergies], float]]] = {
    "impacts": ("1", "impacts in the orbit, p of P(p,q)", lambda e: e.orbit.phases.size),
    "periods": ("1", "forcing periods in the orbit, q of P(p,q)", lambda e: e.orbit.periods),
    "contact_energy": ("J", "energy that the impacts meet, half of contact mass times squared velocity",
                       lambda e: e.kinetic.sum()),
    "contact_loss": ("J", "energy lost at the impacts", lambda e: e.lost.sum()),
    "residual_restitution": ("1", "restitution that the residual energy says", lambda e: e.restitution.value),
    "identity_error": ("1", "residual energy less loss at the impacts, over the energy that they meet",
                       lambda e: e.identity_error),
}  # fmt: skip
_OF_IMPACTS: Mapping[str, tuple[str, str, Callable[[OrbitEnergies], Floats]]] = {
    "energy_before": ("J", "energy of the mode just before the impact", lambda e: e.before),
    "energy_after": ("J", "energy of the mode just after the impact", lambda e: e.after),
    "energy_change": ("J", "change of the energy of the mode at the impact", lambda e: e.change),
    "flight_forcing_work": ("J", "work of the force on the mode until the next impact", lambda e: e.forcing),
    "flight_damping_loss": ("J", "loss of the mode to damping until the next impact", lambda e: e.damping),
}
Found = OrbitEnergies | str
_MANY = 5000
"""Runs from which on it takes seconds."""


def energies(
    dataset: xr.Dataset | str | PathLike[str], run: int | None = None, *, progress: Progress | None = None
) -> xr.Dataset:
    """Return the energies of the modes over the orbit of each run: thesis 6.3, equations.md 5.3 to 5.6.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder: of an oscillator, a chain or a beam on restitution
        stops, with impacts.
    run : int, optional
        `run_index` of one run alone, of which each impact is told too.
    progress : Progress, optional
        Told how far it is, where there are many runs.

    Returns
    -------
    xarray.Dataset
        `residual_energy`, `forcing_work`, `damping_loss`, `impact_change`, `mean_kinetic_energy` (J) of each `mode`,
        on the dimensions of the sweep; `contact_energy`, `contact_loss`, `residual_restitution`, `impacts`, `periods`,
        `identity_error`, `transient`; `reason`: why a run has none, else empty. Of one run also `energy_before`,
        `energy_after`, `energy_change` at each impact, and the matrices `velocity_transfer`, `energy_transfer` of
        each `contact`.

    Raises
    ------
    DatasetError
        It has no impacts or no scene, no such run, or its only run has no orbit.
    UsageError
        The scene is none whose orbits are followed.

    Examples
    --------
    >>> energies("run.nc").residual_energy      # doctest: +SKIP
    """
    if not isinstance(dataset, xr.Dataset):
        with open_dataset(dataset) as opened:
            return energies(opened, run, progress=progress)
    scene = scene_of(dataset, "energies")
    runs = dataset.vibroimpact.runs
    chosen = range(runs.sizes["run"]) if run is None else [place_of(runs, run, "energies")]
    impacts = ImpactsOf(dataset)
    bodies = Bodies(scene, runs)
    seen = progress if progress is not None and len(chosen) >= _MANY else Progress()
    seen.begin(len(chosen), 0)
    found = []
    for place in chosen:
        found.append(_of_run(bodies, impacts, runs, place))
        seen.advance(1)
    plain = dataset.attrs.get("units_system") == "nondimensional"
    kept = {name: dataset.attrs[name] for name in ("title", "scene", "units_system") if name in dataset.attrs}
    if len(found) == 1:
        only = found[0][0]
        if isinstance(only, str):
            raise DatasetError(f"energies: expected a run with a periodic orbit, got none: {only}.")
        made = _of_one(only, found[0][1], plain)
    else:
        made = _on_sweep(dataset, found, bodies.most_modes, plain)
    return made.assign_attrs(kept)


def _of_run(bodies: Bodies, impacts: ImpactsOf, runs: xr.Dataset, place: int) -> tuple[Found, float]:
    """Return the energies of a run, or why it has none, and how far its impacts are from its orbit."""
    body = bodies[place]
    if reason := why_without_orbit(runs, place):
        return reason, np.nan
    try:
        near = recorded_orbit(body, impacts[int(runs["run_id"].values[place])])
        return orbit_energies(near.orbit), near.distance
    except (OrbitError, UsageError) as problem:
        return str(problem).removeprefix("orbit: "), np.nan


def _units(rows: Mapping[str, Row], plain: bool) -> dict[str, Any]:
    """Return variables with their attributes; of a nondimensional scene they have no unit."""
    return described({name: (dims, values, "1" if plain else unit, words)
                      for name, (dims, values, unit, words) in rows.items()})  # fmt: skip


def _mode_words(words: str) -> str:
    return f"{words} of the mode, over the orbit" if "natural" not in words else f"{words} of the mode"


_TRANSIENT = "largest difference of a recorded velocity from that of the orbit, over the largest"


def _of_one(found: OrbitEnergies, distance: float, plain: bool) -> xr.Dataset:
    orbit, body = found.orbit, found.orbit.body
    rows: dict[str, Row] = {
        name: ("mode", of(found), unit, _mode_words(words)) for name, (unit, words, of) in _OF_MODES.items()
    }
    rows |= {name: ((), of(found), unit, words) for name, (unit, words, of) in _OF_RUNS.items()}
    rows |= {
        name: (("impact", "mode"), of(found), unit, words) for name, (unit, words, of) in _OF_IMPACTS.items()
    }
    matrices = (("velocity_transfer", velocity_transfer), ("energy_transfer", energy_transfer))
    for name, of in matrices:
        words = (
            "matrix of the modal velocities at an impact"
            if of is velocity_transfer
            else "matrix of the kinetic energy"
        )
        values = np.array([of(contact) for contact in body.contacts])
        rows[name] = (("contact", "mode", "other_mode"), values, "1", words)
    masses = np.array([contact.mass for contact in body.contacts])
    rows["contact_mass"] = ("contact", masses, "kg", "mass that an impact meets, of all modes that are kept")
    rows["impact_phase"] = (
        "impact",
        orbit.phases,
        "rad",
        "forcing phase at impact, from that of the first period on",
    )
    rows["impact_velocity"] = ("impact", orbit.velocities, "m s-1", "velocity of approach just before impact")
    rows["impact_contact"] = ("impact", orbit.contacts + 1, "1", "number of the stop that was hit, from 1")
    rows["transient"] = ((), distance, "1", _TRANSIENT)
    made = xr.Dataset(_units(rows, plain), _modes(body.frequencies.size))
    return made.assign_attrs(orbit=orbit.name, is_stable=int(orbit.is_stable))


def _modes(count: int) -> dict[str, Any]:
    number = np.arange(1, count + 1)
    return described({"mode": ("mode", number, "1", "number of the mode, the slowest first")})


def _on_sweep(dataset: xr.Dataset, found: list[tuple[Found, float]], most: int, plain: bool) -> xr.Dataset:
    """Return the energies of all runs on the dimensions of the dataset."""
    run_id = dataset["run_id"].values
    place = dict(zip(dataset.vibroimpact.runs["run_id"].values.tolist(), range(len(found)), strict=True))
    index = np.array([place.get(int(number), -1) for number in run_id.ravel()]).reshape(run_id.shape)
    dims = tuple(map(str, dataset["run_id"].dims))

    def placed(values: Floats) -> Floats:
        return np.asarray(np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[index])

    rows: dict[str, Row] = {}
    for name, (unit, words, of) in _OF_MODES.items():
        values = np.full((len(found), most), np.nan)
        for row, (each, _) in enumerate(found):
            if not isinstance(each, str):
                numbers = of(each)
                values[row, : numbers.size] = numbers
        rows[name] = ((*dims, "mode"), placed(values), unit, _mode_words(words))
    for name, (unit, words, one) in _OF_RUNS.items():
        numbers = np.array([np.nan if isinstance(each, str) else one(each) for each, _ in found])
        rows[name] = (dims, placed(numbers), unit, words)
    rows["transient"] = (dims, placed(np.array([distance for _, distance in found])), "1", _TRANSIENT)
    reasons = np.array(
        [*(each if isinstance(each, str) else "" for each, _ in found), "no run"], dtype=object
    )
    rows["reason"] = (dims, reasons[index], "1", "why a run has no orbit, else empty")
    coords = {
        name: one.variable for name, one in dataset.coords.items() if set(one.dims) <= set(dims) and one.dims
    }
    if taken := sorted({*rows, "mode"} & {*map(str, coords), *dims}):
        raise DatasetError(
            f"energies: {taken[0]}: expected a swept key or dimension of another name. Rename it."
        )
    for one in coords.values():
        one.attrs.setdefault("units", "1")
        one.attrs.setdefault("long_name", "swept")
    return xr.Dataset(_units(rows, plain), _modes(most) | coords)
