"""The system that is exchanged: two oscillators with a spring between them, as the example has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.places import EXAMPLES

import vibroimpact as vi
from exchange._cases import Rows
from exchange._tools import TOOLS
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
#: OMSimulator leaves transformations of connections out.
GAINS = {"libcosim": "transformation", "Ecos": "transformation", "OMSimulator": "component"}
PAIRS = [
    (tool, fmi, GAINS[tool.name])
    for tool in TOOLS
    if tool.name in GAINS
    for fmi in tool.versions
    # with FMI 3.0 OMSimulator finds an algebraic loop at the start, which is none, and no solution of it
    if (tool.name, fmi) != ("OMSimulator", "3.0")
]


def made(folder: Path, fmi: str, gains: str) -> tuple[Path, Rows]:
    """Return the archive, and what its outputs are after each step by our own run."""
    scene = load_scene(EXAMPLES / "two_oscillators.toml", CHANGES)
    samples = vi.run(scene, progress=False).vibroimpact.samples()
    rows = np.column_stack([samples[name.replace(".", "_")].values for name in NAMES])[1:]
    return export_system(scene, folder / "system.ssp", fmi=fmi, gains=gains), rows
