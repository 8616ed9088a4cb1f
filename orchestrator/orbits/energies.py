"""The study `energies`: energies of the modes over the periodic orbit of each run of a dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from os import PathLike
from typing import Any, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import UnitSystem
from vibroimpact.analysis.orbits.energies import (
    OrbitEnergies,
    energy_transfer,
    orbit_energies,
    residual_restitution,
    velocity_transfer,
)
from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.analysis.orbits.recorded import recorded_orbit
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.orbits.runs import (
    Bodies,
    ImpactsOf,
    OnSweep,
    RunsStudy,
    place_of,
    results_of,
    runs_of,
    scene_of,
    units_of,
    why_without_orbit,
)
from vibroimpact.orchestrator.run.progress import Progress, shown_progress
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
"""Number of runs from which a progress bar is shown: they take seconds."""
_MOST_SHOWN = 4
"""Most modes for which the matrices of an impact are printed."""


@dataclass(eq=False)
class EnergiesOfRuns(RunsStudy[tuple[Found, float]]):
    """Energies of the modes: see `energies`. A row has the energies of a run, and its distance from its orbit."""

    name = "energies"
    nothing = "a run with energies"
    named = (DatasetError, UsageError)

    run: int | None = None
    progress: Progress | None = None

    @classmethod
    def prepare(cls, options: Any, stack: ExitStack) -> Self:
        """Open the runs."""
        runs = stack.enter_context(runs_of(options.file, options.changes or ()))
        return cls(runs, options.run, stack.enter_context(shown_progress()))

    def rows(self) -> Generator[tuple[Found, float], None, None]:
        """Find the energies of run after run."""
        scene, runs = scene_of(self.runs, "energies"), self.runs.vibroimpact.runs
        chosen = range(runs.sizes["run"]) if self.run is None else [place_of(runs, self.run, "energies")]
        self._many, impacts, self._bodies = len(chosen), ImpactsOf(self.runs), Bodies(scene, runs)
        seen = self.progress if self.progress is not None and self._many >= _MANY else Progress()
        seen.begin(self._many, 0)
        for place in chosen:
            yield _of_run(self._bodies, impacts, runs, place)
            seen.advance(1)

    def made(self) -> xr.Dataset:
        """Return the energies of one run, or of all runs on the dimensions of the sweep.

        DatasetError: a single run has no orbit.
        """
        attrs, units = runs_attributes(self.runs.attrs), units_of(self.runs)
        if self._many > 1:
            rest: list[tuple[Found, float]] = [(self.left_out, np.nan)] * (self._many - len(self.found))
            return _on_sweep(self.runs, self.found + rest, self._bodies.most_modes, attrs, units)
        only, distance = self.found[0]
        if isinstance(only, str):
            raise DatasetError(f"energies: expected a run with a periodic orbit, got none: {only}.")
        return _of_one(only, distance, attrs, units)

    def print_results(self) -> None:
        """Print the energies of a single orbit, or a summary of all."""
        (_print_one if "orbit" in self.dataset.attrs else _print_all)(self.dataset)


def energies(
    dataset: xr.Dataset | str | PathLike[str], run: int | None = None, *, progress: Progress | None = None
) -> xr.Dataset:
    """Return the energies of the modes over the orbit of each run: thesis 6.3, equations.md 5.3 to 5.6.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder. The body is an oscillator, a chain, a beam or
        several bodies on restitution stops, and impacts are recorded.
    run : int, optional
        `run_index` of a single run; its result also has each impact.
    progress : Progress, optional
        Shows the progress over many runs.

    Returns
    -------
    xarray.Dataset
        `residual_energy`, `forcing_work`, `damping_loss`, `impact_change`, `mean_kinetic_energy` (J) of each `mode`,
        on the dimensions of the sweep. Also `contact_energy`, `contact_loss`, `residual_restitution`, `impacts`,
        `periods`, `identity_error`, `transient`, and `reason`: why a run has no energies, else empty. A single run
        also has `energy_before`, `energy_after`, `energy_change` at each impact, and the matrices `velocity_transfer`,
        `energy_transfer` of each `contact`.

    Raises
    ------
    DatasetError
        The dataset has no impacts or no scene, no such run, or its only run has no orbit.
    UsageError
        The scene's orbits cannot be followed.

    Examples
    --------
    >>> energies("run.nc").residual_energy      # doctest: +SKIP
    """
    return results_of(EnergiesOfRuns, dataset, run, progress)


def _of_run(bodies: Bodies, impacts: ImpactsOf, runs: xr.Dataset, place: int) -> tuple[Found, float]:
    """Return the energies of a run, or why it has no energies, and the distance of its impacts from its orbit."""
    body = bodies[place]
    if reason := why_without_orbit(runs, place):
        return reason, np.nan
    try:
        near = recorded_orbit(body, impacts[int(runs["run_id"].values[place])])
        return orbit_energies(near.orbit), near.distance
    except (OrbitError, UsageError) as problem:
        return str(problem).removeprefix("orbit: ").removeprefix("energies: ").rstrip("."), np.nan


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
    attributes = {"orbit": orbit.name, "is_stable": int(orbit.is_stable)}
    return TABLE.dataset(values, attributes | dict(attrs), units=units)


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


def _print_one(found: xr.Dataset) -> None:
    stable = "stable" if found.attrs["is_stable"] else "unstable"
    unit = _unit(found)
    rows = table(
        f"Energies of the modes{unit}: {found.attrs.get('title', '')}, {found.attrs['orbit']}, {stable}",
        *(">mode", ">natural frequency", ">force gives", ">damping takes", ">residual", ">change at impacts"),
    )
    columns = ("forcing_work", "damping_loss", "residual_energy", "impact_change")
    for mode in found["mode"].values:
        own = found.sel(mode=mode)
        rows.add_row(
            f"{mode}", f"{own.natural_frequency:.6g}", *(f"{float(own[name]):.6g}" for name in columns)
        )
    rows.add_row("all", "", *(f"{float(found[name].sum()):.6g}" for name in columns))
    console = wide_terminal()
    console.print(rows)
    lost, met = float(found.contact_loss), float(found.contact_energy)
    say(
        f"Impacts meet {met:.6g} and lose {lost:.6g}; identity (6.32) closed to {float(found.identity_error):.1e}."
    )
    masses = ", ".join(f"{each:.6g}" for each in found["contact_mass"].values)
    say(f"Mass that an impact meets{', kg' if unit else ''}: {masses}.")
    restitution = residual_restitution(float(found.residual_energy.sum()), met)
    slope = f", {restitution.slope:.4g} per unit of residual energy" if np.isfinite(restitution.slope) else ""
    say(f"Restitution from the residual energy: {restitution.problem or f'{restitution.value:.9g}{slope}'}.")
    if float(found.transient) > 1e-9:
        say(f"Recorded impacts are {float(found.transient):.1e} from the orbit: a transient is not over.")
    if found.sizes["mode"] <= _MOST_SHOWN:
        _print_matrices(console, found)


def _print_matrices(console: Terminal, found: xr.Dataset) -> None:
    for stop in range(found.sizes["contact"]):
        where = f" of stop {stop + 1}" if found.sizes["contact"] > 1 else ""
        matrices = [found[name].values[stop] for name in ("velocity_transfer", "energy_transfer")]
        modes = [f">{mode}" for mode in found["mode"].values]
        shown = table(f"[R^] and [R*]{where}", ">mode", *modes, ">", *modes)
        for mode, *both in zip(found["mode"].values, *matrices, strict=True):
            cells = [[f"{value:.6f}" for value in row] for row in both]
            shown.add_row(f"{mode}", *cells[0], "", *cells[1])
        console.print(shown)


def _print_all(found: xr.Dataset) -> None:
    reasons = [str(text) for text in found.reason.values.ravel() if str(text) != "no run"]
    there = reasons.count("")
    say(f"{found.attrs.get('title', '')}: {there} of {len(reasons)} runs have energies of a periodic orbit.")
    if there:
        worst = float(np.nanmax(found.identity_error.values))
        away = float(np.nanmax(found.transient.values))
        say(f"Identity (6.32) closed to {worst:.1e}, recorded impacts {away:.1e} from their orbit, at worst.")
        rows = table(f"Residual energy of the modes over an orbit{_unit(found)}", *_HEADINGS)
        for mode in found["mode"].values:
            values = found.residual_energy.sel(mode=mode).values
            known = values[np.isfinite(values)]
            gives = 100.0 * float((known < 0.0).mean())
            rows.add_row(
                f"{mode}",
                *(f"{each:.6g}" for each in (known.min(), known.mean(), known.max())),
                f"{gives:.0f} %",
            )
        wide_terminal().print(rows)
    for words, count in Counter(text.split(":")[0] for text in reasons if text).most_common():
        say(f"{count} without: {words}.")


_HEADINGS = (">mode", ">least", ">mean", ">most", ">fed by impacts in")


def _unit(found: xr.Dataset) -> str:
    return "" if found.attrs.get("units_system") == "nondimensional" else ", J"
