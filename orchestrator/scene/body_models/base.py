"""What each kind of `[body]` answers: its modes, places, state, words and variables, and its FMU's parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import AMPLITUDE, Forcing, SceneTable, Stop

Stops = Sequence[Stop]

BODY_KINDS = Rule('"oscillator", "chain" or "beam"')


def of_amplitude(name: str, unit: str, doc: str, each: str = "") -> Rule:
    """Return the rule of a number by which motion follows its amplitude; an FMU that is not told of it saves it."""
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
DAMPING_RECIPROCAL = ("damping_reciprocal", "m", "damping ratio times amplitude that is added")


class BodyTable(SceneTable):
    """Base of `[body]`: a kind of body answers what its class would be asked for."""

    NAME: ClassVar[str]
    FMU: ClassVar[str]
    MOST_STOPS: ClassVar[int] = 8
    # whether it has more coordinates than its observed point
    IS_STRUCTURE: ClassVar[bool] = True
    # whether a stop meets a mass; on a beam it meets that of the modes, which falls as they grow in number
    HAS_MASSES: ClassVar[bool] = True
    # whether its state is that of its modes; what this has two numbers for, and how their variables begin
    KEEPS_MODES: ClassVar[bool] = True
    ELEMENT: ClassVar[str] = "mass"
    STATE: ClassVar[str] = ""
    # whether arrays of numbers become parameters with the bits of each number alone
    TAKES_ARRAYS: ClassVar[bool] = True
    # key of [[stop]] that says where on the body a stop is, and what to do about that of another body
    PLACE: ClassVar[str] = ""
    PLACE_HINT: ClassVar[str] = ""
    # which key says what the location of [sensor] would; whether a measuring chain has a place
    SENSOR_HINT: ClassVar[str] = ""
    CAN_BE_MEASURED: ClassVar[bool] = True
    # kinds of [forcing]; those with an amplitude for each mass; the keys of one kind alone
    FORCINGS: ClassVar[tuple[str, ...]] = ("force", "base_acceleration")
    AMPLITUDES: ClassVar[tuple[str, ...]] = ()
    FORCING_KEYS: ClassVar[Mapping[str, str]] = {}
    # whether its FMU knows that the base moves; else the base is a force on its masses
    KNOWS_BASE: ClassVar[bool] = False

    # ---- modes and masses ----

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of masses of an oscillator or a chain, of modes of a beam."""

    @property
    def finds_modes(self) -> bool:
        """Whether the number of modes is to be found."""
        return False

    @property
    def kept_modes(self) -> int:
        """Number of modes that are simulated; where it is to be found, the most that it may be."""
        return self.size

    @property
    def has_residual_vectors(self) -> bool:
        """Whether its last modes are what the modes beyond give way at its stops."""
        return False

    @property
    def projection(self) -> str:
        """How an impact changes its modes."""
        return "variational"

    # ---- places ----

    def place_of(self, stop: Stop) -> float:
        """Return where on the body a stop is: the mass (1-based) of a chain, the fraction of the length of a beam."""
        return 0.0

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> float:
        """Return the place whose displacement is recorded."""
        return 0.0

    @property
    def fixed_end(self) -> str:
        """Why a stop has to say where it is; empty where it has a place of its own."""
        return ""

    def fixed_point(self, location: float) -> tuple[str, str] | None:
        """Return which point is expected, and which one a location is, where it does not move."""
        return None

    @property
    def state_variables(self) -> tuple[str, ...]:
        """Outputs that are the whole state of a structure: displacements, then velocities; none of an oscillator."""
        numbers = range(1, self.size + 1)
        return tuple(f"{self.STATE}{name}[{i}]" for name in ("displacement", "velocity") for i in numbers)

    @property
    def start_names(self) -> tuple[str, ...]:
        """Parameters of its FMU that are its start state, in the order of the state."""
        return tuple(name.replace("[", "_start[") for name in self.state_variables)

    @property
    @abstractmethod
    def own_variables(self) -> tuple[str, ...]:
        """Names of a time series that no other kind of body has, or not so many."""

    # ---- parameters of the FMU ----

    @abstractmethod
    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return the real parameters of the FMU that are no fields, places of stops among them, by name, SI."""

    @abstractmethod
    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return the integer, enumeration and Boolean parameters of the FMU, by name; without laws and sides."""
