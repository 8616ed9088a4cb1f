"""The exchanged system: two oscillators with a spring between them, as in the example."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from support.places import EXAMPLES

import vibroimpact as vi
from exchange._cases import Rows
from exchange._tools import TOOLS, Tool
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.scene.keys import dataset_name
from vibroimpact.orchestrator.ssp import export_system

STEP = 1.0 / 64.0
COUNT = 1000
#: All outputs of a body without stops.
OUTPUTS = ("displacement", "velocity", "acceleration", "energy.kinetic", "energy.potential")
NAMES = tuple(f"{body}.{output}" for body in "ab" for output in OUTPUTS)
#: Stiffness of each mass's own springs, and of the spring between the masses, N/m; the masses are 1 kg.
STIFFNESS, BETWEEN = 1.1, 0.1
#: Changes to the scene: our run exchanges values as the tools do (`jacobi`).
CHANGES = (
    "execution.exchange=jacobi",
    f"execution.macro_step={STEP}",
    f"record.rate={1.0 / STEP}",
    f"record.recorded_time={COUNT * STEP}",
    f"record.variables={json.dumps(NAMES)}",
)
#: OMSimulator ignores transformations of connections; through a component, the other tools answer one step late.
GAINS = {
    "libcosim": ("component", "transformation"),
    "Ecos": ("component", "transformation"),
    "OMSimulator": ("component",),
}
LATE = ("libcosim", "Ecos")
PAIRS = [
    (tool, fmi, gains)
    for tool in TOOLS
    if tool.name in GAINS
    for fmi in tool.versions
    for gains in GAINS[tool.name]
]


def made(folder: Path, tool: Tool, fmi: str, gains: str) -> tuple[Path, Rows]:
    """Return the archive, and the outputs after each step of our own run, or of a run with springs one step late."""
    scene = load_scene(EXAMPLES / "two_oscillators.toml", CHANGES)
    samples = vi.run(scene, progress=False).vibroimpact.samples()
    rows = np.column_stack([samples[dataset_name(name)].values for name in NAMES])[1:]
    system = export_system(scene, folder / "system.ssp", fmi=fmi, gains=gains)
    if is_late(tool, gains):
        return system, one_step_late(exchanges_first=tool.exchanges_first)
    return system, after_exchange(rows) if tool.exchanges_first else rows


def after_exchange(rows: Rows) -> Rows:
    """Return the rows of a tool that exchanges forces before it writes a row: accelerations follow the new forces."""
    rows, starts = rows.copy(), {"a": 1.0, "b": 0.0}
    for body, other in ("ab", "ba"):
        moved = np.diff(rows[:, NAMES.index(f"{other}.displacement")], prepend=starts[other])
        rows[:, NAMES.index(f"{body}.acceleration")] += BETWEEN * moved
    return rows


def is_late(tool: Tool, gains: str) -> bool:
    """Return whether a tool's springs answer one step late."""
    return gains == "component" and tool.name in LATE


def one_step_late(*, exchanges_first: bool) -> Rows:
    """Return the outputs with springs that answer one step late, from the exact flow of each mass.

    Between two exchanges each mass feels the force for the other mass's displacement one step before the last exchange.
    """
    rate = np.sqrt(STIFFNESS)
    c, s = np.cos(rate * STEP), np.sin(rate * STEP) / rate
    flow = np.array([[c, s], [-(rate**2) * s, c]])
    held = np.array([(1.0 - c) / rate**2, s])
    a, b = np.array([1.0, 0.0]), np.zeros(2)
    seen, rows = (1.0, 0.0), []
    forces = (0.0, BETWEEN)
    for _ in range(COUNT):
        a, b = flow @ a + held * forces[0], flow @ b + held * forces[1]
        held_forces, forces = forces, (BETWEEN * seen[1], BETWEEN * seen[0])
        seen = (a[0], b[0])
        shown = forces if exchanges_first else held_forces
        rows.append((*_outputs(a, shown[0]), *_outputs(b, shown[1])))
    return np.array(rows)


def _outputs(state: Rows, force: float) -> tuple[float, ...]:
    """Return the outputs of a mass from its displacement and velocity, and the force on it."""
    displacement, velocity = map(float, state)
    acceleration = force - STIFFNESS * displacement
    return displacement, velocity, acceleration, velocity**2 / 2, STIFFNESS * displacement**2 / 2
