"""The entries of `[sweep]` as frozen pydantic models, as in `models`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.scene.designs import DesignName
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import Finite, SceneTable
from vibroimpact.orchestrator.scene.sweep import MOST_LISTED, SweepPath

MOST_POINTS_PER_AXIS = 10**8
"""Largest number of values of a range; values that are listed, drawn or refined are at most `MOST_LISTED`."""


class SampleTable(SceneTable):
    """The entry `sample` of `[sweep]`: the design by which keys with a distribution are drawn."""

    design: Annotated[
        DesignName,
        Rule(
            doc='`"random"`; `"sobol"`: evenly spread, `points` is a power of 2; `"saltelli"`: for `vibroimpact '
            "sensitivity`, `points` is a power of 2, and each of these points has keys + 2 runs"
        ),
    ]
    points: Annotated[
        int,
        Field(ge=1, le=MOST_LISTED),
        Rule(doc="number of drawn points; a larger number can keep the earlier points, see below"),
    ]
    seed: Annotated[int, Field(ge=0, le=10**9), Rule(doc="another seed draws other points")] = 0


class AdaptiveTable(SceneTable):
    """`adaptive` of an axis as written."""

    tolerance: Annotated[
        Finite,
        Field(gt=0),
        Rule(doc="intervals where the motion jumps are halved until they are no wider than this"),
    ]
    at_most: Annotated[
        int | None,
        Field(ge=2, le=MOST_LISTED),
        Rule(
            doc="largest number of points of the sweep; of two adaptive axes one has it, or both the same",
            default="required",
        ),
    ] = None
    jump: Annotated[
        Finite,
        Field(gt=0, le=1),
        Rule(
            "a number > 0 and <= 1",
            doc="change of the recorded range, over the largest one, that counts as a jump",
        ),
    ] = 0.05


class AxisTable(SceneTable):
    """One entry of `[sweep]` as written: a range, a list or a distribution, and a path."""

    start: Annotated[Finite | None, Rule(doc="first value of a range")] = None
    stop: Annotated[Finite | None, Rule(doc="last value of a range, included")] = None
    points: Annotated[
        int | None,
        Field(ge=1, le=MOST_POINTS_PER_AXIS),
        Rule(
            doc="number of values of a range; at least 2 unless start = stop; at most 10^6 if `adaptive` or "
            '`spacing = "log"`'
        ),
    ] = None
    spacing: Annotated[
        Literal["linear", "log"],
        Rule(
            hint="log: each value over the one before is the same.",
            doc='`"linear"`: equal steps; `"log"`: equal ratios of neighbouring values, and both ends have one sign',
        ),
    ] = "linear"
    values: Annotated[
        tuple[Finite, ...] | None,
        Field(strict=False, min_length=1),
        Rule(doc="instead of a range; all different"),
    ] = None
    path: Annotated[SweepPath, Rule()] = "independent"
    zip: Annotated[
        str | None,
        Field(pattern=r"^[a-z][a-z0-9_]*$"),
        Rule(
            "a name of small letters, digits and _",
            hint="Keys with the same name move together.",
            doc="keys with the same name move together, along a dimension of this name; all have equally many values",
        ),
    ] = None
    distribution: Annotated[
        Literal["uniform", "log-uniform", "normal"] | None,
        Rule(
            hint="Uniform and log-uniform go from low to high; normal has a mean and a deviation.",
            doc='instead of a range: `"uniform"`, `"log-uniform"`, `"normal"`; values are drawn as `sample` says',
        ),
    ] = None
    low: Annotated[Finite | None, Rule(doc="lowest value; optional for a normal distribution")] = None
    high: Annotated[Finite | None, Rule(doc="highest value; optional for a normal distribution")] = None
    mean: Annotated[Finite | None, Rule(doc="mean of a normal distribution before its cut")] = None
    deviation: Annotated[
        Annotated[Finite, Field(gt=0)] | None,
        Rule(doc="standard deviation of a normal distribution, before `low` and `high` cut it off"),
    ] = None
    adaptive: Annotated[
        AdaptiveTable | None,
        Rule("a table with tolerance and at_most", doc="points are put where the motion jumps"),
    ] = None
