"""`[[body]]` of matrices from files, which becomes a body of given modes when its scene is read."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from vibroimpact.orchestrator.scene.body_models.base import BODY_KINDS
from vibroimpact.orchestrator.scene.body_models.beam import RAYLEIGH, Rayleigh
from vibroimpact.orchestrator.scene.body_models.modes import MOST_POINTS
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import DAMPING, Finite, ModeCount, NotNegativeNumbers, SceneTable
from vibroimpact.orchestrator.scene.problems import ARRAY_TAG, WORD_TAG

Name = Annotated[str, Field(min_length=1, max_length=500)]


def _form(value: object) -> str:
    return ARRAY_TAG if isinstance(value, dict) else WORD_TAG


Combination = Annotated[
    Annotated[Name, Tag(WORD_TAG)] | Annotated[dict[str, Finite], Tag(ARRAY_TAG)], Discriminator(_form)
]
_FILE = "the name of a file"
_FREEDOM = 'a degree of freedom such as "12.z", or weights such as { "12.z" = 1, "17.z" = -1 }'


class MatricesBody(SceneTable):
    """`[[body]]`: mass, damping and stiffness matrices of M x'' + C x' + K x = f."""

    kind: Annotated[Literal["matrices"], BODY_KINDS]
    file: Annotated[
        Name | None,
        Rule(_FILE, doc="a file that holds all matrices; the keys below are then their names in it"),
    ] = None
    stiffness: Annotated[
        Name | None,
        Rule(
            "a file, or a name within `file`",
            doc="symmetric, N/m",
            default="required without `file`; else its usual name",
        ),
    ] = None
    mass: Annotated[
        Name | None,
        Rule(
            "a file, or a name within `file`",
            doc="symmetric, kg",
            default="required without `file`; else its usual name",
        ),
    ] = None
    damping: Annotated[
        Name | None, Rule("a file, or a name within `file`", doc="symmetric, N s/m", default="none")
    ] = None
    freedoms: Annotated[
        Name | None,
        Rule(
            _FILE,
            doc="a table of the degrees of freedom in their order: name, or node and direction; x, y, z of the node",
            default="the names that the matrices' file has, else 1, 2, ...",
        ),
    ] = None
    points: Annotated[
        dict[str, Combination],
        Field(max_length=MOST_POINTS),
        Rule(
            f"a table of points, each {_FREEDOM}",
            doc=f"named points, each {_FREEDOM}; a degree of freedom is a point by its own name, too",
            default="none",
        ),
    ] = {}  # noqa: RUF012  pydantic copies it
    base: Annotated[
        Combination | None,
        Rule(
            f'a direction such as "z", or {_FREEDOM}',
            doc="motion for 1 m of the base: of all degrees of freedom whose name ends in this direction, or weights",
            default="none; a base acceleration needs it",
        ),
    ] = None
    modes: Annotated[
        ModeCount,
        Rule(
            'a whole number from 1 to 64, or "auto"',
            sweepable=False,
            doc='1 to 64, residual vectors among them; `"auto"`: the fewest that meet `execution.tolerance`, '
            "see [below](#how-many-modes)",
        ),
    ] = 20
    residual: Annotated[
        bool,
        Rule(
            doc="`true`: residual vectors at its points are the last modes, so that it is not too stiff there"
        ),
    ] = True
    damping_ratio: Annotated[
        NotNegativeNumbers,
        Rule(sweepable=False, hint="One number for all modes, or one for each.", effect=DAMPING),
    ] = 0.0
    rayleigh: Annotated[
        Rayleigh | None,
        RAYLEIGH,
    ] = None
