"""What `vibroimpact orbit` does: it finds periodic orbits and says what they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.beginning import begun, files_of, is_seed, refuse_contradictions
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.operations.orbit import FindOrbits
from vibroimpact.orchestrator.orbits.find import HISTORY, find_orbits
from vibroimpact.orchestrator.ssp import opened_scene


def show_orbits(options: FindOrbits) -> None:
    """Find orbits, print them, and write and draw them where that was asked for."""
    refuse_contradictions(options)
    changes, output, figure = options.changes or (), options.output, options.figure
    refuse_outputs([options.scene, *files_of(options)], output, figure)
    found = begun(options, opened_scene(options.scene, changes, for_orbits=True), changes)
    scene = found.scene
    refuse_overwriting(output, options.force, lambda there: there.get("history") == HISTORY)
    orbits = find_orbits(
        scene, found.impacts, found.periods, seed=found.seed, penetrating=options.penetrating
    )
    rows = table(
        f"Periodic orbits: {scene.title or scene.source}",
        *("<orbit", "<", "<phases, rad", "<stops", "<impact velocities"),
        *("<largest multipliers", ">determinant, off by", ">nearest maximum"),
    )
    for orbit in orbits:
        rows.add_row(*_told(orbit))
    if orbits:
        wide_terminal().print(rows)
    physical = [orbit for orbit in orbits if orbit.is_physical]
    say(
        f"{counted(len(physical), 'physical orbit')}."
        if physical
        else f"No physical orbit {_called(options)}."
    )
    _write(orbits, output)
    if figure is not None and orbits:
        from vibroimpact.analysis import figures  # half a second, which a table needs not

        with writing(figure):
            figures.save(figures.draw(orbits), figure)
        say(f"Figure written to {figure}.")


def _called(options: FindOrbits) -> str:
    """Return what the orbits that are looked for are called."""
    if is_seed(options):
        return "near to the seed"
    if options.impacts is None and options.periods is None:
        return "P(1,1), and none that a long run ends on"
    return f"P({options.impacts or 1},{options.periods or 1})"


def _write(orbits: FoundOrbits, output: Path | None) -> None:
    if output is None:
        return
    if not any(orbit.is_physical for orbit in orbits):
        say(f"{output} is not written: it would hold no orbit.")
        return
    write_dataset(orbits.dataset, output)
    say(f"Dataset written to {output}.")


def multiplier_text(value: complex) -> str:
    """Return a Floquet multiplier in words."""
    if not np.isfinite(value):
        return "unbounded"
    return f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g}{value.imag:+.6g}i"


def _told(orbit: PeriodicOrbit) -> tuple[str, ...]:
    off = orbit.determinant / orbit.exact_determinant - 1.0 if orbit.exact_determinant > 0.0 else np.nan
    return (
        orbit.name,
        "stable" if orbit.is_stable else "unstable",
        ", ".join(f"{phase:.10g}" for phase in orbit.phases),
        ", ".join(str(contact + 1) for contact in orbit.contacts),
        ", ".join(f"{speed:.10g}" for speed in orbit.velocities),
        ", ".join(multiplier_text(each) for each in orbit.multipliers[:2]),
        f"{orbit.exact_determinant:.6g}, {off:.0e}",
        _nearest(orbit),
    )


def _nearest(orbit: PeriodicOrbit) -> str:
    beyond, _, contact = orbit.highest
    if contact < 0:
        return "none"
    if orbit.is_physical:
        return f"{-beyond:.3g} below stop {contact + 1}"
    return f"penetrates stop {contact + 1} by {beyond:.3g}"
