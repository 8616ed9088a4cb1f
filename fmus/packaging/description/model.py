"""Content of a component's `variables.toml`, as plain frozen data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path

Number = float | int | bool


def plural(block: str) -> str:
    """Return the plural of a repeated block's name: `contacts`, `masses`."""
    return f"{block}es" if block.endswith("s") else f"{block}s"


#: Most names of knowns of an unknown that depends on an input. With more it has none, which means that it may depend on
#: all: a description then grows with its variables, not with their square.
MOST_KNOWNS = 128

#: FMI's default of `initial` for each (causality, variability); absent pairs have no default.
DEFAULT_INITIAL = {
    ("parameter", "fixed"): "exact",
    ("parameter", "tunable"): "exact",
    ("calculatedParameter", "fixed"): "calculated",
    ("calculatedParameter", "tunable"): "calculated",
    ("output", "constant"): "exact",
    ("output", "discrete"): "calculated",
    ("output", "continuous"): "calculated",
    ("local", "constant"): "exact",
    ("local", "fixed"): "calculated",
    ("local", "tunable"): "calculated",
    ("local", "discrete"): "calculated",
    ("local", "continuous"): "calculated",
    ("input", "discrete"): None,
    ("input", "continuous"): None,
    ("independent", "continuous"): None,
}


@dataclass(frozen=True, slots=True)
class UnitDefinition:
    """A unit by its SI exponents: value in base units = factor * value + offset."""

    name: str
    base: Mapping[str, int]
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class EnumerationItem:
    """One named value of an enumeration."""

    name: str
    value: int
    description: str = ""
    ports: str = ""


@dataclass(frozen=True, slots=True)
class Enumeration:
    """A named set of integer values, an FMI type definition."""

    name: str
    items: tuple[EnumerationItem, ...]
    description: str = ""


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of the FMU."""

    name: str
    description: str
    type: str
    causality: str
    variability: str
    initial: str | None
    """FMI's `initial`; None for inputs and the independent variable, which lack this attribute."""
    value_reference: int
    """Index into the C table of variables; the same in both FMI versions and in every export."""
    field: str
    """Member of the component's C struct that stores the variable."""
    code: str
    """Name of the value reference in C, without the component's prefix."""
    unit: str = ""
    enumeration: str = ""
    start: Number | None = None
    minimum: Number | None = None
    maximum: Number | None = None
    dimensions: tuple[int, ...] = ()
    dependencies: tuple[str, ...] | None = None
    """Inputs and parameters that an output depends on (None: maybe all); a description lists only the inputs."""
    versions: tuple[int, ...] = (2, 3)
    repeat: str = ""
    """Name of the block that the variable repeats in (`contact`), empty for a single variable."""
    repeat_index: int = 0
    """1-based index in that block, 0 for a single variable."""
    counts: str = ""
    """Name of the block whose number in use the variable holds (`mode`); an export starts it with that number."""
    ports: str = ""
    """User of the variable: this package's `importer`, an `external` tool that answers contacts; empty: everybody.
    `strobes` and `structural` are options of an export, without which no version of FMI has the variable."""
    derivative: str = ""
    """Name of the continuous state whose derivative the variable is, in model exchange."""
    event_indicator: bool = False
    """Whether a change of its sign marks an event, in model exchange."""
    clock: str = ""
    """Name of the clock at whose ticks alone the variable changes."""
    shown_name: str = ""
    shown_description: str = ""
    """`shown_name` and `shown_description` are for a reader: with the letter k in place of the index."""

    @property
    def count(self) -> int:
        """Number of scalars in the variable."""
        return prod(self.dimensions)

    @property
    def is_initial_unknown(self) -> bool:
        """Whether ModelStructure lists the variable among the unknowns of initialization."""
        calculated_output = (
            self.causality == "output" and self.initial in {"approx", "calculated"} and not self.clock
        )
        calculated = calculated_output or self.causality == "calculatedParameter"
        return calculated or bool(self.derivative) or self.type == "Clock"


