"""The system that is exchanged: two oscillators with a spring between them, as the example has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.places import EXAMPLES

import vibroimpact as vi
from exchange._cases import Rows
from exchange._tools import TOOLS, Tool
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.ssp import export_system

STEP = 1.0 / 64.0
COUNT = 1000
NAMES = ("a.displacement", "b.displacement")
#: The tools exchange values as `jacobi` does.
CHANGES = (
    "execution.exchange=jacobi",
    f"execution.macro_step={STEP}",
    f"record.rate={1.0 / STEP}",
    f"record.recorded_time={COUNT * STEP}",
)
#: OMSimulator leaves transformations of connections out; through a component the others answer one step late.
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
    """Return the archive, and what its outputs are after each step: by our own run, or one step late."""
    scene = load_scene(EXAMPLES / "two_oscillators.toml", CHANGES)
    samples = vi.run(scene, progress=False).vibroimpact.samples()
    rows = np.column_stack([samples[name.replace(".", "_")].values for name in NAMES])[1:]
    system = export_system(scene, folder / "system.ssp", fmi=fmi, gains=gains)
    return system, one_step_late() if is_late(tool, gains) else rows


def is_late(tool: Tool, gains: str) -> bool:
    """Return whether a tool's springs answer one step late."""
    return gains == "component" and tool.name in LATE


def one_step_late() -> Rows:
    """Return what the outputs are where each spring answers one step late: from the exact flow of either mass.

    Between two exchanges each mass has the force that the other's displacement called for a step before the last.
    """
    rate = np.sqrt(1.1)
    c, s = np.cos(rate * STEP), np.sin(rate * STEP) / rate
    flow = np.array([[c, s], [-(rate**2) * s, c]])
    held = np.array([(1.0 - c) / rate**2, s])
    a, b = np.array([1.0, 0.0]), np.zeros(2)
    seen, rows = (1.0, 0.0), []
    forces = (0.0, 0.1)
    for _ in range(COUNT):
        a, b = flow @ a + held * forces[0], flow @ b + held * forces[1]
        forces = (0.1 * seen[1], 0.1 * seen[0])
        seen = (a[0], b[0])
        rows.append((a[0], b[0]))
    return np.array(rows)
