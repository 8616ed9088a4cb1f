"""A system as its SSD describes it, still nested: elements, connectors, connections, parameter bindings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vibroimpact.fmus.units import Unit
from vibroimpact.orchestrator.importer.specification import RunAs
from vibroimpact.orchestrator.ssp.values import Binding, Transformation


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector of a component or of a system."""

    name: str
    kind: str
    """`input`, `output`, `parameter`, ..."""
    unit: Unit | None = None
    """None if the SSD gives no unit."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection; the kinds of its connectors decide which end gives the value."""

    start: tuple[str | None, str]
    end: tuple[str | None, str]
    """`start` and `end`: element (None: the system itself) and connector."""
    change: Transformation | None = None
    """Its transformation; None without one."""
    suppressed: bool = False
    """Whether units are not converted."""
    gain_unit: str | None = None
    """The unit of its gain, from this package's notes."""

    @property
    def where(self) -> str:
        """Its name in messages."""
        start, end = (".".join(filter(None, place))[:60] for place in (self.start, self.end))
        return f"connection {start} -> {end}"


@dataclass(frozen=True, slots=True)
class Component:
    """An FMU."""

    name: str
    source: str
    """The member of the archive."""
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...] = ()
    fmu: str = ""
    fmi: str = ""
    """`fmu` and `fmi`: the exported component of this package, and its version; empty for any other."""
    is_gain: bool = False
    """Whether it is the gain of a connection."""
    gain_unit: str | None = None
    """The unit of that gain, if the scene has one."""
    run_as: RunAs = "auto"


@dataclass(frozen=True, slots=True)
class DictionaryReference:
    """The signals of a dictionary in a system: all references to a dictionary have the same signals."""

    name: str
    dictionary: str
    connectors: Mapping[str, Connector]


@dataclass(frozen=True, slots=True)
class System:
    """A system of components and systems."""

    name: str
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...] = ()
    elements: Mapping[str, Component | System | DictionaryReference] = field(default_factory=dict)
    connections: tuple[Connection, ...] = ()
    dictionaries: Mapping[str, Mapping[str, Connector]] = field(default_factory=dict)
    """Signals of each signal dictionary of this system."""


@dataclass(frozen=True, slots=True)
class Structure:
    """The content of an SSD."""

    name: str
    system: System
    start_time: float | None = None
    stop_time: float | None = None
    """`start_time` and `stop_time` of its default experiment, s."""
    step: float | None = None
    """Step of its master, s, if an annotation gives one."""
    tables: str = ""
    """Tables of a scene without a form in SSP, as TOML, from this package's notes; may be empty."""
