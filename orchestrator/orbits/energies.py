"""Energies of the modes of the runs of a dataset: the orbit next to the impacts of each run, what goes on there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import UnitSystem
from vibroimpact.analysis.orbits.energies import (
    OrbitEnergies,
    energy_transfer,
    orbit_energies,
    velocity_transfer,
)
from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.analysis.orbits.recorded import recorded_orbit
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.orbits.runs import (
    Bodies,
    ImpactsOf,
    OnSweep,
    place_of,
    scene_of,
    units_of,
    why_without_orbit,
)
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.run.provenance import runs_attributes

TABLE = ResultTable(
    "energies",
    ("mode", "mode", "1", "number of the mode, the slowest first"),
    (
        "residual_energy",
        "... mode",
        "J",
        "work of the force less loss to damping of the mode, over the orbit",
    ),
    ("forcing_work", "... mode", "J", "work of the force of the mode, over the orbit"),
    ("damping_loss", "... mode", "J", "loss to damping of the mode, over the orbit"),
    ("impact_change", "... mode", "J", "change of energy at the impacts of the mode, over the orbit"),
    ("mean_kinetic_energy", "... mode", "J", "mean kinetic energy of the mode, over the orbit"),
    ("natural_frequency", "... mode", "rad s-1", "natural angular frequency of the mode"),
    ("impacts", "...", "1", "impacts in the orbit, p of P(p,q)"),
    ("periods", "...", "1", "forcing periods in the orbit, q of P(p,q)"),
    (
        "contact_energy",
        "...",
        "J",
        "energy that the impacts meet, half of contact mass times squared velocity",
    ),
    ("contact_loss", "...", "J", "energy lost at the impacts"),
    ("residual_restitution", "...", "1", "restitution that the residual energy says"),
    (
        "identity_error",
        "...",
        "1",
        "residual energy less loss at the impacts, over the energy that they meet",
    ),
    ("energy_before", "impact mode", "J", "energy of the mode just before the impact"),
    ("energy_after", "impact mode", "J", "energy of the mode just after the impact"),
    ("energy_change", "impact mode", "J", "change of the energy of the mode at the impact"),
    ("flight_forcing_work", "impact mode", "J", "work of the force on the mode until the next impact"),
    ("flight_damping_loss", "impact mode", "J", "loss of the mode to damping until the next impact"),
    ("velocity_transfer", "contact mode other_mode", "1", "matrix of the modal velocities at an impact"),
    ("energy_transfer", "contact mode other_mode", "1", "matrix of the kinetic energy"),
    ("contact_mass", "contact", "kg", "mass that an impact meets, of all modes that are kept"),
    ("impact_phase", "impact", "rad", "forcing phase at impact, from that of the first period on"),
    ("impact_velocity", "impact", "m s-1", "velocity of approach just before impact"),
    ("impact_contact", "impact", "1", "number of the stop that was hit, from 1"),
    (
        "transient",
        "...",
        "1",
        "largest difference of a recorded velocity from that of the orbit, over the largest",
    ),
    ("reason", "...", "1", "why a run has no orbit, else empty", "text"),
)
_OF_MODES: Mapping[str, Callable[[OrbitEnergies], Floats]] = {
    "residual_energy": lambda e: e.residual,
    "forcing_work": lambda e: e.forcing.sum(axis=0),
    "damping_loss": lambda e: e.damping.sum(axis=0),
    "impact_change": lambda e: e.change.sum(axis=0),
    "mean_kinetic_energy": lambda e: e.mean_kinetic,
    "natural_frequency": lambda e: e.orbit.body.frequencies,
}
_OF_RUNS: Mapping[str, Callable[[OrbitEnergies], float]] = {
    "impacts": lambda e: e.orbit.phases.size,
    "periods": lambda e: e.orbit.periods,
    "contact_energy": lambda e: e.kinetic.sum(),
    "contact_loss": lambda e: e.lost.sum(),
    "residual_restitution": lambda e: e.restitution.value,
    "identity_error": lambda e: e.identity_error,
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
    attrs, units = runs_attributes(dataset.attrs), units_of(dataset)
    if len(found) > 1:
        return _on_sweep(dataset, found, bodies.most_modes, attrs, units)
    only, distance = found[0]
    if isinstance(only, str):
        raise DatasetError(f"energies: expected a run with a periodic orbit, got none: {only}.")
    return _of_one(only, distance, attrs, units)


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


def _of_one(found: OrbitEnergies, distance: float, attrs: Mapping[str, Any], units: UnitSystem) -> xr.Dataset:
    orbit, contacts = found.orbit, found.orbit.body.contacts
    values: dict[str, Any] = {
        "mode": np.arange(1, orbit.body.frequencies.size + 1),
        **{name: of(found) for name, of in _OF_MODES.items()},
        **{name: of(found) for name, of in _OF_RUNS.items()},
        "energy_before": found.before,
        "energy_after": found.after,
        "energy_change": found.change,
        "flight_forcing_work": found.forcing,
        "flight_damping_loss": found.damping,
        "velocity_transfer": [velocity_transfer(contact) for contact in contacts],
        "energy_transfer": [energy_transfer(contact) for contact in contacts],
        "contact_mass": [contact.mass for contact in contacts],
        "impact_phase": orbit.phases,
        "impact_velocity": orbit.velocities,
        "impact_contact": orbit.contacts + 1,
        "transient": distance,
    }
    said = {"orbit": orbit.name, "is_stable": int(orbit.is_stable)}
    return TABLE.dataset(values, said | dict(attrs), units=units)


def _on_sweep(
    dataset: xr.Dataset,
    found: list[tuple[Found, float]],
    most: int,
    attrs: Mapping[str, Any],
    units: UnitSystem,
) -> xr.Dataset:
    """Return the energies of all runs on the dimensions of the dataset."""
    runs = OnSweep(dataset)
    values: dict[str, Any] = {"mode": np.arange(1, most + 1)}
    for name, of in _OF_MODES.items():
        table = np.full((len(found), most), np.nan)
        for row, (each, _) in enumerate(found):
            if not isinstance(each, str):
                numbers = of(each)
                table[row, : numbers.size] = numbers
        values[name] = runs.placed(table)
    for name, one in _OF_RUNS.items():
        numbers = np.array([np.nan if isinstance(each, str) else one(each) for each, _ in found])
        values[name] = runs.placed(numbers)
    values["transient"] = runs.placed(np.array([distance for _, distance in found]))
    values["reason"] = runs.texts([each if isinstance(each, str) else "" for each, _ in found])
    if taken := sorted(set(values) & {*runs.coords, *runs.dims}):
        raise DatasetError(
            f"energies: {taken[0]}: expected a swept key or dimension of another name. Rename it."
        )
    return TABLE.dataset(values, attrs, over=runs.dims, coords=runs.coords, units=units)
