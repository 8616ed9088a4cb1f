"""`[body]` of one mass on a spring and a dashpot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vibroimpact.orchestrator.scene.body_models.base import (
    BODY_KINDS,
    DAMPING_RECIPROCAL,
    DAMPING_SLOPE,
    FREQUENCY_SLOPE,
    BodyTable,
    Stops,
    of_amplitude,
)
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import DAMPING, FEEDS_ENERGY, Finite, NotNegative, Positive

if TYPE_CHECKING:
    from vibroimpact.fmus.bodies.assembly import Part


class OscillatorBody(BodyTable):
    """`[body]`: one mass on a spring and a dashpot, mass x'' + damping x' + stiffness x = force."""

    MOST_STOPS: ClassVar[int] = 2
    NAME: ClassVar[str] = "an oscillator"
    FMU: ClassVar[str] = "Oscillator"
    IS_STRUCTURE: ClassVar[bool] = False

    finds_modes: ClassVar[bool] = False
    has_residual_vectors: ClassVar[bool] = False
    projection: ClassVar[str] = "variational"
    fixed_end: ClassVar[str] = ""
    own_variables: ClassVar[tuple[str, ...]] = ()
    size: ClassVar[int] = 1
    kept_modes: ClassVar[int] = 1
    state_variables: ClassVar[tuple[str, ...]] = ()
    start_names: ClassVar[tuple[str, ...]] = ("displacement_start", "velocity_start")

    kind: Annotated[Literal["oscillator"], BODY_KINDS] = "oscillator"
    mass: Annotated[Positive, Rule(unit="kg", fmu="mass")]
    stiffness: Annotated[
        NotNegative, Rule(unit="N/m", hint="Use 0 for a body without a spring.", fmu="stiffness")
    ]
    damping_given: Annotated[
        NotNegative, Rule(unit="N s/m", hint=FEEDS_ENERGY, fmu="damping", effect=DAMPING)
    ] = Field(0.0, alias="damping")
    damping_ratio: Annotated[
        NotNegative | None,
        Rule(
            hint=FEEDS_ENERGY,
            effect=DAMPING,
            doc="needs stiffness > 0; instead of `damping`: damping = 2 damping_ratio sqrt(stiffness mass) at every "
            "point of a sweep",
        ),
    ] = None
    displacement_start: Annotated[
        Finite,
        Rule(unit="m", fmu="displacement_start", doc="not beyond a rigid stop; exactly on a stop is allowed"),
    ] = 0.0
    velocity_start: Annotated[Finite, Rule(unit="m/s", fmu="velocity_start")] = 0.0
    frequency_slope: Annotated[Finite, of_amplitude(*FREQUENCY_SLOPE)] = 0.0
    damping_slope: Annotated[Finite, of_amplitude(*DAMPING_SLOPE)] = 0.0
    damping_reciprocal: Annotated[NotNegative, of_amplitude(*DAMPING_RECIPROCAL)] = 0.0

    @property
    def damping(self) -> float:
        """Damping coefficient, N s/m: as given, or 2 damping_ratio sqrt(stiffness mass)."""
        if self.damping_ratio is None:
            return self.damping_given
        square = self.stiffness * self.mass
        # the values of a sweep may be arrays
        root = np.sqrt(square) if isinstance(square, np.ndarray) else math.sqrt(square)
        return 2.0 * self.damping_ratio * root

    def as_part(self) -> Part:
        """Return this body as a part of an assembly."""
        from vibroimpact.fmus.bodies.assembly import MassesPart

        one = [self.mass], [self.stiffness, 0.0], [self.damping, 0.0]
        return MassesPart(*one, [self.displacement_start], [self.velocity_start])

    def load_of(self, force: Force) -> tuple[float, ...]:
        """Return the force on the mass under a force with the amplitude 1."""
        return (1.0,)

    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return the amplitude of the force, N."""
        if forcing is None:
            return {}
        # the acceleration of the base is an inertial force on the relative coordinate
        scale = 1.0 if forcing.kind == "force" else -self.mass
        return {"forcing.amplitude": scale * forcing.scalar_amplitude}

    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return no parameters."""
        return {}
