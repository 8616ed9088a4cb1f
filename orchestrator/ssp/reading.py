"""Reads the XML of an SSD as a `Structure`; parts that this package cannot run are refused by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

from vibroimpact.fmus.units import Unit
from vibroimpact.orchestrator.importer.specification import RunAs
from vibroimpact.orchestrator.scene.fields import listed
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.archive import SspArchive
from vibroimpact.orchestrator.ssp.names import (
    ANNOTATION,
    BOTH,
    DEFINITION_TYPE,
    DICTIONARY_TYPE,
    FMU_TYPE,
    MAPPING_TYPE,
    OSP_ANNOTATION,
    PACKAGE_TYPE,
    PARAMETER_SET_TYPE,
    SSD_FILE,
    tag,
)
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.structure import (
    Component,
    Connection,
    Connector,
    DictionaryReference,
    Structure,
    System,
)
from vibroimpact.orchestrator.ssp.values import (
    Binding,
    Mapped,
    Parameter,
    Units,
    binding,
    expect,
    number,
    read_mapping,
    read_parameter_set,
    read_transformation,
    read_units,
    refuse_version,
    truth,
)

_TABLES = tag("vibroimpact:Tables")
DEEPEST = 50
"""Most levels of nested systems."""
MOST_INNER = 200
"""Most components that are systems: an archive may name one of its descriptions many times."""


KINDS_OF: dict[str, RunAs] = {"any": "auto", "CoSimulation": "auto", "ModelExchange": "model_exchange"}
"""The kind that runs, by the implementation of a component; co-simulation is taken where the FMU has it."""


def read_structure(archive: SspArchive) -> Structure:
    """Read the default SSD of an archive.

    RefusalError: it is no SSD, or has parts that this package cannot run. ComponentFileError: an XML file is damaged
    or unsafe.
    """
    root, top = _described(archive, SSD_FILE)
    reader = _Reader(archive, read_units(root, SSD_FILE), _notes(root), iter(range(MOST_INNER)))
    experiment = root.find(tag("ssd:DefaultExperiment"))
    return Structure(
        name=root.get("name", ""),
        system=reader.system(top, 1),
        start_time=_time(experiment, "startTime"),
        stop_time=_time(experiment, "stopTime"),
        step=_step(experiment, root),
        tables="".join(element.text or "" for note in _noted(root) for element in note.iterfind(_TABLES)),
    )


@dataclass(frozen=True, slots=True)
class _Reader:
    archive: SspArchive
    units: Units
    notes: Mapping[tuple[str, str], Element]
    left: Iterator[int]
    """One item for each further component that may be a system."""
    prefix: str = ""
    """Archive in the outermost archive, with a slash."""
    folder: str = ""
    """Folder of the description in its archive."""

    def system(self, element: Element, depth: int) -> System:
        where = f"{SSD_FILE}: {element.get('name', '')[:60]}"
        if depth > DEEPEST:
            raise RefusalError(where, f"at most {DEEPEST} systems in each other", "more")
        inner = element.find(tag("ssd:Elements"))
        return System(
            element.get("name", ""),
            self._connectors(element, where),
            self._bindings(element, where),
            self._elements(() if inner is None else tuple(inner), where, depth),
            tuple(
                self._connection(connection, depth)
                for connection in element.iterfind(f"{tag('ssd:Connections')}/{tag('ssd:Connection')}")
            ),
            self._dictionaries(element, where),
        )

    def _dictionaries(self, element: Element, where: str) -> dict[str, dict[str, Connector]]:
        found: dict[str, dict[str, Connector]] = {}
        for one in element.iterfind(f"{tag('ssd:SignalDictionaries')}/{tag('ssd:SignalDictionary')}"):
            name = one.get("name", "")
            if not name or name in found:
                raise RefusalError(where, "a name of its own for each signal dictionary", quoted(name))
            found[name] = self._signals(one, f"{where}: signal dictionary {name[:60]}")
        return found

    def _signals(self, element: Element, where: str) -> dict[str, Connector]:
        """Return the entries of a signal dictionary, from its file or inline."""
        kind, source = element.get("type", DICTIONARY_TYPE), element.get("source")
        if kind != DICTIONARY_TYPE:
            raise RefusalError(f"{where}: type", DICTIONARY_TYPE, quoted(kind))
        root = element.find(tag("ssb:SignalDictionary"))
        if source:
            where = self._member(source, where)
            root = self.archive.xml(where)
        if root is None:
            raise RefusalError(where, "a source or entries", "neither")
        expect(root, "ssb:SignalDictionary", where)
        refuse_version(root, where)
        known = replace(self, units={**self.units, **read_units(root, where)})
        signals: dict[str, Connector] = {}
        for entry in root.iterfind(tag("ssb:DictionaryEntry")):
            name = entry.get("name", "")
            if not name or name in signals:
                raise RefusalError(where, "a name of its own for each entry", quoted(name))
            signals[name] = Connector(name, BOTH, known._unit(entry))
        return signals

    def _elements(
        self, elements: tuple[Element, ...], where: str, depth: int
    ) -> Mapping[str, Component | System | DictionaryReference]:
        found: dict[str, Component | System | DictionaryReference] = {}
        for element in elements:
            name = element.get("name", "")
            if not name or name in found:
                raise RefusalError(where, "a name of its own for each element", quoted(name))
            if element.tag == tag("ssd:Component"):
                inner = element.get("type") in (PACKAGE_TYPE, DEFINITION_TYPE)
                found[name] = (self._inner if inner else self._component)(element, name, depth)
            elif element.tag == tag("ssd:System"):
                found[name] = self.system(element, depth + 1)
            elif element.tag == tag("ssd:SignalDictionaryReference"):
                signals = self._connectors(element, f"{SSD_FILE}: {name[:60]}")
                found[name] = DictionaryReference(name, element.get("dictionary", ""), signals)
            else:
                kind = element.tag.rpartition("}")[2][:60]
                raise RefusalError(f"{SSD_FILE}: {name[:60]}", "a component or a system", kind)
        return found

    def _inner(self, element: Element, name: str, depth: int) -> System:
        """Read a component that is a system: its own connectors and parameters go before those of its description."""
        where = f"{SSD_FILE}: {name[:60]}"
        if depth >= DEEPEST or next(self.left, None) is None:
            expected = (
                f"at most {DEEPEST} systems in each other, and {MOST_INNER} components that are systems"
            )
            raise RefusalError(where, expected, "more")
        member = self._member(element.get("source", ""), f"{where}: source")
        packed = element.get("type") == PACKAGE_TYPE
        archive = self.archive.inner(member) if packed else self.archive
        file = SSD_FILE if packed else member
        try:
            root, top = _described(archive, file)
            prefix = f"{self.prefix}{member}/" if packed else self.prefix
            folder = "" if packed else str(PurePosixPath(member).parent)
            reader = _Reader(archive, read_units(root, file), {}, self.left, prefix, folder)
            inner = reader.system(top, depth + 1)
        except RefusalError as refusal:
            problem = refusal.problem
            place = problem.key if packed else problem.key.removeprefix(f"{SSD_FILE}: ")
            got = (f"{member}: {place}", problem.expected, problem.got, problem.hint)
            raise RefusalError(*got) from None
        if packed:
            self.archive.remarks += [f"{member}: {remark}" for remark in archive.remarks]
            archive.remarks.clear()
        connectors = {**inner.connectors, **self._connectors(element, where)}
        bindings = (*inner.bindings, *self._bindings(element, where))
        return replace(inner, name=name, connectors=connectors, bindings=bindings)

    def _member(self, uri: str, where: str) -> str:
        return self.archive.member(uri, where, self.folder)

    def _component(self, element: Element, name: str, depth: int) -> Component:
        where = f"{SSD_FILE}: {name[:60]}"
        kind = element.get("type", FMU_TYPE)
        if kind != FMU_TYPE:
            hint = "Other kinds of components are not available in this version."
            raise RefusalError(f"{where}: type", FMU_TYPE, quoted(kind), hint)
        implementation = element.get("implementation", "any")
        if implementation not in KINDS_OF:
            expected = listed(list(KINDS_OF), "or")
            raise RefusalError(f"{where}: implementation", expected, quoted(implementation))
        source = self.prefix + self._member(element.get("source", ""), f"{where}: source")
        own = self._note("Component", name, depth)
        gain = self._note("Gain", name, depth)
        return Component(
            name,
            source,
            self._connectors(element, where),
            self._bindings(element, where),
            "" if own is None else own.get("fmu", ""),
            "" if own is None else own.get("fmi", ""),
            gain is not None,
            None if gain is None else gain.get("gain_unit"),
            KINDS_OF[implementation],
        )

    def _connectors(self, element: Element, where: str) -> dict[str, Connector]:
        found: dict[str, Connector] = {}
        for connector in element.iterfind(f"{tag('ssd:Connectors')}/{tag('ssd:Connector')}"):
            name = connector.get("name", "")
            if name in found:
                raise RefusalError(where, "each connector once", quoted(name))
            found[name] = Connector(name, connector.get("kind", ""), self._unit(connector))
        return found

    def _unit(self, connector: Element) -> Unit | None:
        names = (child.get("unit", "") for child in connector)
        return next((self.units[name] for name in names if name in self.units), None)

    def _connection(self, element: Element, depth: int) -> Connection:
        ends = [
            (element.get(f"{end}Element") or None, element.get(f"{end}Connector", ""))
            for end in ("start", "end")
        ]
        connection = Connection(ends[0], ends[1])
        where = f"{SSD_FILE}: {connection.where}"
        if element.get("startIndices") or element.get("endIndices"):
            raise RefusalError(where, "a connection of single numbers", "elements of an array")
        own = self._note("Connection", f"{ends[1][0]}.{ends[1][1]}", depth)
        return Connection(
            ends[0],
            ends[1],
            read_transformation(element, where),
            truth(element.get("suppressUnitConversion", "false"), where),
            None if own is None else own.get("gain_unit"),
        )

    def _note(self, kind: str, name: str, depth: int) -> Element | None:
        """Return this package's note on an element of the outermost system."""
        return self.notes.get((kind, name)) if depth == 1 else None

    def _bindings(self, element: Element, where: str) -> tuple[Binding, ...]:
        each = element.iterfind(f"{tag('ssd:ParameterBindings')}/{tag('ssd:ParameterBinding')}")
        return tuple(self._binding(one, where) for one in each)

    def _binding(self, element: Element, where: str) -> Binding:
        self._refuse_other(element, PARAMETER_SET_TYPE, f"{where}: parameter binding")
        mapped = element.find(tag("ssd:ParameterMapping"))
        return binding(
            self._parameters(element, where),
            None if mapped is None else self._mapping(mapped, where),
            element.get("prefix", ""),
        )

    def _parameters(self, element: Element, where: str) -> tuple[Parameter, ...]:
        source = element.get("source")
        if source is not None:
            member = self._member(source, f"{where}: parameter binding")
            return read_parameter_set(self.archive.xml(member), member, None, self.archive.remarks)
        inline = element.find(f"{tag('ssd:ParameterValues')}/{tag('ssv:ParameterSet')}")
        if inline is None:
            raise RefusalError(f"{where}: parameter binding", "a source or values", "neither")
        return read_parameter_set(inline, f"{where}: parameter set", self.units, self.archive.remarks)

    def _mapping(self, element: Element, where: str) -> tuple[Mapped, ...]:
        where = f"{where}: parameter mapping"
        self._refuse_other(element, MAPPING_TYPE, where)
        source = element.get("source")
        if source is not None:
            member = self._member(source, where)
            return read_mapping(self.archive.xml(member), member)
        inline = element.find(tag("ssm:ParameterMapping"))
        if inline is None:
            raise RefusalError(where, "a source or entries", "neither")
        return read_mapping(inline, where)

    def _refuse_other(self, element: Element, kind: str, where: str) -> None:
        given = element.get("type", kind)
        if given != kind:
            raise RefusalError(f"{where}: type", kind, quoted(given))
        if element.get("sourceBase", "SSD") != "SSD":
            hint = "Copy the file out of the FMU into the archive."
            raise RefusalError(f"{where}: sourceBase", "SSD", quoted(element.get("sourceBase")), hint)


