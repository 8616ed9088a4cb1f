"""The protocol of each kind of `[body]`: its modes, places, state and variables, and its FMU's parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.forcing_models import Forcing
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import AMPLITUDE, SceneTable, Stop

Stops = Sequence[Stop]

BODY_KINDS = Rule('"oscillator", "chain", "beam", "modes" or "matrices"')


def of_amplitude(name: str, unit: str, doc: str, each: str = "") -> Rule:
    """Return the rule of a number of amplitude-dependent motion; the FMU gets it only if the scene gives it."""
    hint = "It is of the amplitude of the motion; 0 is a mode that does not depend on it."
    variable = f"amplitude.{name}{each}"
    return Rule(unit=unit, hint=hint, fmu=variable, told_if_given=True, effect=AMPLITUDE, doc=doc)


FREQUENCY_SLOPE = (
    "frequency_slope",
    "1/m",
    "relative change of the natural frequency per metre of amplitude, see "
    "[below](#motion-that-depends-on-its-amplitude)",
)
DAMPING_SLOPE = ("damping_slope", "1/m", "change of the damping ratio per metre of amplitude")
DAMPING_RECIPROCAL = ("damping_reciprocal", "m", "its ratio to the amplitude is added to the damping ratio")


class NoPoint(NamedTuple):
    """The reason why a text names no point, in the words of a message."""

    expected: str
    hint: str = ""


class BodyTable(SceneTable):
    """Base of `[body]`: a kind of body has these properties, which replace questions about its class."""

    NAME: ClassVar[str]
    FMU: ClassVar[str]
    MOST_STOPS: ClassVar[int] = 8
    # whether the body has more coordinates than its observed point
    IS_STRUCTURE: ClassVar[bool] = True
    # whether a stop meets a mass; on a beam it meets the contact mass of the modes, which falls with their number
    HAS_MASSES: ClassVar[bool] = True
    # whether the state is the state of the modes; the element with two numbers in the state; prefix of its variables
    KEEPS_MODES: ClassVar[bool] = True
    ELEMENT: ClassVar[str] = "mass"
    STATE: ClassVar[str] = ""
    # variable with the lowest natural frequency of a structure, which may be the first of an array
    SLOWEST: ClassVar[str] = "natural_angular_frequency[1]"
    # whether arrays of numbers give the same bits of parameters as single numbers
    TAKES_ARRAYS: ClassVar[bool] = True
    # key of [[stop]] for its place on the body, and a hint for the key of another body
    PLACE: ClassVar[str] = ""
    PLACE_HINT: ClassVar[str] = ""
    # hint for the key in place of sensor.location; whether a measuring chain is possible
    SENSOR_HINT: ClassVar[str] = ""
    CAN_BE_MEASURED: ClassVar[bool] = True
    # kinds of [forcing]; kinds with an amplitude for each mass; keys that belong to one kind
    FORCINGS: ClassVar[tuple[str, ...]] = ("force", "base_acceleration")
    AMPLITUDES: ClassVar[tuple[str, ...]] = ()
    FORCING_KEYS: ClassVar[Mapping[str, str]] = {}
    # whether the FMU has a moving base; without it, the base acts as a force on the masses
    KNOWS_BASE: ClassVar[bool] = False

    # ---- modes and masses ----

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of masses of an oscillator or a chain, or of modes of a beam."""

    @property
    def finds_modes(self) -> bool:
        """Whether the number of modes must still be found (`modes = "auto"`)."""
        return False

    @property
    def kept_modes(self) -> int:
        """Number of simulated modes; the largest possible number for `modes = "auto"`."""
        return self.size

    @property
    def has_residual_vectors(self) -> bool:
        """Whether the last modes are residual vectors: the static flexibility of left-out modes at the stops."""
        return False

    @property
    def is_coupled(self) -> bool:
        """Whether the FMU gets a damping that couples the modes, in place of damping ratios."""
        return False

    @property
    def projection(self) -> str:
        """Projection by which an impact changes the modes."""
        return "variational"

    # ---- places ----

    def place_of(self, stop: Stop) -> float:
        """Return the place of a stop: the mass (1-based) of a chain, or the fraction of the length of a beam."""
        return 0.0

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> float:
        """Return the place of the recorded displacement."""
        return 0.0

    def place_named(self, rest: str, name: str) -> float | NoPoint:
        """Return the mass (1-based), or the fraction of the length, of a point `name.rest` of this body."""
        return self.size if rest in ("", "mass") else NoPoint(f'"{name}" or "{name}.mass"')

    @property
    def fixed_end(self) -> str:
        """Reason why a stop must have a location; empty where it has a default place."""
        return ""

    def fixed_point(self, location: float) -> tuple[str, str] | None:
        """Return the expected kind of point, and the name of the point at a fixed location; None if it moves."""
        return None

    @property
    def state_variables(self) -> tuple[str, ...]:
        """Outputs with the whole state of a structure: displacements, then velocities; none for an oscillator."""
        numbers = range(1, self.size + 1)
        return tuple(f"{self.STATE}{name}[{i}]" for name in ("displacement", "velocity") for i in numbers)

    @property
    def start_names(self) -> tuple[str, ...]:
        """Parameters of the FMU with the start state, in the order of the state."""
        return tuple(name.replace("[", "_start[") for name in self.state_variables)

    @property
    @abstractmethod
    def own_variables(self) -> tuple[str, ...]:
        """Variables of a time series that only this kind of body has, or has in this number."""

    def is_shaping(self, key: str) -> bool:
        """Return whether a number of a key changes the modes of the body, or its rows over them."""
        return key.startswith(("body", "link"))

    def weights_of(self, name: str) -> dict[str, float]:
        """Return the weights of variables of the FMU whose sum is a sampled variable; none for the FMU's own."""
        return {}

    # ---- parameters of the FMU ----

    @abstractmethod
    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return the real parameters of the FMU that are not fields, including places of stops, by name, SI."""

    @abstractmethod
    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return the integer, enumeration and Boolean parameters of the FMU by name, without laws and sides."""
