"""The model of `[execution]`: the way to run points, and the limits of a point."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import Finite, Positive, SceneTable, StepSize

MOST_IMPACTS_PER_POINT = 10**12
DEFAULT_IMPACT_LIMIT = 10_000_000


class Execution(SceneTable):
    """`[execution]`: the way to run points, and the limits of a point.

    `macro_step`, `coupling_tolerance`, `exchange` and `guard` are for coupled runs.
    """

    how: Annotated[
        Literal["auto", "coupled", "fused"],
        Rule(
            unavailable=("batch",),
            doc='`"auto"`: `"fused"`, or many points at once, in lanes, if the sweep allows it, see '
            '[below](#many-points-at-once); `"fused"`: the contact law runs inside the body; `"coupled"`: each '
            "component is an FMU of its own and the importer finds the events between them",
        ),
    ] = "auto"
    impact_limit: Annotated[
        int,
        Field(ge=1, le=MOST_IMPACTS_PER_POINT),
        Rule(
            doc="impacts, touch-downs and rests, recorded or not, that end a point with the outcome impact_limit"
        ),
    ] = DEFAULT_IMPACT_LIMIT
    deadline: Annotated[
        Positive | None,
        Rule(
            unit="s",
            sweepable=False,
            doc="wall time after which a point ends with the outcome timeout, checked every few hundredths of a "
            "second, within a long step too; with a deadline no points run in lanes, where a point has no clock",
        ),
    ] = None
    macro_step: Annotated[
        StepSize | None,
        Rule(
            'a number > 0, or "auto"',
            unit="s",
            sweepable=True,
            doc='time between two exchanges of values; coupled only; `"auto"`: an error estimate chooses the steps, in '
            "scenes of components",
            default="the whole run",
        ),
    ] = None
    coupling_tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=1)] | None,
        Rule(
            "0 < tolerance <= 1",
            hint="It is the relative error of each value in one step.",
            sweepable=False,
            doc='estimated relative error of each connected output in one step with `macro_step = "auto"`; errors of '
            "steps add up",
            default="1e-6",
        ),
    ] = None
    exchange: Annotated[
        Exchange,
        Rule(
            doc='`"jacobi"`, `"gauss_seidel"`, `"iterated"`: whose values of the step each component sees; coupled only'
        ),
    ] = "gauss_seidel"
    guard: Annotated[
        bool,
        Rule(
            doc="points run in a child process, which may crash or hang; coupled only",
            default="false; true as soon as a component is a file",
        ),
    ] = False
    contact_tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=1e-2)] | None,
        Rule(
            "0 < tolerance <= 0.01",
            hint="It is the relative error of the speed after one contact whose force is a power of the penetration.",
            fmu="contact_tolerance",
            doc="relative error of the speed after one contact with a hertz or hunt_crossley stop, which is "
            "integrated; errors of contacts add up; the other laws are exact; not in general scenes",
            default="1e-10",
        ),
    ] = None
    tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=0.5)] | None,
        Rule(
            "0 < tolerance <= 0.5",
            hint="It is the relative error that is asked of what is recorded.",
            sweepable=False,
            doc='largest relative error of the recorded results: `body.modes = "auto"` meets it, and datasets have the '
            "estimated error (`estimated_error`)",
            default="nothing is estimated",
        ),
    ] = None

    @property
    def fixed_step(self) -> float | None:
        """The macro step, s; None where none is given, or an error estimate chooses it."""
        return None if self.macro_step == "auto" else self.macro_step

    @property
    def adapts(self) -> bool:
        """Whether an error estimate chooses the communication steps."""
        return self.macro_step == "auto"
