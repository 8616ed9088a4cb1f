"""From files to modes: read, reduced, and kept by content."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from vibroimpact.orchestrator.structures.kept import kept_modes
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.readers import Sources, read_matrices
from vibroimpact.orchestrator.structures.reduction import reduce
from vibroimpact.orchestrator.structures.request import Request


def find_modes(request: Request) -> Modes:
    """Return the modes that a body by matrices asks for.

    Raises
    ------
    UsageError
        A file cannot be read, or the matrices are none of a structure: `expected ..., got ...`.
    """
    sources = Sources(
        stiffness=request.stiffness,
        mass=request.mass,
        damping=request.damping or "",
        file="" if request.file is None else str(request.file),
        freedoms="" if request.freedoms is None else str(request.freedoms),
        folder=request.folder,
    )
    files = sources.hashes()
    keys = replace(request, folder=Path())
    found = kept_modes(f"{sorted(files.items())} {keys}", lambda: _reduced(sources, request))
    return replace(found, files=files)


def _reduced(sources: Sources, request: Request) -> Modes:
    """Return the modes of the matrices of files."""
    points = dict(request.points) | {name: {name: 1.0} for name in request.named}
    return reduce(
        read_matrices(sources),
        points,
        modes=request.modes,
        tolerance=request.tolerance,
        residual=request.residual,
        base=request.base,
        damping_ratio=request.damping_ratio,
        rayleigh=request.rayleigh,
    )


def modes_of_file(path: Path) -> Modes:
    """Return the modes of a file.

    Raises
    ------
    UsageError
        The file cannot be read, or holds no modes: `expected ..., got ...`.
    """
    raise NotImplementedError
