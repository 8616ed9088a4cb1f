"""A system as its SSD describes it, still nested: elements, connectors, connections, parameter bindings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vibroimpact.fmus.units import Unit
from vibroimpact.orchestrator.ssp.values import Binding


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector of a component or of a system.

    Attributes
    ----------
    kind : str
        `input`, `output`, `parameter`, ...
    unit : Unit or None
        None where the SSD does not say.
    """

    name: str
    kind: str
    unit: Unit | None = None


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection; which end gives the value follows from the kinds of its connectors.

    Attributes
    ----------
    start, end : tuple of (str or None, str)
        Element and connector; None for a connector of the system itself.
    factor, offset : float or None
        Its linear transformation, None where there is none.
    suppressed : bool
        Whether units are not converted.
    gain_unit : str or None
        The unit of its gain, as this package has noted it.
    """

    start: tuple[str | None, str]
    end: tuple[str | None, str]
    factor: float | None = None
    offset: float = 0.0
    suppressed: bool = False
    gain_unit: str | None = None

    @property
    def where(self) -> str:
        """What messages call it."""
        start, end = (".".join(filter(None, place))[:60] for place in (self.start, self.end))
        return f"connection {start} -> {end}"


@dataclass(frozen=True, slots=True)
class Component:
    """An FMU.

    Attributes
    ----------
    source : str
        The member of the archive.
    fmu, fmi : str
        The component of this package that it was exported of, and its version of FMI; empty for any other.
    is_gain : bool
        Whether it stands for the gain of a connection.
    gain_unit : str or None
        The unit of that gain, where the scene has one.
    """

    name: str
    source: str
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...] = ()
    fmu: str = ""
    fmi: str = ""
    is_gain: bool = False
    gain_unit: str | None = None


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
    """All that an SSD says.

    Attributes
    ----------
    start_time, stop_time : float or None
        Of its default experiment, s.
    step : float or None
        Step of its master, s, where an annotation says it.
    tables : str
        TOML text of the tables of a scene that SSP has no words for, as this package has noted them; may be empty.
    """

    name: str
    system: System
    start_time: float | None = None
    stop_time: float | None = None
    step: float | None = None
    tables: str = ""
