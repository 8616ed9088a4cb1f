"""`[body]` of a chain of masses."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from vibroimpact.orchestrator.scene.body_models.base import BODY_KINDS, BodyTable, NoPoint, Stops
from vibroimpact.orchestrator.scene.fields import Rule, named_numbers
from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import (
    DAMPING,
    MOST_MODES,
    ModeCount,
    ModeNumber,
    NotNegative,
    NotNegativeNumbers,
    PositiveArray,
    StartArray,
    Stop,
)
from vibroimpact.orchestrator.scene.sampled_names import each_of

if TYPE_CHECKING:
    from vibroimpact.fmus.bodies.assembly import Part

_MASS = re.compile(r"(?:mass\[)?([1-9][0-9]?)(\])?")
_ARRAY_OR_ONE = "an array of numbers >= 0, or one number for all"
_SPRING_HINT = "Element i lies between mass i - 1 (the ground for i = 1) and mass i."
_FREE_END = "Use 0 for a free far end."


class ChainBody(BodyTable):
    """`[body]`: a chain of masses, each joined to the mass before by a spring and a dashpot."""

    NAME: ClassVar[str] = "a chain"
    FMU: ClassVar[str] = "Chain"
    KEEPS_MODES: ClassVar[bool] = False
    PLACE: ClassVar[str] = "mass"
    PLACE_HINT: ClassVar[str] = "Say which mass by mass."
    SENSOR_HINT: ClassVar[str] = "; observed_mass in [body] says which mass"
    CAN_BE_MEASURED: ClassVar[bool] = False
    AMPLITUDES: ClassVar[tuple[str, ...]] = ("force",)

    kind: Annotated[Literal["chain"], BODY_KINDS]
    masses: Annotated[
        PositiveArray,
        Rule(
            f"an array of 1 to {MOST_MODES} numbers > 0",
            unit="kg",
            hint="One for each mass.",
            fmu="mass[i]",
            doc=f"1 to {MOST_MODES} of them",
        ),
    ]
    stiffnesses: Annotated[
        NotNegativeNumbers,
        Rule(
            _ARRAY_OR_ONE,
            unit="N/m",
            hint=_SPRING_HINT,
            fmu="stiffness[i]",
            doc="one for each mass, or one for all",
        ),
    ]
    dampings: Annotated[
        NotNegativeNumbers,
        Rule(
            _ARRAY_OR_ONE,
            unit="N s/m",
            hint=_SPRING_HINT,
            fmu="damping[i]",
            effect=DAMPING,
            doc="one for each mass, or one for all",
        ),
    ] = 0.0
    far_stiffness: Annotated[
        NotNegative,
        Rule(
            unit="N/m",
            hint=_FREE_END,
            fmu="far_stiffness",
            doc="a spring between the last mass and the ground behind it",
        ),
    ] = 0.0
    far_damping: Annotated[
        NotNegative,
        Rule(unit="N s/m", hint=_FREE_END, fmu="far_damping", effect=DAMPING, doc="a dashpot beside it"),
    ] = 0.0
    modes: Annotated[
        ModeCount | None,
        Rule(
            f'a whole number from 1 to {MOST_MODES}, or "auto"',
            sweepable=True,
            hint="The slowest ones are simulated.",
            doc='1 to the number of masses: the slowest modes; `"auto"`: the fewest that meet `execution.tolerance`, '
            "see [below](#how-many-modes)",
            default="all",
        ),
    ] = None
    observed_mass: Annotated[
        ModeNumber | None,
        Rule(
            hint="Masses count from 1.",
            doc="the mass whose displacement and velocity are recorded",
            default="the mass of `stop[1]`; without a stop the last",
        ),
    ] = None
    displacement_start: Annotated[
        StartArray,
        Rule(
            unit="m",
            hint="One for each mass.",
            fmu="displacement_start[i]",
            doc="one for each mass; not beyond a rigid stop",
            default="0",
        ),
    ] = ()
    velocity_start: Annotated[
        StartArray, Rule(unit="m/s", hint="One for each mass.", fmu="velocity_start[i]", default="0")
    ] = ()

    @property
    def size(self) -> int:
        """Number of masses."""
        return len(self.masses)

    @property
    def finds_modes(self) -> bool:
        """Whether the number of modes must still be found (`modes = "auto"`)."""
        return self.modes == "auto"

    @property
    def kept_modes(self) -> int:
        """Number of simulated modes: as given, or all modes."""
        return self.size if self.modes is None or self.modes == "auto" else self.modes

    def place_of(self, stop: Stop) -> int:
        """Return the mass (1-based) of a stop: as given, or the last."""
        return stop.mass or self.size

    def place_named(self, rest: str, name: str) -> float | NoPoint:
        """Return the mass (1-based), which is the last without a number: see `BodyTable`."""
        if rest == "":
            return self.size
        mass = _MASS.fullmatch(rest)
        is_whole = mass is not None and rest.startswith("mass[") == (mass[2] is not None)
        if mass is None or not is_whole or int(mass[1]) > self.size:
            return NoPoint(
                f'"{name}" for the last mass, or "{name}.1" to "{name}.{self.size}"', "Masses count from 1."
            )
        return int(mass[1])

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> int:
        """Return the mass (1-based) of the recorded displacement: as given, the mass of stop[1], or the last."""
        return self.observed_mass or (self.place_of(stops[0]) if stops else self.size)

    @property
    def own_variables(self) -> tuple[str, ...]:
        """The motion of each mass, and the energy of each mode."""
        names = "displacement", "velocity", "acceleration", "modal_energy"
        return tuple(one for name in names for one in each_of(name, self.size))

    def as_part(self) -> Part:
        """Return this body as a part of an assembly."""
        from vibroimpact.fmus.bodies.assembly import MassesPart

        numbers = named_numbers(self, self.size)
        rows = [
            [numbers[name] for name in each_of(name, self.size)]
            for name in ("mass", "stiffness", "damping", "displacement_start", "velocity_start")
        ]
        rows[1].append(self.far_stiffness)
        rows[2].append(self.far_damping)
        return MassesPart(*rows)

    def load_of(self, force: Force) -> tuple[float, ...]:
        """Return the force on each mass under a force: its amplitudes, or 1 for a force with one amplitude."""
        return force.amplitude if isinstance(force.amplitude, tuple) else (1.0,) * self.size

    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return the amplitude of the force on each mass, N."""
        if forcing is None:
            return {}
        given = forcing.amplitude
        if forcing.kind == "base_acceleration":
            # the acceleration of the base is an inertial force on each relative coordinate
            forces = tuple(-mass * forcing.scalar_amplitude for mass in self.masses)
        elif isinstance(given, tuple):
            forces = given + (0.0,) * (self.size - len(given))
        else:
            forces = (given,) * self.size
        return dict(zip(each_of("forcing.amplitude", self.size), forces, strict=False))

    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return the numbers of masses and modes (0 for all modes), the observed mass, and the masses of stops."""
        modes = 0 if self.modes is None else self.modes
        assert modes != "auto"  # refused before
        hit = {f"contact[{k}].mass_number": self.place_of(stop) for k, stop in enumerate(stops, start=1)}
        return {"masses": self.size, "modes": modes, "observed_mass": self.observed_place(stops, None), **hit}
