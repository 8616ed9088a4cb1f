"""Conversion of the description of any tool's FMU to one that FMPy reads, with a list of its faults."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.model_description.findings import Finding, Findings, Grade
from vibroimpact.fmus.packaging.model_description.schema import amend_by_schema
from vibroimpact.fmus.packaging.model_description.structure import amend_structure
from vibroimpact.fmus.packaging.model_description.variables import amend_variables, variables_of
from vibroimpact.fmus.safe_xml import root_of


@dataclass(frozen=True, slots=True)
class Amended:
    """A description with its faults repaired as far as possible."""

    content: bytes
    """The XML; the original bytes if nothing was repaired."""
    findings: tuple[Finding, ...]
    """All faults of the description."""

    @property
    def refusals(self) -> tuple[str, ...]:
        """Faults beyond repair; empty for a description that can be read."""
        return tuple(finding.text for finding in self.findings if finding.grade is Grade.refused)


def amended(content: bytes, schemas: Path) -> Amended:
    """Return a modelDescription.xml that FMPy reads, with its faults by FMI's schemas in the folders `fmi2` and `fmi3`.

    Raise ComponentFileError for anything but XML, for a document type, or for an unknown version.
    """
    version = root_of(content, "modelDescription.xml").get("fmiVersion", "")
    if version != "2.0" and not version.startswith("3.0"):
        raise ComponentFileError(
            f"modelDescription.xml: expected FMI 2.0 or 3.0, got FMI {version[:20] or 'of no version'}."
        )
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise ComponentFileError(f"modelDescription.xml: expected well-formed XML, got: {error}.") from error
    findings = Findings()
    amend_by_schema(root, version, schemas, findings)
    if not any(finding.grade is Grade.refused for finding in findings.taken()):
        variables = variables_of(root, int(version[0]))
        amend_variables(root, variables, findings)
        amend_structure(root, variables, int(version[0]), findings)
    found = findings.taken()
    return Amended(etree.tostring(root) if found else content, found)
