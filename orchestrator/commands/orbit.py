"""What `vibroimpact orbit` does: it finds periodic orbits and says what they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.orbits.find import find_orbits
from vibroimpact.orchestrator.ssp import opened_scene


def show_orbits(
    path: Path, impacts: int | None, periods: int | None, changes: Sequence[str], figure: Path | None
) -> None:
    """Find orbits, print them, and draw them where that was asked for."""
    refuse_outputs([path], None, figure)
    scene = opened_scene(path, changes)
    orbits = find_orbits(scene, impacts, periods)
    rows = table(
        f"Periodic orbits: {scene.title or scene.source}",
        *("<orbit", "<", "<phases, rad", "<stops", "<impact velocities"),
        *("<largest multipliers", ">determinant, off by", ">nearest maximum"),
    )
    for orbit in orbits:
        rows.add_row(*_told(orbit))
    if orbits:
        wide_terminal().print(rows)
    kind = (
        f"P({impacts or 1},{periods or 1})"
        if impacts is not None or periods is not None
        else "P(1,1), and none that a long run ends on"
    )
    say(f"{counted(len(orbits), 'physical orbit')}." if orbits else f"No physical orbit {kind}.")
    if figure is not None and orbits:
        from vibroimpact.analysis import figures  # half a second, which a table needs not
        from vibroimpact.analysis.figures.orbits import draw_orbits

        with writing(figure):
            figures.save(draw_orbits(orbits, scene.units), figure)
        say(f"Figure written to {figure}.")


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
        "none" if orbit.highest[2] < 0 else f"{-orbit.highest[0]:.3g} below stop {orbit.highest[2] + 1}",
    )
