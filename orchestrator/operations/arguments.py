"""Arguments shared by operations on scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import STRICT, Option, Positional

SceneFile = Annotated[
    Path, Positional(help="Scene file (TOML), or a system (SSP).", python="scene: SceneLike")
]
SceneOrDataset = Annotated[
    Path,
    Positional(
        help="Scene file (TOML); or the dataset of its runs (.nc), the folder of a campaign.",
        python="dataset: xr.Dataset | str | PathLike[str]",
    ),
]
Strict = Annotated[bool, Option("--strict", help=STRICT, python="")]
Changes = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scene before its check, written as in messages; may be repeated.",
        python="",
    ),
]
Seed = Annotated[
    str | None,
    Option(
        metavar="PHASE:STOP,...",
        help="Forcing phases (rad) close to those of an orbit's impacts, and their stops (1).",
        python="seed: Sequence[tuple[float, int]] | None = None",
    ),
]
FromDataset = Annotated[
    Path | None,
    Option(
        metavar="FILE",
        help="Dataset (.nc, or the folder of a campaign) whose run gives the first orbit.",
        python="",
    ),
]
Run = Annotated[int | None, Option(help="run_index of that run, if there are several.", min=0, python="")]
Doublings = Annotated[int, Option(help="Number of successive period doublings that are followed.")]
Grazes = Annotated[int, Option(help="Number of successive grazes at which other orbits are followed.")]
SecondStart = Annotated[
    float | None,
    Option(
        "--second-from",
        python="second_range: tuple[float, float] | None = None",
        help="First end of its range.",
    ),
]
SecondStop = Annotated[float | None, Option("--second-to", python="", help="Second end of its range.")]
