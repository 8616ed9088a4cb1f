"""From files to modes: read, reduced, and kept by content."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import islice
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.kept import kept_modes
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files import read_modes
from vibroimpact.orchestrator.structures.readers import Sources, read_matrices
from vibroimpact.orchestrator.structures.reduction import reduce
from vibroimpact.orchestrator.structures.request import Request

MOST_MODES, MOST_POINTS = 64, 1024
"""Largest numbers of modes and of points of a body."""
MOST_NUMBERS = 4096
"""Largest number of numbers in the shapes of a scene's text, some 90 kB; of more, it has the points that it names."""


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
    matrices = read_matrices(sources)
    return reduce(
        matrices,
        points,
        modes=request.modes,
        tolerance=request.tolerance,
        driven=request.driven,
        residual=request.residual,
        base=request.base,
        damping_ratio=request.damping_ratio,
        rayleigh=request.rayleigh,
        shown=[name for name in matrices.spread(request.shown) if name not in points],
    )


def modes_of_file(path: Path, named: Collection[str] = ()) -> Modes:
    """Return the modes of a file that fit into a scene.

    Parameters
    ----------
    path : Path
    named : collection of str
        Points that the scene names.

    Returns
    -------
    Modes
        The lowest 64; see `fitting` for the points.

    Raises
    ------
    UsageError
        The file cannot be read, or holds no modes: `path: expected ..., got ...`.
    """
    found = read_modes(path)
    return fitting(found if len(found.natural) <= MOST_MODES else _lowest(found, path), named)


def fitting(modes: Modes, named: Collection[str]) -> Modes:
    """Return modes whose shapes fit into the text of a scene: those of its named points where all would be too many.

    The first two points stay, too. The first is observed where a scene names none. The second keeps it from being the
    only point, which a scene need not name.
    """
    if len(modes.shapes) <= min(MOST_POINTS, MOST_NUMBERS // len(modes.natural)):
        return modes
    names = {*islice(modes.shapes, 2), *named}
    kept = {name: shape for name, shape in modes.shapes.items() if name in names}
    remark = f"{len(modes.shapes) - len(kept)} points that the scene does not name are left out."
    return replace(modes, shapes=kept, remarks=(*modes.remarks, remark))


def _lowest(found: Modes, path: Path) -> Modes:
    """Return the lowest modes of a file."""
    if found.residual_vectors:
        raise UsageError(f"{path}: expected at most {MOST_MODES} modes beside residual vectors, got more.")
    kept = slice(MOST_MODES)
    remark = f"{len(found.natural) - MOST_MODES} modes above the lowest {MOST_MODES} are left out."
    return replace(
        found,
        natural=found.natural[kept],
        damping_ratios=found.damping_ratios[kept],
        damping=None if found.damping is None else found.damping[kept, kept],
        shapes={name: shape[kept] for name, shape in found.shapes.items()},
        participation=None if found.participation is None else found.participation[kept],
        remarks=(*found.remarks, remark),
    )
