"""What `vibroimpact energies` does: energies of the modes over orbits, printed, written and drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset import dataset_file, open_dataset
from vibroimpact.analysis.dataset.outputs import DATASET_ENDING
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.orbits.energies import residual_restitution
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.commands.preparing import with_modes
from vibroimpact.orchestrator.operations.energies import Energies
from vibroimpact.orchestrator.orbits import impacting_body
from vibroimpact.orchestrator.orbits.energies import energies
from vibroimpact.orchestrator.run.progress import shown_progress
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.ssp import opened_scene

_MOST_SHOWN = 4
"""Modes up to which the matrices of an impact are printed."""


def show_energies(options: Energies) -> None:
    """Find the energies of the modes of a scene or a dataset; print, write and draw them."""
    path = options.file
    refuse_places(options, [dataset_file(path)], results_kind="energies", scene_file=str(path))
    with runs_of(path, options.changes or ()) as dataset, shown_progress() as progress:
        try:
            found = energies(dataset, options.run, progress=progress)
        except (DatasetError, UsageError) as problem:
            raise problem.named(path) from problem
    found = found.assign_attrs(scene_file=str(path))
    if "orbit" in found.attrs:
        _print_one(found)
    else:
        _print_all(found)
    write_found(found, "energies", options)


@contextmanager
def runs_of(path: Path, changes: Sequence[str]) -> Iterator[xr.Dataset]:
    """Open the runs of a dataset; those of a scene are run first.

    Raises
    ------
    UsageError
        The scene is none whose orbits are followed, or a dataset is to be changed.
    """
    if path.is_dir() or path.suffix.lower() == DATASET_ENDING:
        if changes:
            raise UsageError(
                f"{path}: --set: expected a scene, which can be changed, got a dataset. Leave it out."
            )
        with open_dataset(path) as dataset:
            yield dataset
        return
    scene = with_modes(opened_scene(path, changes))
    impacting_body(scene)  # refused before it runs
    with ScratchFolder("energies") as folder:
        file = Path(folder.name, "run.nc")
        with shown_progress() as progress:
            run_scene(scene, file, progress=progress)
        with open_dataset(file) as dataset:
            yield dataset


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
    said = residual_restitution(float(found.residual_energy.sum()), met)
    slope = f", {said.slope:.4g} per unit of residual energy" if np.isfinite(said.slope) else ""
    say(f"Restitution from the residual energy: {said.problem or f'{said.value:.9g}{slope}'}.")
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
    say(f"{found.attrs.get('title', '')}: {there} of {len(reasons)} runs have a periodic orbit.")
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