def _described(archive: SspArchive, file: str) -> tuple[Element, Element]:
    """Return the root of an SSD and its system."""
    root = archive.xml(file)
    expect(root, "ssd:SystemStructureDescription", file)
    refuse_version(root, file)
    top = root.find(tag("ssd:System"))
    if top is None:
        raise RefusalError(file, "one <System>", "none")
    return root, top


def _annotations(element: Element | None, kind: str) -> Iterator[Element]:
    """Yield the contents of annotations of one type, in an element and below it."""
    if element is not None:
        for annotation in element.iter(tag("ssc:Annotation")):
            if annotation.get("type") == kind:
                yield from annotation


def _noted(root: Element) -> Iterator[Element]:
    return (note for note in _annotations(root, ANNOTATION) if note.tag == tag("vibroimpact:Scene"))


def _notes(root: Element) -> dict[tuple[str, str], Element]:
    """Return the notes on elements by kind and name; a connection has the name of the input at its end."""
    found: dict[tuple[str, str], Element] = {}
    for scene in _noted(root):
        for note in scene:
            name = note.get("name") or f"{note.get('endElement')}.{note.get('endConnector')}"
            found[note.tag.rpartition("}")[2], name] = note
    return found


def _time(experiment: Element | None, key: str) -> float | None:
    text = None if experiment is None else experiment.get(key)
    return None if text is None else number(text, f"{SSD_FILE}: DefaultExperiment: {key}")


def _step(experiment: Element | None, root: Element) -> float | None:
    """Return the step of a fixed-step master from annotations of libcosim and OMSimulator, s."""
    for algorithm in _annotations(experiment, OSP_ANNOTATION):
        for fixed in algorithm.iterfind(tag("osp:FixedStepAlgorithm")):
            return number(fixed.get("baseStepSize", ""), f"{SSD_FILE}: FixedStepAlgorithm: baseStepSize")
    for master in root.iter():
        # its namespace differs between versions, and another tool names its step otherwise
        if master.tag.endswith("}FixedStepMaster") and "stepSize" in master.attrib:
            return number(master.get("stepSize", ""), f"{SSD_FILE}: FixedStepMaster: stepSize")
    return None
