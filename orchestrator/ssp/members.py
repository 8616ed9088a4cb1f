"""The FMUs in an archive: this package's own, as other tools take them, and foreign ones as they are."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.packaging.build import read_components
from vibroimpact.fmus.packaging.cross import Note
from vibroimpact.fmus.packaging.description import ComponentDescription, UnitDefinition
from vibroimpact.fmus.packaging.export import LEAN_COUNTS, export_fmu
from vibroimpact.fmus.shipped import FOLDERS, package_folder
from vibroimpact.fmus.units import parse_unit
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.component_facts import (
    ComponentFacts,
    StartValue,
    component_facts,
)
from vibroimpact.orchestrator.ssp.names import GAIN

FMI_OF_GAINS = "2.0"
"""Version of each Gain. OMSimulator reads no initial unknowns of FMI 3.0, so a circle of connections is an algebraic
loop for it at the start. With a component of FMI 2.0 in the circle, it solves the loop by differences."""


@dataclass(frozen=True, slots=True)
class Part:
    """A component in the archive."""

    name: str
    """Its name in the scene."""
    member: str
    """The archive member of its FMU."""
    content: bytes
    """The FMU."""
    facts: ComponentFacts
    """Facts from the description of the FMU in the archive."""
    values: Mapping[str, StartValue]
    """Start values."""
    fmu: str = ""
    fmi: str = ""
    """`fmu` and `fmi`: component of this package, and version that the scene runs; empty for any other."""
    gain_of: ConnectionSpec | None = None
    """The connection whose gain this component is."""

    @property
    def values_member(self) -> str:
        """The member with its start values."""
        return f"resources/{self.name}.ssv"


@dataclass(frozen=True, slots=True)
class Travel:
    """Settings of the FMUs in an archive; platform and note as in `vibroimpact.fmus.export`."""

    folder: Path
    """Folder for exported FMUs."""
    fmi: str | None
    """Version of this package's own FMUs; None: as in the scene."""
    stop_time: float
    """End of a run, s."""
    gains: bool = False
    """Whether gains are components of their own."""
    platform: str | None = None
    note: Note = lambda _: None


def component_members(scene: Scene, travel: Travel) -> dict[str, Part]:
    """Return the archived components of a scene, by name; gains come last."""
    described = {component.name: component for component in read_components()}
    taken: dict[str, str] = {}
    parts = {}
    for spec in scene.components:
        if spec.server is not None:
            raise SceneError(
                [
                    f"{scene.source}: component.{spec.name}.fmu: expected an FMU file to copy, got one of a server."
                ]
            )
        values = {name: value for name, value in spec.parameters.items() if not isinstance(value, tuple)}
        _refuse_arrays(scene, spec, next((name for name in spec.parameters if name not in values), None))
        own, file = _own(spec.fmu), spec.fmu
        if own is not None:
            file = _exported(described[own[0]], spec, _used(scene, spec), travel.fmi or own[1], travel)
        content = file.read_bytes()
        parts[spec.name] = Part(
            spec.name,
            _member(file.name, content, taken),
            content,
            component_facts(file, spec.run_as),
            values,
            *(own or ("", "")),
        )
    if not travel.gains:
        return parts
    for number, connection in enumerate(scene.connections, start=1):
        if connection.gain != 1.0 or connection.gain_unit is not None:
            gain = _gain(connection, _free_name(f"gain_{number}", parts), parts, taken, travel)
            parts[gain.name] = gain
    return parts


def _refuse_arrays(scene: Scene, spec: ComponentSpec, name: str | None) -> None:
    """Raise UsageError for a start value that is an array."""
    if name is not None:
        raise UsageError(
            f"{scene.source}: component.{spec.name}.parameters.{name}: expected a single value in a system (SSP), "
            "got an array. Let the FMU keep its own start value."
        )


