"""Operation `modes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, FigureFile, Force, Operation, Option, Positional, operation
from vibroimpact.orchestrator.operations.arguments import Changes


@operation("orchestrator.commands.modes:show_modes", Door("modes"))
class ShowModes(Operation):
    """Print the modes of a structure: of its matrices, of a file of modes, or of a body of a scene.

    Printed are frequencies, damping ratios, effective masses, and the total mass with its centre. Each point has the
    flexibility that residual vectors add. Without points, all degrees of freedom have shapes, 1024 at most, and none
    has a residual vector. -o modes.toml writes them as a body of a scene, which needs the matrices no more.

    Example: vibroimpact modes examples/bracket/bracket.sti.gz --point tip=42.z --base z -o modes.toml

    Two files: vibroimpact modes k.mtx --mass m.mtx --freedoms freedoms.csv --figure shapes.png
    """

    file: Annotated[
        Path,
        Positional(
            help="Matrices (.mtx, .npz, .mat, .sti, .op4, .pch), modes (.toml, .csv, .nc, .uff), or a scene (.toml).",
            python="file: SceneLike",
        ),
    ]
    stiffness: Annotated[
        str | None, Option(metavar="NAME", help="Name of the stiffness matrix in the file.")
    ] = None
    mass: Annotated[
        str | None, Option(metavar="FILE", help="File of the mass matrix, or its name in the first file.")
    ] = None
    damping: Annotated[
        str | None, Option(metavar="FILE", help="File of a damping matrix, or its name in the first file.")
    ] = None
    freedoms: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Table of the degrees of freedom, with places.",
            python="freedoms: PathLike | None = None",
        ),
    ] = None
    points: Annotated[
        list[str] | None,
        Option(
            "--point",
            metavar="NAME=FREEDOM",
            help='Point of a contact or a load: tip=12.z, or gap={"12.z"=1, "17.z"=-1}; may be repeated.',
            python="points: Mapping[str, str | Mapping[str, float]] | None = None",
        ),
    ] = None
    modes: Annotated[
        str | None,
        Option(
            help="Number of modes, 1 to 64, residual vectors among them; or auto. By default 20.",
            python="modes: int | Literal['auto'] | None = None",
        ),
    ] = None
    tolerance: Annotated[
        float | None, Option(help="auto: largest relative error of the flexibility at the points.")
    ] = None
    residual: Annotated[
        bool,
        Option(
            "--residual/--no-residual", help="Whether residual vectors of the points are among the modes."
        ),
    ] = True
    base: Annotated[str | None, Option(help="Direction of a base that moves, such as z.")] = None
    damping_ratio: Annotated[float | None, Option(help="Damping ratio of all modes.")] = None
    rayleigh: Annotated[
        str | None,
        Option(
            metavar="{mass=A, stiffness=B}",
            help="Damping A M + B K: A in 1/s, B in s; one of them may be left out.",
            python="rayleigh: Mapping[str, float] | None = None",
        ),
    ] = None
    body: Annotated[str | None, Option(help="Name of the body of a scene with several.")] = None
    output: Annotated[
        Path | None,
        Option(
            "--output",
            "-o",
            help="File of the modes: .toml, .csv, .nc or .uff.",
            python="path: PathLike | None = None",
        ),
    ] = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
