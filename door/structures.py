"""Structures of one's own: their modes, from matrices, from files of modes, and from scenes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import xarray as xr

from vibroimpact.given import PathLike, SceneLike, given_output, given_path, given_scene
from vibroimpact.orchestrator.study.structure_modes import (
    Choices,
    dataset_of,
    modes_of,
    refuse_ending,
    write_modes,
)


def modes(
    file: SceneLike,
    path: PathLike | None = None,
    *,
    stiffness: str | None = None,
    mass: str | None = None,
    damping: str | None = None,
    freedoms: PathLike | None = None,
    points: Mapping[str, str | Mapping[str, float]] | None = None,
    modes: int | Literal["auto"] | None = None,
    tolerance: float | None = None,
    residual: bool = True,
    base: str | None = None,
    damping_ratio: float | None = None,
    rayleigh: Mapping[str, float] | None = None,
    body: str | None = None,
) -> xr.Dataset:
    """Return the modes of a structure: of its matrices, of a file of modes, or of a body of a scene.

    Parameters
    ----------
    file : path, Scene or mapping
        File of matrices (.mtx, .npz, .mat, .sti, .op4, .pch) or of modes (.toml, .csv, .nc, .uff); or a scene, its
        file or its tables. All choices but `body` belong to matrices.
    path : path, optional
        File to write as well, which a body with `kind = "modes"` reads: .toml, .csv, .nc or .uff. Named points alone
        are written, to .nc all.
    stiffness : str, optional
        Name of the stiffness matrix in the file.
    mass, damping : str, optional
        File of the matrix, or its name in the first file.
    freedoms : path, optional
        Table of the degrees of freedom, with the places of their nodes.
    points : mapping, optional
        By name a degree of freedom such as `"12.z"`, or weights of several. Residual vectors stand for the modes that
        are left out at these points. By default all degrees of freedom have shapes (1024 at most), and none a vector.
    modes : int or "auto", optional
        Number of modes, 1 to 64, residual vectors among them (20), or the fewest that meet the tolerance.
    tolerance : float, optional
        Largest relative error of the flexibility at the points for `"auto"` (1e-3).
    residual : bool
        Whether residual vectors of the points are among the modes.
    base : str, optional
        Direction of a base that moves, such as `"z"`: gives the participation of each mode.
    damping_ratio : float, optional
        Damping ratio of all modes (0).
    rayleigh : mapping of str to float, optional
        `{"mass": a, "stiffness": b}` adds the damping a M + b K: a in 1/s, b in s.
    body : str, optional
        Name of the body of a scene that has several.

    Returns
    -------
    xarray.Dataset
        Along `mode`: `frequency` (Hz), `damping_ratio`, `is_residual`, and for a base `participation` and
        `effective_mass`. Along `point`: `shape`, `point_mass` (1 / shape^2), `flexibility` with residual vectors and
        `flexibility_without`, and the places `x`, `y`, `z` where they are known. Along `axis`: `total_mass` and
        `centre_of_mass`. `attrs["error"]` is the relative error of the flexibility by the reduction, and
        `attrs["remarks"]` says what was changed on the way.

    Raises
    ------
    UsageError
        A file cannot be read or written, a choice does not fit it, or the matrices are those of no structure.
    SceneError
        The scene is wrong; the message lists all problems, one a line.

    Examples
    --------
    >>> found = modes("examples/bracket/bracket.sti.gz", points={"tip": "42.z"}, modes=6)    # doctest: +SKIP
    >>> found.frequency.values[:2].round(1)                                                  # doctest: +SKIP
    array([ 949.8, 4427.7])
    """
    choices = Choices(
        stiffness=stiffness,
        mass=mass,
        damping=damping,
        freedoms=None if freedoms is None else given_path(freedoms),
        points=points,
        modes=modes,
        tolerance=tolerance,
        residual=None if residual else False,
        base=base,
        damping_ratio=damping_ratio,
        rayleigh=rayleigh,
    )
    studied = given_path(file) if isinstance(file, str | os.PathLike) else given_scene(file)
    target = None
    if path is not None:
        target = given_output(
            path, [each for each in (file, mass, damping, freedoms) if isinstance(each, str | Path)]
        )
        refuse_ending(target)
    found = modes_of(studied, choices, body=body, figure=True)
    if target is not None:
        write_modes(target, found, named=points)
    return dataset_of(found, str(studied) if isinstance(studied, Path) else studied.title)
