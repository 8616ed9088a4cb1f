"""Fields of tables that name a point of a body, or a pair of points; `body_models.points` finds the points."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import ARRAY_TAG, WORD_TAG

Point = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[^\x00-\x1f\x7f]*$")]
POINT_RULE = Rule(
    "a point of a body, in quotes",
    item="a point of a body, in quotes",
    hint='For example "ball", "chain.2" or "beam.tip".',
)
PointPair = Annotated[tuple[Point, ...], Field(strict=False, min_length=2, max_length=2)]


def _point_or_pair(value: object) -> str:
    return ARRAY_TAG if isinstance(value, list | tuple) else WORD_TAG


Observed = Annotated[
    Annotated[Point, Tag(WORD_TAG)] | Annotated[PointPair, Tag(ARRAY_TAG)], Discriminator(_point_or_pair)
]
MOST_OBSERVED = 32