def _gain(
    connection: ConnectionSpec,
    name: str,
    parts: Mapping[str, Part],
    taken: dict[str, str],
    travel: Travel,
) -> Part:
    """Return the gain of a connection as a component with the units of its ends."""
    source, target = (
        parts[component].facts.variables[variable]
        for component, variable in (connection.source, connection.target)
    )
    units = {
        end: UnitDefinition(
            variable.unit_name, variable.unit.exponents, variable.unit.factor, variable.unit.offset
        )
        for end, variable in (("input", source), ("output", target))
        if variable.unit is not None
    }
    unit = parse_unit(connection.gain_unit) if connection.gain_unit else None
    if unit is not None and connection.gain_unit:
        units["gain"] = UnitDefinition(connection.gain_unit, unit.exponents, unit.factor)
    file = export_fmu(
        GAIN,
        travel.folder / f"{name}.fmu",
        fmi=FMI_OF_GAINS,
        starts={"gain": connection.gain},
        stop_time=travel.stop_time,
        platform=travel.platform,
        units=units,
        note=travel.note,
    )
    content = file.read_bytes()
    return Part(
        name,
        _member(file.name, content, taken),
        content,
        component_facts(file),
        {"gain": connection.gain},
        gain_of=connection,
    )


def _free_name(name: str, parts: Mapping[str, Part]) -> str:
    while name in parts:
        name += "_"
    return name


def _own(fmu: Path) -> tuple[str, str] | None:
    """Return name and version of a component of the package; None for a foreign file."""
    versions = {folder: version for version, folder in FOLDERS.items()}
    own = fmu.is_relative_to(package_folder()) and fmu.parent.name in versions
    return (fmu.stem, versions[fmu.parent.name]) if own else None


def _used(scene: Scene, spec: ComponentSpec) -> set[str]:
    """Return the variables of a component that the system uses."""
    ends = (end for connection in scene.connections for end in (connection.source, connection.target))
    return {variable for component, variable in ends if component == spec.name} | set(spec.parameters)


def _exported(
    component: ComponentDescription,
    spec: ComponentSpec,
    used: set[str],
    fmi: str,
    travel: Travel,
) -> Path:
    """Export a component with only the parts that the system uses; it starts as in the scene."""
    ports = set(_ports(component, spec, used))
    # an export without motion would start with a default displacement
    still = {v.name: v.start for v in component.variables if v.name in component.start_of_export}
    starts = {name: value for name, value in still.items() if value is not None} | dict(spec.parameters)
    counts = {} if "importer" in ports else _counts(component, used)
    return export_fmu(
        component.name,
        travel.folder / f"{spec.name}.fmu",
        contacts=counts.get("contact"),
        sensors=counts.get("sensor"),
        fmi=fmi,
        starts={name: value for name, value in starts.items() if isinstance(value, int | float)},
        full="importer" in ports,
        external="external" in ports,
        model_exchange=not used.isdisjoint(component.states()),
        stop_time=travel.stop_time,
        platform=travel.platform,
        note=travel.note,
    )


def _ports(component: ComponentDescription, spec: ComponentSpec, used: set[str]) -> Iterator[str]:
    items = {e.name: {item.value: item.ports for item in e.items} for e in component.enumerations}
    for variable in component.variables:
        if variable.name in used:
            yield "importer" if variable.dimensions else variable.ports
            if variable.enumeration:
                value = spec.parameters.get(variable.name)
                yield next(
                    (ports for item, ports in items[variable.enumeration].items() if item == value), ""
                )


def _counts(component: ComponentDescription, used: set[str]) -> dict[str, int]:
    """Return the numbers of contacts and sensors in use, at least those of a lean description."""
    counts = {
        block: min(count, component.repeats[block])
        for block, count in LEAN_COUNTS.items()
        if block in component.repeats
    }
    for variable in component.variables:
        if variable.name in used and variable.repeat in counts:
            counts[variable.repeat] = max(counts[variable.repeat], variable.repeat_index)
    return counts


def _member(name: str, content: bytes, taken: dict[str, str]) -> str:
    """Return the member for a file: one for equal contents, distinct ones otherwise, also without regard to case."""
    digest = hashlib.sha256(content).hexdigest()
    stem = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in Path(name).stem)[:100]
    stem = stem.lstrip(".") or "fmu"
    member, count = f"resources/{stem}.fmu", 1
    while taken.setdefault(member.lower(), digest) != digest:
        count += 1
        member = f"resources/{stem}_{count}.fmu"
    return member