@dataclass(frozen=True, slots=True)
class ComponentDescription:
    """One component: the source of its two model descriptions, its C header and its README table.

    Attributes
    ----------
    token : str
        Identifier of exactly this list of variables; instantiationToken of FMI 3.0, guid of FMI 2.0.
    partial_derivatives : bool
        Whether it gives derivatives of its outputs and state derivatives. A component that can be integrated does, also
        in an export that describes no states.
    growing : bool
        Whether modes may have negative stiffness or damping.
    repeats : mapping of str to int
        Number of copies of each repeated block, `{"contact": 2}`.
    start_of_export : mapping of str to float
        Start values, by variable name, for an export without start values of its own: its run shows motion.
    core : tuple of str
        Modules of the core in this component, `body/complaint`; empty: all of them.
    degree : int
        Highest degree of the polynomials in time that inputs are on a segment.
    """

    name: str
    folder: str
    struct: str
    header: str
    description: str
    event_mode: bool
    model_exchange: bool
    growing: bool
    token: str
    source: Path
    repeats: Mapping[str, int]
    units: tuple[UnitDefinition, ...]
    enumerations: tuple[Enumeration, ...]
    variables: tuple[Variable, ...]
    start_of_export: Mapping[str, Number]
    core: tuple[str, ...] = ()
    degree: int = 1
    partial_derivatives: bool = False

    @property
    def has_given_modes(self) -> bool:
        """Whether its modes are arrays of start values, which a lean description leaves to a file in the resources."""
        return any(v.dimensions and v.causality == "parameter" for v in self.variables)

    def uses(self, file: str) -> bool:
        """Return whether a file of the core, by its path there, belongs to the component."""
        return not self.core or file.removesuffix(".c").removesuffix(".h") in self.core

    def variables_of(self, version: int) -> tuple[Variable, ...]:
        """Return the variables that FMI 2.0 (`version=2`) or 3.0 (`version=3`) can express, in order."""
        return tuple(v for v in self.variables if version in v.versions)

    def derivatives(self) -> tuple[Variable, ...]:
        """Return the derivatives of the continuous states: those of displacements, then those of velocities."""
        names = {v.name for v in self.variables}
        found = [v for v in self.variables if v.derivative in names]
        shown = self._states_by_field()
        return tuple(sorted(found, key=lambda v: v.field not in shown))

    def _states_by_field(self) -> dict[str, str]:
        """Return the states by their place of storage; a velocity is stored where the displacement's derivative is."""
        states = {v.derivative for v in self.variables if v.derivative}
        return {v.field: v.name for v in self.variables if v.name in states}

    def states(self) -> tuple[str, ...]:
        """Return the names of the continuous states, in the order of `derivatives`."""
        return tuple(v.derivative for v in self.derivatives())

    def event_indicators(self) -> tuple[Variable, ...]:
        """Return the event indicators, in order."""
        return tuple(v for v in self.variables if v.event_indicator)

    def direct_knowns(self, variable: Variable, version: int) -> tuple[str, ...] | None:
        """Return the names of the inputs and states that an output or a derivative depends on directly.

        In FMI 3.0 tunable parameters of a body are knowns, too: they act where inputs do. None: maybe on all. A
        derivative with more than `MOST_KNOWNS` names has none.
        """
        inputs, shown = self.direct_inputs(variable, version), self._states_by_field()
        if variable.dependencies is None:
            return None
        if variable.variability != "continuous":
            return inputs
        tunable = self._tunable_parameters() if inputs and version == 3 and self.partial_derivatives else ()
        knowns = (shown[variable.field],) if variable.field in shown else (*inputs, *tunable, *self.states())
        return None if variable.derivative and len(knowns) > MOST_KNOWNS else knowns

    def _tunable_parameters(self) -> tuple[str, ...]:
        tunable = (v for v in self.variables if (v.causality, v.variability) == ("parameter", "tunable"))
        return tuple(v.name for v in tunable if v.type == "Float64" and not v.dimensions)

    def direct_inputs(self, variable: Variable, version: int) -> tuple[str, ...]:
        """Return the names of the inputs in an FMI version that an output depends on directly."""
        inputs = {v.name for v in self.variables_of(version) if v.causality == "input"}
        return tuple(name for name in variable.dependencies or () if name in inputs)

    def knowns_at_start(self, variable: Variable, version: int) -> tuple[str, ...] | None:
        """Return the names of the knowns that an unknown of initialization may depend on; None: maybe on all.

        These are its inputs and all start values, except those of other modes, masses or channels. An unknown that
        depends on no input does not depend on other contacts, and a mode on none. One that does, with more than
        `MOST_KNOWNS` names, has none.
        """
        if variable.dependencies is None:
            return None
        inputs = self.direct_inputs(variable, version)
        apart = {"mode", "mass", "channel"} | (set() if inputs else {"contact"})

        def may_matter(known: Variable) -> bool:
            if variable.repeat in apart and known.repeat == variable.repeat:
                return known.repeat_index == variable.repeat_index
            return bool(inputs) or (variable.repeat, known.repeat) != ("mode", "contact")

        kinds = ("parameter", "structuralParameter")
        starts = (v for v in self.variables_of(version) if v.causality in kinds and v.initial == "exact")
        knowns = (*inputs, *(v.name for v in starts if may_matter(v)))
        return None if inputs and len(knowns) > MOST_KNOWNS else knowns

    def with_repeats(self, repeats: Mapping[str, int]) -> ComponentDescription:
        """Return the component with fewer repeated blocks; the remaining value references do not change.

        The variable that counts a block starts with the new number, which is also its maximum.
        """
        counts = {**self.repeats, **repeats}
        kept = (v for v in self.variables if not v.repeat or v.repeat_index <= counts[v.repeat])
        counted = (
            replace(v, start=repeats[v.counts], maximum=repeats[v.counts]) if v.counts in repeats else v
            for v in kept
        )
        return replace(self, repeats=counts, variables=tuple(counted))
