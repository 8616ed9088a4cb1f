"""A system as its SSD describes it, still nested: elements, connectors, connections, parameter bindings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vibroimpact.fmus.units import Unit
from vibroimpact.orchestrator.ssp.values import Binding


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector of a component or of a system."""

    name: str
    kind: str
    """`input`, `output`, `parameter`, ..."""
    unit: Unit | None = None
    """None where the SSD does not say."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection; which end gives the value follows from the kinds of its connectors."""

    start: tuple[str | None, str]
    end: tuple[str | None, str]
    """`start` and `end`: element (None: the system itself) and connector."""
    factor: float | None = None
    """Of its linear transformation, as the offset; None where there is none."""
    offset: float = 0.0
    suppressed: bool = False
    """Whether units are not converted."""
    gain_unit: str | None = None
    """The unit of its gain, as this package has noted it."""

    @property
    def where(self) -> str:
        """What messages call it."""
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
    """`fmu` and `fmi`: component of this package that it was exported of, and version; empty for any other."""
    is_gain: bool = False
    """Whether it stands for the gain of a connection."""
    gain_unit: str | None = None
    """The unit of that gain, where the scene has one."""


@dataclass(frozen=True, slots=True)
class System:
    """A system of components and systems."""

    name: str
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...] = ()
    elements: Mapping[str, Component | System] = field(default_factory=dict)
    connections: tuple[Connection, ...] = ()


@dataclass(frozen=True, slots=True)
class Structure:
    """All that an SSD says."""

    name: str
    system: System
    start_time: float | None = None
    stop_time: float | None = None
    """`start_time` and `stop_time` of its default experiment, s."""
    step: float | None = None
    """Step of its master, s, where an annotation says it."""
    tables: str = ""
    """TOML of the tables of a scene without words in SSP, as this package has noted them; may be empty."""
