"""`[[body]]` of modes that are known: from finite elements or from measurements."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vibroimpact.orchestrator.scene.body_models.base import BODY_KINDS, BodyTable, NoPoint, Stops
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import (
    DAMPING,
    MOST_MODES,
    FiniteArray,
    FiniteNumbers,
    NotNegative,
    SceneTable,
    StartArray,
)
from vibroimpact.orchestrator.scene.sampled_names import each_of

if TYPE_CHECKING:
    from vibroimpact.fmus.bodies.assembly import Part
    from vibroimpact.orchestrator.structures.modes import Modes

_Frequencies = Annotated[tuple[NotNegative, ...], Field(strict=False, min_length=1, max_length=MOST_MODES)]
_ONE_FOR_EACH = "One for each mode."
POINT_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,39}")
MOST_POINTS = 1024
"""Largest number of points with shapes."""


class Origin(SceneTable):
    """`body.origin`: where given modes come from."""

    files: Annotated[
        dict[str, str],
        Rule("a table of files with their SHA-256", doc="SHA-256 of each file by its name", default="none"),
    ] = {}  # noqa: RUF012  pydantic copies it
    residual_vectors: Annotated[
        int,
        Field(ge=0, le=MOST_MODES),
        Rule(doc="how many of the last modes are residual vectors", sweepable=False),
    ] = 0
    error: Annotated[
        NotNegative | None,
        Rule(
            sweepable=False,
            doc="relative error of the flexibility at the points",
            default="unknown",
        ),
    ] = None
    remarks: Annotated[
        tuple[str, ...],
        Field(strict=False),
        Rule("an array of texts", doc="what was changed on the way", default="none"),
    ] = ()


class ModesBody(BodyTable):
    """`[[body]]`: modes with their mass-normalised shapes at named points."""

    NAME: ClassVar[str] = "modes"
    FMU: ClassVar[str] = "Structure"
    MOST_STOPS: ClassVar[int] = 32
    HAS_MASSES: ClassVar[bool] = False
    ELEMENT: ClassVar[str] = "mode"
    STATE: ClassVar[str] = "modal_"
    PLACE: ClassVar[str] = "at"
    CAN_BE_MEASURED: ClassVar[bool] = False

    kind: Annotated[Literal["modes"], BODY_KINDS]
    frequencies: Annotated[
        _Frequencies | None,
        Rule(
            "an array of numbers >= 0",
            unit="Hz",
            hint=_ONE_FOR_EACH,
            doc="natural frequencies; 0 for a rigid body",
        ),
    ] = None
    angular_frequencies: Annotated[
        _Frequencies | None,
        Rule("an array of numbers >= 0", unit="rad/s", hint=_ONE_FOR_EACH, doc="in place of `frequencies`"),
    ] = None
    damping_ratio: Annotated[
        FiniteNumbers,
        Rule(
            hint="One number for all modes, or one for each.", effect=DAMPING, doc="negative ones feed energy"
        ),
    ] = 0.0
    damping_matrix: Annotated[
        tuple[FiniteArray, ...],
        Field(strict=False, max_length=MOST_MODES),
        Rule(
            "a symmetric matrix, an array of rows",
            unit="1/s",
            sweepable=False,
            hint="It is phi' C phi for mass-normalised shapes phi.",
            doc="modal damping matrix, which may couple the modes; added to the damping ratios",
            default="none",
        ),
    ] = ()
    shapes: Annotated[
        dict[str, FiniteArray],
        Field(min_length=1, max_length=MOST_POINTS),
        Rule(
            "a table of points such as { tip = [1.3, -0.7] }",
            sweepable=False,
            hint="Each has the displacement of the point for 1 kg^(1/2) m of each mode.",
            doc="mass-normalised shapes at named points, kg^(-1/2), one number for each mode",
        ),
    ]
    participation: Annotated[
        StartArray,
        Rule(
            hint=_ONE_FOR_EACH,
            sweepable=False,
            doc="phi' M r, kg^(1/2), for 1 m of the base; a base acceleration needs it",
            default="none",
        ),
    ] = ()
    file: Annotated[
        str | None,
        Rule(
            "the name of a file",
            doc="a file of modes in place of frequencies and shapes, see [below](#files-of-modes)",
        ),
    ] = None
    origin: Annotated[
        Origin | None,
        Rule("a table", doc="where the modes come from; written for bodies by files", default="none"),
    ] = None
    displacement_start: Annotated[
        StartArray,
        Rule(unit="m", hint=_ONE_FOR_EACH, doc="of the modes, kg^(1/2) m; those left out are 0", default="0"),
    ] = ()
    velocity_start: Annotated[
        StartArray, Rule(unit="m/s", hint=_ONE_FOR_EACH, doc="of the modes, kg^(1/2) m/s", default="0")
    ] = ()

    @property
    def natural(self) -> tuple[float, ...]:
        """Natural angular frequencies, rad/s."""
        if self.angular_frequencies is not None:
            return self.angular_frequencies
        return tuple(2.0 * math.pi * each for each in self.frequencies or ())

    @property
    def size(self) -> int:
        """Number of modes."""
        return len(self.frequencies or self.angular_frequencies or ())

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points."""
        return tuple(self.shapes)

    def place_named(self, rest: str, name: str) -> float | NoPoint:
        """Return the number of a point, from 1; of the only one without a name: see `BodyTable`."""
        rest = self.points[0] if rest == "" and len(self.shapes) == 1 else rest
        if rest in self.shapes:
            moves = any(self.shapes[rest])
            return (
                1 + self.points.index(rest)
                if moves
                else NoPoint("a point that a mode moves", "Its shape is 0.")
            )
        some = ", ".join(f'"{name}.{point}"' for point in self.points[:4])
        return NoPoint(f"a point with shapes: {some}{', ...' if len(self.shapes) > 4 else ''}")

    @property
    def own_variables(self) -> tuple[str, ...]:
        """The motion and the energy of each mode."""
        names = "modal_displacement", "modal_velocity", "modal_energy"
        return tuple(one for name in names for one in each_of(name, self.size))

    def given_modes(self) -> Modes:
        """Return the modes in this table."""
        from vibroimpact.orchestrator.structures.modes import Modes

        origin = self.origin or Origin()
        return Modes(
            natural=np.array(self.natural),
            damping_ratios=np.full(self.size, self.damping_ratio, dtype=np.float64),
            damping=np.array(self.damping_matrix) if self.damping_matrix else None,
            shapes={name: np.array(shape) for name, shape in self.shapes.items()},
            participation=np.array(self.participation) if self.participation else None,
            residual_vectors=origin.residual_vectors,
            error=origin.error,
            files=origin.files,
            remarks=origin.remarks,
        )

    def as_part(self) -> Part:
        """Return this body as a part of an assembly."""
        from vibroimpact.fmus.bodies.assembly import ModesPart

        count = self.size
        ratios = (
            self.damping_ratio if isinstance(self.damping_ratio, tuple) else (self.damping_ratio,) * count
        )

        damping = np.array(self.damping_matrix or np.zeros((count, count)))

        def filled(given: tuple[float, ...]) -> tuple[float, ...]:
            return (*given, *(0.0,) * (count - len(given)))

        return ModesPart(
            self.natural,
            ratios,
            0.5 * (damping + damping.T),
            np.array(list(self.shapes.values())),
            filled(self.participation),
            filled(self.displacement_start),
            filled(self.velocity_start),
        )

    def load_of(self, force: Force) -> tuple[float, ...]:
        """Return no load: a force on given modes acts at a point."""
        return (0.0,) * self.size

    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return no parameters: these modes run in a structure."""
        return {}

    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return no parameters."""
        return {}


def is_listed(body: object) -> bool:
    """Return whether a table of a body has a kind that runs as a structure: its stops and forces name its points."""
    written: Mapping[str, object] = body if isinstance(body, dict) else {}
    return written.get("kind") == "modes"
