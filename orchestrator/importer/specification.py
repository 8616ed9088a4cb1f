"""The parts of an importer: components, connections, watched events. Scenes expand to these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from vibroimpact.fmus.shipped import package_folder
from vibroimpact.orchestrator.remote.address import FmuServer

Crossing = Literal["falling", "rising", "either"]
Exchange = Literal["jacobi", "gauss_seidel", "iterated"]
Side = Literal["upper", "lower"]
#: Relative error of a communication step whose size an error estimate chooses.
COUPLING_TOLERANCE = 1e-6
RunAs = Literal["auto", "model_exchange", "co_simulation"]
StartValue = float | int | bool | str | tuple[float | int | bool | str, ...]
"""A start value; an array has its elements in a row, the last dimension fastest."""
PairLaw = Literal["restitution", "kelvin_voigt", "hertz", "hunt_crossley"]
#: Numbers of each law of a pair, besides the clearance.
PAIR_NUMBERS: Mapping[PairLaw, tuple[str, ...]] = {
    "restitution": ("restitution",),
    "kelvin_voigt": ("stiffness", "damping"),
    "hertz": ("stiffness",),
    "hunt_crossley": ("stiffness", "damping", "exponent"),
}


@dataclass(frozen=True, slots=True)
class ComponentSpec:
    """One component.

    Attributes
    ----------
    name : str
        Its name in the scene.
    fmu : Path
        Its FMU file.
    parameters : mapping of str to number, bool, str, or tuple of them
        Start values by variable name; enumerations by number or by item name. An array has a tuple of its elements,
        the last dimension fastest.
    tolerance : float or None
        Relative tolerance of the solver: inside the FMU, or of CVODE in model exchange; None: the FMU's own.
    run_as : str
        The kind of FMU that runs: `model_exchange`, `co_simulation`, or `auto`: co-simulation where the FMU has it.
    server : FmuServer or None
        The server where it runs; `fmu` has its description alone. None: it runs in this process.
    """

    name: str
    fmu: Path
    parameters: Mapping[str, StartValue] = field(default_factory=dict)
    tolerance: float | None = None
    run_as: RunAs = "auto"
    server: FmuServer | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        package = package_folder()
        if self.fmu.is_relative_to(package):
            # Another machine may have the package elsewhere.
            return _shipped, (
                self.name,
                self.fmu.relative_to(package),
                self.parameters,
                self.tolerance,
                self.run_as,
            )
        return ComponentSpec, (
            self.name,
            self.fmu,
            self.parameters,
            self.tolerance,
            self.run_as,
            self.server,
        )


def _shipped(name: str, place: Path, *rest: Any) -> ComponentSpec:
    return ComponentSpec(name, package_folder() / place, *rest)


@dataclass(frozen=True, slots=True)
class ConnectionSpec:
    """An output that feeds an input, times a gain, plus an offset.

    Attributes
    ----------
    source, target : tuple of str
        Component and variable.
    gain : float
        The input is gain * output + offset.
    gain_unit : str or None
        Unit of the gain; None: dimensionless.
    offset : float
        Added after the gain, in the unit of the input.
    mapping : tuple of pairs of int
        Values of the output, each with the value that the input takes: of whole numbers, items and truth values (0 and
        1). Empty: values are passed on as they are.
    """

    source: tuple[str, str]
    target: tuple[str, str]
    gain: float = 1.0
    gain_unit: str | None = None
    offset: float = 0.0
    mapping: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class EventSpec:
    """A crossing of `level` by a variable of a component that has states but no events of its own."""

    component: str
    variable: str
    direction: Crossing = "falling"
    level: float = 0.0


@dataclass(frozen=True, slots=True)
class StopContactSpec:
    """A body of any tool that meets a stop: a yielding stop, or an ImpactStop with restitution.

    Attributes
    ----------
    body, stop : str
        The two components.
    displacement, velocity, force : str
        Variables of the body: the motion of the contact point, and the force input that acts on it. Force is None
        for a body in model exchange whose velocity is a state; its stop is rigid.
    mass : float or None
        Effective mass of the contact point, kg; None: a trial step finds it.
    stop_displacement, stop_force : str
        Variables of the stop: the input of the displacement, and the output of its force, which presses the body away
        and is >= 0.
    stop_velocity : str or None
        The input of the velocity; None: the stop takes no velocity.
    side : {"upper", "lower"} or None
        The side of the motion on which the stop is; None: its parameter `side` gives it.
    """

    body: str
    displacement: str
    velocity: str
    force: str | None
    stop: str
    mass: float | None = None
    stop_displacement: str = "displacement"
    stop_velocity: str | None = "velocity"
    stop_force: str = "applied_force"
    side: Side | None = None

    @property
    def numbers(self) -> dict[str, float]:
        """The given numbers, by name."""
        return {} if self.mass is None else {"mass": self.mass}

    @property
    def name(self) -> str:
        """The name of its force, `stop.output -> body.input`."""
        return f"{self.stop}.{self.stop_force} -> {self.body}.{self.force or self.velocity}"

    @property
    def connections(self) -> tuple[ConnectionSpec, ...]:
        """The connections that carry the motion of the body to the stop."""
        inputs = {self.displacement: self.stop_displacement, self.velocity: self.stop_velocity}
        return tuple(
            ConnectionSpec((self.body, output), (self.stop, name)) for output, name in inputs.items() if name
        )


@dataclass(frozen=True, slots=True)
class BodyPoint:
    """A point of a body of any tool that another body may hit.

    Attributes
    ----------
    component : str
        The body.
    displacement, velocity, force : str
        Its variables: the motion of the point, and the input of the force on it (None: see `StopContactSpec`).
    mass : float or None
        Effective mass of the point, kg: change of momentum over change of velocity. None: the states of a body in
        model exchange give it, for rigid impacts.
    """

    component: str
    displacement: str
    velocity: str
    force: str | None
    mass: float | None

    @property
    def name(self) -> str:
        """The variable of its displacement, `body.x`."""
        return f"{self.component}.{self.displacement}"


@dataclass(frozen=True, slots=True)
class PairSpec:
    """Two bodies that hit each other.

    Attributes
    ----------
    lower, upper : tuple of str, or BodyPoint
        Each body of ours by component and contact port (`contact[k]`, of the law `pair`), or a point of a body of any
        tool. Their gap is `clearance + displacement of upper - displacement of lower`.
    clearance : float
        Gap where both displacements are 0, m.
    law : str
        `restitution`, or a yielding law: `kelvin_voigt`, `hertz`, `hunt_crossley`.
    restitution : float
        Coefficient of restitution, 0 to 1.
    stiffness, damping, exponent : float
        Numbers of a yielding law, as of a contact port.
    """

    lower: tuple[str, str] | BodyPoint
    upper: tuple[str, str] | BodyPoint
    clearance: float = 0.0
    law: PairLaw = "restitution"
    restitution: float = 1.0
    stiffness: float = 0.0
    damping: float = 0.0
    exponent: float = 1.5

    @property
    def name(self) -> str:
        """Names of both points, the lower point first."""
        lower, upper = (p.name if isinstance(p, BodyPoint) else ".".join(p) for p in (self.lower, self.upper))
        return f"{lower} - {upper}"

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of its law, by name."""
        return {name: getattr(self, name) for name in (*PAIR_NUMBERS[self.law], "clearance")}
