"""`[body]` of an Euler-Bernoulli beam."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vibroimpact.orchestrator.scene.body_models.base import (
    BODY_KINDS,
    DAMPING_RECIPROCAL,
    DAMPING_SLOPE,
    FREQUENCY_SLOPE,
    BodyTable,
    NoPoint,
    Stops,
    of_amplitude,
)
from vibroimpact.orchestrator.scene.fields import Rule, named_numbers
from vibroimpact.orchestrator.scene.forcing_models import Force
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import (
    DAMPING,
    MOST_MODES,
    Finite,
    FiniteNumbers,
    ModeCount,
    NotNegative,
    NotNegativeNumbers,
    Positive,
    SceneTable,
    StartArray,
    Stop,
)
from vibroimpact.orchestrator.scene.sampled_names import each_of

if TYPE_CHECKING:
    from vibroimpact.fmus.bodies.assembly import Part

TIP, MIDDLE = 1.0, 0.5
"""Places on a beam, as fractions of its length."""
BOUNDARY_NUMBERS = {"clamped-free": 1, "clamped-clamped": 2, "clamped-pinned": 3, "pinned-pinned": 4}
FORCING_NUMBERS = {"force": 1, "uniform": 2, "mode": 3, "base_acceleration": 4}
PROJECTION_NUMBERS = {"variational": 1, "collocation": 2}


class Rayleigh(SceneTable):
    """`body.rayleigh`: damping ratios mass / (2 w) + stiffness w / 2, added to the given damping ratios."""

    mass: Annotated[NotNegative, Rule(unit="1/s", fmu="rayleigh.mass")] = 0.0
    stiffness: Annotated[NotNegative, Rule(unit="s", fmu="rayleigh.stiffness")] = 0.0


RAYLEIGH = Rule(
    "a table such as { mass = 0.1, stiffness = 1e-5 }",
    hint="Both are optional.",
    doc="`{ mass = .., stiffness = .. }`: adds mass / (2 w) + stiffness w / 2 to each damping ratio",
)


class BeamBody(BodyTable):
    """`[body]`: an Euler-Bernoulli beam with a number of modes."""

    NAME: ClassVar[str] = "a beam"
    FMU: ClassVar[str] = "Beam"
    HAS_MASSES: ClassVar[bool] = False
    ELEMENT: ClassVar[str] = "mode"
    STATE: ClassVar[str] = "modal_"
    TAKES_ARRAYS: ClassVar[bool] = False  # powers of numbers and of arrays may differ in their last bit
    PLACE: ClassVar[str] = "location"
    PLACE_HINT: ClassVar[str] = "Say where on the beam by location."
    FORCINGS: ClassVar[tuple[str, ...]] = ("force", "base_acceleration", "uniform", "mode")
    FORCING_KEYS: ClassVar[Mapping[str, str]] = {"location": "force", "mode": "mode"}
    KNOWS_BASE: ClassVar[bool] = True

    kind: Annotated[Literal["beam"], BODY_KINDS]
    length: Annotated[Positive, Rule(unit="m", fmu="length")]
    width: Annotated[Positive | None, Rule(unit="m", fmu="width", doc="with the three keys below")] = None
    thickness: Annotated[
        Positive | None,
        Rule(unit="m", hint="It is measured along the motion.", fmu="thickness", doc="along the motion"),
    ] = None
    youngs_modulus: Annotated[Positive | None, Rule(unit="Pa", fmu="youngs_modulus")] = None
    density: Annotated[Positive | None, Rule(unit="kg/m^3", fmu="density")] = None
    flexural_rigidity: Annotated[
        Positive | None,
        Rule(
            unit="N m^2",
            fmu="flexural_rigidity",
            doc="beside `mass_per_length`, in place of the four keys above",
        ),
    ] = None
    mass_per_length: Annotated[Positive | None, Rule(unit="kg/m", fmu="mass_per_length")] = None
    frequency: Annotated[
        Positive | None,
        Rule(
            unit="Hz",
            hint="It is the first natural frequency, beside mass_per_length.",
            doc="first natural frequency, beside `mass_per_length` and in place of `flexural_rigidity`",
        ),
    ] = None
    boundary: Annotated[
        Literal["clamped-free", "clamped-clamped", "clamped-pinned", "pinned-pinned"], Rule()
    ] = "clamped-free"
    modes: Annotated[
        ModeCount,
        Rule(
            f'a whole number from 1 to {MOST_MODES}, or "auto"',
            sweepable=True,
            doc="1 to 64; a coefficient of restitution has a meaning only together with this number; "
            '`"auto"`: the fewest that meet `execution.tolerance`, see [below](#how-many-modes)',
        ),
    ] = 4
    residual: Annotated[
        bool | None,
        Rule(
            hint="It needs stops that yield.",
            default="false",
            doc="`true`: residual vectors replace the last modes, one for each place of a stop, so that the beam is "
            "not too stiff at its stops, see [below](#how-many-modes); all stops have to yield",
        ),
    ] = None
    damping_ratio: Annotated[
        NotNegativeNumbers,
        Rule(hint="One number for all modes, or one for each.", fmu="damping_ratio[i]", effect=DAMPING),
    ] = 0.0
    frequency_slope: Annotated[FiniteNumbers, of_amplitude(*FREQUENCY_SLOPE, each="[i]")] = 0.0
    damping_slope: Annotated[FiniteNumbers, of_amplitude(*DAMPING_SLOPE, each="[i]")] = 0.0
    damping_reciprocal: Annotated[NotNegativeNumbers, of_amplitude(*DAMPING_RECIPROCAL, each="[i]")] = 0.0
    rayleigh: Annotated[
        Rayleigh | None,
        RAYLEIGH,
    ] = None
    poisson_ratio: Annotated[
        Finite,
        Field(gt=-1, le=0.5),
        Rule(
            "-1 < nu <= 0.5",
            hint="It serves the warning of modes that are too short for this theory.",
            sweepable=False,
            fmu="poisson_ratio",
            doc="only for the warning of modes that leave the theory's validity",
        ),
    ] = 0.3
    impact_projection: Annotated[
        Literal["variational", "collocation"],
        Rule(
            hint="Only variational impacts never create energy.",
            doc='`"variational"`: impacts never create energy; `"collocation"`: the thesis\'s rule (7.60), which can',
        ),
    ] = "variational"
    displacement_start: Annotated[
        StartArray,
        Rule(
            unit="m",
            hint="One for each mode.",
            fmu="modal_displacement_start[i]",
            doc="one number for each mode, or fewer: the displacement at s is the sum of shape(s) times these numbers. "
            "The beam's FMU refuses a start beyond a rigid stop",
            default="0",
        ),
    ] = ()
    velocity_start: Annotated[
        StartArray,
        Rule(
            unit="m/s",
            hint="One for each mode.",
            fmu="modal_velocity_start[i]",
            doc="one number for each mode, or fewer",
            default="0",
        ),
    ] = ()

    @property
    def size(self) -> int:
        """Number of modes; the largest possible number for `modes = "auto"`."""
        return MOST_MODES if self.modes == "auto" else self.modes

    @property
    def finds_modes(self) -> bool:
        """Whether the number of modes must still be found (`modes = "auto"`)."""
        return self.modes == "auto"

    @property
    def has_residual_vectors(self) -> bool:
        """Whether the last modes are residual vectors: the static flexibility of left-out modes at the stops."""
        return bool(self.residual)

    @property
    def projection(self) -> str:
        """Projection by which an impact changes the modes."""
        return self.impact_projection

    # ---- places ----

    @property
    def far_end_moves(self) -> bool:
        """Whether the far end is free."""
        return self.boundary == "clamped-free"

    def place_of(self, stop: Stop) -> float:
        """Return the place of a stop on the beam: as given, or the tip."""
        return TIP if stop.location is None else stop.location

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> float:
        """Return the place of the recorded displacement.

        It is the location of `[sensor]`; else the tip of a clamped-free beam; else the place of stop[1], or the middle.
        """
        if sensor is not None and sensor.location is not None:
            return sensor.location
        if self.far_end_moves:
            return TIP
        return self.place_of(stops[0]) if stops else MIDDLE

    def forced_place(self, forcing: Force | None) -> float:
        """Return the place of the force: as given, the free tip, or the middle."""
        if forcing is not None and forcing.location is not None:
            return forcing.location
        return TIP if self.far_end_moves else MIDDLE

    @property
    def fixed_end(self) -> str:
        """Reason why a stop must have a location; empty for a beam with a free tip."""
        return "" if self.far_end_moves else f"the far end of a {self.boundary} beam does not move"

    def fixed_point(self, location: float) -> tuple[str, str] | None:
        """Return the expected kind of point, and the name of the point at a fixed location; None if it moves."""
        if 0.0 < location < 1.0 or (location == TIP and self.far_end_moves):
            return None
        end = "clamped end" if location == 0.0 else "supported far end"
        return f"a point where a {self.boundary} beam moves", end

    def place_named(self, rest: str, name: str) -> float | NoPoint:
        """Return the fraction of the length, or 1 for the tip: see `BodyTable`."""
        location = TIP
        if rest not in ("", "tip"):
            try:
                location = float(rest) if re.fullmatch(r"[0-9.]+", rest) else -1.0
            except ValueError:
                location = -1.0
            if not 0.0 <= location <= 1.0:
                return NoPoint(f'"{name}.tip", or a fraction of the length such as "{name}.0.5"')
        fixed = self.fixed_point(location)
        return (
            location if fixed is None else NoPoint(fixed[0], f'"{name}.{rest or "tip"}" is the {fixed[1]}.')
        )

    @property
    def own_variables(self) -> tuple[str, ...]:
        """The motion and the energy of each mode."""
        names = "modal_displacement", "modal_velocity", "modal_energy"
        return tuple(one for name in names for one in each_of(name, self.size))

    # ---- parameters of the FMU ----

    def as_part(self) -> Part:
        """Return this body as a part of an assembly."""
        from vibroimpact.fmus.bodies.assembly import BeamPart

        numbers = named_numbers(self, self.size) | self.fmu_floats(None, (), None)
        return BeamPart(numbers, self.fmu_integers(None, ()))

    def load_of(self, force: Force) -> tuple[float, ...]:
        """Return the force on each mode under a force with the amplitude 1, not on the base."""
        from vibroimpact.fmus.bodies.beam import BeamPoints  # imports the core, which few scenes need

        numbers = named_numbers(self, self.size) | self.fmu_floats(force, (), None)
        found = BeamPoints(numbers, self.fmu_integers(force, ()), 0).structure_of(numbers)
        return tuple((found.load[:, 0] * found.mass).tolist())

    def fmu_floats(self, forcing: Force | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return rigidity, Rayleigh damping, places and amplitude as parameters of the FMU, SI."""
        found: dict[str, float] = {}
        if self.frequency is not None:
            from vibroimpact.fmus.bodies.beam import (
                rigidity_of_frequency,  # imports the core, which few scenes need
            )

            assert self.mass_per_length is not None
            found["flexural_rigidity"] = rigidity_of_frequency(
                BOUNDARY_NUMBERS[self.boundary], self.length, self.mass_per_length, self.frequency
            )
        if self.rayleigh is not None:
            found |= {"rayleigh.mass": self.rayleigh.mass, "rayleigh.stiffness": self.rayleigh.stiffness}
        observed, forced = self.observed_place(stops, sensor), self.forced_place(forcing)
        found |= {"sensor_location": observed, "forcing_location": forced}
        found |= {f"contact[{k}].location": self.place_of(stop) for k, stop in enumerate(stops, start=1)}
        if forcing is not None:
            found["forcing.amplitude"] = forcing.scalar_amplitude
        return found

    def fmu_integers(self, forcing: Force | None, stops: Stops) -> dict[str, int]:
        """Return modes, residual vectors, boundary, projection and kind of load as numbers of the FMU."""
        found = {
            "modes": self.size,
            "residual": self.has_residual_vectors,
            "boundary": BOUNDARY_NUMBERS[self.boundary],
            "impact_projection": PROJECTION_NUMBERS[self.impact_projection],
        }
        if forcing is not None:
            found["forcing.kind"] = FORCING_NUMBERS[forcing.kind]
            if forcing.mode is not None:
                found["forcing.mode"] = forcing.mode
        return found
